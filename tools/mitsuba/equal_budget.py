#!/usr/bin/env python3
"""limn and Mitsuba 3's prb_projective with an equal budget of samples (Fig. 11 of Soroka et al. 2025).

    tools/mitsuba/equal_budget.py SCENE --wrt SHAPE.translate.y --spp N --methods quadric,adaptive \\
        --reference FILE.exr -o FOLDER

limn's methods take N samples per pixel. prb_projective has N projections per pixel for its octree,
and N pairs of light paths per pixel: n for the image, of which it tries some, and for each leaf as
many as are left, (N - n) pixels / leaves. Its interior and camera terms have N samples. Writes
FOLDER/budget.json: mean squared errors against the reference. Without Mitsuba limn's rows are all.
"""

import argparse
import json
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.dirname(HERE)]

import exr  # noqa: E402
import mitsuba_gradient as gradient  # noqa: E402
import numpy as np  # noqa: E402

SHARES = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 3 / 4, 15 / 16)  # n / N


def read(file):
    channels = exr.read(file)
    return np.stack([channels[c] for c in "RGB"], axis=-1)


def limn_rows(arguments, reference):
    for method in arguments.methods.split(","):
        stem = os.path.join(arguments.output, method)
        subprocess.run(
            [arguments.limn, "gradient", arguments.scene, "--wrt", arguments.wrt, "--method", method,
             "--spp", str(arguments.spp), "--seed", str(arguments.seed), "-o", f"{stem}.exr", "--json",
             f"{stem}.json", *(["--threads", str(arguments.threads)] if arguments.threads else []),
             *(word for name, value in arguments.D for word in ("-D", f"{name}={value}"))],
            check=True, stdout=subprocess.DEVNULL)
        yield {"name": method, "spp": arguments.spp, "trials": 0, "leaves": 0,
               "mse": float(((read(f"{stem}.exr") - reference) ** 2).mean())}


class Boundary(gradient.Term):
    """The boundary term by an octree whose leaves share a number of light paths."""

    def __init__(self, mi, settings, projections, paths):
        super().__init__(mi, "boundary", settings, "octree", projections)
        self._octree, self._paths, self.leaves, self.trials = mi.ad.OcSpaceDistr, paths, 0, 0

    def estimate(self, scene, motion, seed, spp):
        build = self._octree.construct_octree

        def construct(octree, points, log=False):
            lower, upper = build(octree, points, log)
            self.leaves = len(lower.x)
            self.trials = octree.extra_spc = max(1, round(self._paths / self.leaves))
            return lower, upper

        self._octree.construct_octree = construct
        try:
            return super().estimate(scene, motion, seed, spp)
        finally:
            self._octree.construct_octree = build


def mitsuba_rows(arguments, reference):
    mi, dr = gradient.load_mitsuba()
    renderer = gradient.Renderer(mi, dr, arguments)
    settings = gradient.path_settings(mi, arguments.scene, dict(arguments.D))
    seed, spp = 1000003 * arguments.seed, arguments.spp
    terms = [gradient.Term(mi, name, settings, "octree", spp) for name in ("interior", "camera")]
    others = sum(term.estimate(renderer.scene, renderer.motion, seed + k, spp)
                 for k, term in enumerate(terms))
    for k, share in enumerate(SHARES, len(terms)):
        here = max(1, round(share * spp))
        term = Boundary(mi, settings, spp, (spp - here) * reference[..., 0].size)
        image = others + term.estimate(renderer.scene, renderer.motion, seed + k, here)
        yield {"name": "mitsuba", "spp": here, "trials": term.trials, "leaves": term.leaves,
               "mse": float(((image - reference) ** 2).mean())}


def run(arguments):
    reference = read(arguments.reference)
    result = {"spp": arguments.spp, "rows": list(limn_rows(arguments, reference)), "missing": ""}
    try:
        result["rows"] += mitsuba_rows(arguments, reference)
    except gradient.Failure as failure:
        result["missing"] = str(failure)
    with open(os.path.join(arguments.output, "budget.json"), "w", encoding="utf-8") as stream:
        json.dump(result, stream, indent=2)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--wrt", required=True, metavar="PARAM")
    parser.add_argument("--methods", required=True, help="of limn")
    parser.add_argument("--limn", default=os.path.join(HERE, "..", "..", "build", "limn"))
    parser.add_argument("--spp", type=gradient.positive(int), default=128)
    parser.add_argument("--reference", required=True, metavar="FILE.exr")
    parser.add_argument("--threads", type=gradient.positive(int), help="default: all cores")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-D", action="append", type=gradient.define, default=[], metavar="NAME=VALUE")
    parser.add_argument("-o", "--output", required=True, metavar="FOLDER")
    parser.set_defaults(guiding="octree")
    run(parser.parse_args())
    return 0


if __name__ == "__main__":
    sys.exit(main())
