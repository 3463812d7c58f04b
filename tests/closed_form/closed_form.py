#!/usr/bin/env python3
"""Scenes whose picture and derivatives are known in closed form: writes scenes/closed_form.

  tests/closed_form/closed_form.py                 writes every scene and references.json (needs numpy)
  tests/closed_form/closed_form.py --mitsuba       compares them with Mitsuba 3 (needs mitsuba), see README there

Derivatives are central differences of the closed form, of eighth order, in double precision: they
come from formulas alone, no random number enters. Every scene is evaluated twice, with more Gauss
nodes and half the step the second time; the largest difference is written as its "accuracy".
"""
import argparse
import json
import os
import sys

import numpy as np

from closed_form_files import write_scene
from closed_form_geometry import moved
from closed_form_scenes import SCENES

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scenes", "closed_form")
ROUNDING = 5e-10  # of the ten digits that are written
STENCIL = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
TERMS = {"interior": (0, 1, 0, 0), "camera": (1, 0, 0, 0), "boundary": (0, 0, 1, 0),
         "shadow": (0, 0, 0, 1), "total": (1, 1, 1, 1)}


def derivative(scene, model, name, term, order, step):
    """d image / d parameter of one term: height by width by 3, truncation error O(step^8)."""
    total = np.zeros((scene.camera.height, scene.camera.width, 3))
    if (term == "camera" and not model.outlines_in_view) or (term == "shadow" and not scene.lights):
        return total
    for k, weight in STENCIL.items():
        for sign in (1, -1):
            other = moved(scene, name, sign * k * step)
            lanes = [other if on else scene for on in TERMS[term]]
            total = total + sign * weight / step * model.image(*lanes, order)
    return total


def evaluate(scene, model, names, order, step):
    """The image, and every parameter's terms."""
    image = model.image(scene, scene, scene, scene, order)
    kinds = [t for t in TERMS if t != "shadow" or scene.lights]
    terms = {n: {t: derivative(scene, model, n, t, order, step) for t in kinds} for n in names}
    for name, values in terms.items():
        rest = 2 * values["total"] - sum(values.values())
        assert np.max(np.abs(rest)) < 1e-8 * (1 + np.max(np.abs(values["total"]))), name
    return image, terms


def largest_difference(a, b):
    """Relative to the largest value of each image, as the worst of all."""
    worst = np.max(np.abs(a[0] - b[0])) / np.max(np.abs(b[0]))
    for name, terms in b[1].items():
        size = np.max(np.abs(terms["total"]))
        for term, value in terms.items():
            worst = max(worst, np.max(np.abs(a[1][name][term] - value)) / max(size, 1e-300))
    return worst


def flat(image, size):
    """Row by row, pixel by pixel, channel by channel; what is only rounding is written as 0."""
    return [0.0 if abs(x) < 1e-9 * size else float(f"{x:.10g}") for x in image.ravel()]


def reference(key):
    scene, model, names = SCENES[key]()
    rough = evaluate(scene, model, names, 5, 2.0**-9)
    image, terms = evaluate(scene, model, names, 7, 2.0**-10)
    accuracy = max(largest_difference(rough, (image, terms)), ROUNDING)
    print(f"{key}: {len(names)} parameters, accuracy {accuracy:.1e}", flush=True)
    size = {n: np.max(np.abs(t["total"])) for n, t in terms.items()}
    return scene, {
        "file": scene.name, "width": scene.camera.width, "height": scene.camera.height,
        "filter": scene.camera.filter, "accuracy": float(f"{accuracy:.1e}"),
        "image": flat(image, np.max(np.abs(image))),
        "parameters": [{"name": n, **{t: flat(v, size[n]) for t, v in terms[n].items()}}
                       for n in names]}


def write_references(keys, folder):
    path = os.path.join(folder, "references.json")
    known = {}
    if os.path.exists(path):
        with open(path) as file:
            known = {s["file"]: s for s in json.load(file)["scenes"]}
    for key in keys:
        scene, entry = reference(key)
        write_scene(scene, folder)
        known[entry["file"]] = entry
    entries = [known[f"{k}.xml"] for k in SCENES if f"{k}.xml" in known]
    with open(path, "w") as file:
        file.write('{"scenes": [\n' + ",\n".join(scene_json(e) for e in entries) + "\n]}\n")


def scene_json(entry):
    """One line per scene head and per parameter: readable differences."""
    head = {k: v for k, v in entry.items() if k != "parameters"}
    lines = ",\n  ".join(json.dumps(p) for p in entry["parameters"])
    return json.dumps(head)[:-1] + ', "parameters": [\n  ' + lines + "]}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", nargs="*", help="keys of SCENES; all if none is given")
    parser.add_argument("--out", default=FOLDER, help="folder for the scenes")
    parser.add_argument("--mitsuba", action="store_true", help="compare with Mitsuba 3 instead")
    parser.add_argument("--spp", type=int, default=1 << 16)
    args = parser.parse_args()
    unknown = set(args.scenes) - set(SCENES)
    if unknown:
        parser.error(f"unknown {', '.join(sorted(unknown))}; known: {', '.join(SCENES)}")
    if args.mitsuba:
        from closed_form_mitsuba import compare
        return compare(args.scenes or list(SCENES), args.spp)
    write_references(args.scenes or list(SCENES), args.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
