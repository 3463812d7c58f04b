#!/usr/bin/env python3
"""Fits that show what limn fit does, each by one command; figures are in README.md beside this.

    scenes/fits/fits.py mirrors   a shape from its image before two mirrors, beside other gradients
    scenes/fits/fits.py shadows   a shape out of view, from three soft shadows
    scenes/fits/fits.py exact     the same from a loss without noise, by L-BFGS and by Adam
    scenes/fits/fits.py views     a shape from eight sides
    scenes/fits/fits.py pose      place, reflectance and camera of an object together
    scenes/fits/fits.py drift     from the very target: what noise does, and nothing else
    scenes/fits/fits.py tree      how far a tree is turned, from its shadow
    scenes/fits/fits.py gears     how far each of fifteen gears is turned, from their shadows
    scenes/fits/fits.py displacement  162 vertices along their normals, from eight sides
    scenes/fits/fits.py curves    of these three: scenes/pictures/fit_curves.webp
    scenes/fits/fits.py films     of these three: scenes/pictures/fit_films.webp
    scenes/fits/fits.py picture   of the shapes that these found: scenes/pictures/fits.webp

Writes OUT/NAME/ (pictures, meshes, report.html) and prints a table. A fit that is there is not run
again; an interrupted one goes on. --only 'seed 2,seed 3' runs and prints these fits alone.
"""

import argparse
import json
import math
import os
import resource
import struct
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
BUNNY = "/usr/share/glmark2/models/bunny.obj"
TERMS = "interior,camera"  # A fit without the boundary term: what mirrors show has edges, too.


class Fits:
    def __init__(self, arguments):
        self.limn, self.out = arguments.limn, arguments.output
        self.threads, self.steps = arguments.threads, arguments.steps
        n = arguments.size
        self.size = [f"width={n}", f"height={n}"] if n else []
        self.only = arguments.only.split(",") if arguments.only else None
        self.generated = os.path.join(ROOT, "build", "generated")

    def path(self, *names):
        return os.path.join(self.out, *names)

    def chosen(self, variants):
        """Those of (name, options) that --only names."""
        known = [name for name, _ in variants]
        unknown = [name for name in self.only or [] if name not in known]
        if unknown:
            sys.exit(f"--only: no fit {unknown[0]!r}; there are {', '.join(known)}")
        return [v for v in variants if not self.only or v[0] in self.only]

    def run(self, *words):
        """Processor time [s]."""
        command = [self.limn, *words]
        if self.threads:
            command += ["--threads", str(self.threads)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        if subprocess.run(command, check=False).returncode != 0:
            sys.exit(1)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

    def render(self, scene, file, *defines, spp=256, sensor=0, method="path", points=None):
        if not os.path.exists(file):
            words = [w for d in defines for w in ("-D", d)] + ["--sensor", str(sensor)]
            words += ["--method", method, "--seed", "99"]
            words += ["--points", points] if points else ["--spp", str(spp)]
            self.run("render", scene, *words, "-o", file)
        return file

    def fit(self, folder, scene, target, steps, *words):
        """The fit's figures; "seconds" are those of the processor, None where another ran it."""
        file, times = self.path(folder, "fit.json"), self.path(folder, "seconds.json")
        done = json.load(open(file, encoding="utf-8")) if os.path.exists(file) else None
        steps, seconds = self.steps or steps, None
        if done and os.path.exists(self.path(folder, "state.cbor")):
            if done["steps"] < steps:
                seconds = self.run("fit", "--resume", self.path(folder), "--steps", str(steps))
        else:
            # Four times the default: what the figures in README.md were taken with.
            samples = [] if "--points" in words else ["--camera-samples", "1"]
            seconds = self.run("fit", scene, "--target", target, "--steps", str(steps),
                               *samples, "-o", self.path(folder), *words)  # fmt: skip
        known = json.load(open(times, encoding="utf-8")) if os.path.exists(times) else None
        if seconds and (known is not None or not done):
            known = (known or 0) + seconds
            json.dump(known, open(times, "w", encoding="utf-8"))
        return json.load(open(file, encoding="utf-8")) | {"seconds": known}


def scene(name):
    return os.path.join(HERE, name)


SHAPE_HEAD = [
    "fit", "steps", "chamfer", "95 %", "normals", "inside out", "crossings", "loss", "seconds"
]


def seconds_of(fit):
    return "not known" if fit["seconds"] is None else f"{fit['seconds']:.0f}"


def shape_row(name, fit, mesh, steps):
    history = fit["history"][:steps]
    loss = sum(h["loss"] for h in history[-5:]) / len(history[-5:]) if history else 0
    return [name, steps, f"{mesh['chamfer']:.4f}", f"{mesh['hausdorff_95']:.4f}",
            f"{mesh['normal_angle']:.1f}", mesh["inside_out"], mesh["crossings"],
            f"{loss:.5f}" if history else "", seconds_of(fit) if history else ""]  # fmt: skip


def shape_rows(fits, name, base, targets, truth, steps, defines, words, variants, smoothing):
    """Of a shape that is fitted from base_start.xml, by some variants of one command.

    steps: in all; or of each variant those to show, the last in all.
    """
    own = [w for d in defines for w in ("-D", d)]
    own += ["--wrt", "object.vertex_positions", "--truth", truth]
    own += [w for t in targets[1:] for w in ("--target", t)]
    rows = []
    for variant, more in fits.chosen(variants):
        folder = f"{name}_{variant.replace(' ', '_')}"
        shown = steps[variant] if isinstance(steps, dict) else [steps]
        step = [] if "--step" in more else ["--step", "2"]
        fit = fits.fit(folder, scene(f"{base}_start.xml"), targets[0], shown[-1], *own, *words,
                       *step, "--smoothing", str(smoothing), *more)  # fmt: skip
        meshes = {s["step"]: s["meshes"][0] for s in fit["snapshots"]}
        if not rows:
            rows.append(shape_row("start", fit, meshes[0], 0))
        for at in [s for s in shown[:-1] if s in meshes and s < fit["steps"]] + [fit["steps"]]:
            rows.append(shape_row(variant, fit, meshes[at], at))
    return SHAPE_HEAD, rows


def mirrors(fits):
    size = ["width=64", "height=32"]
    target = fits.render(scene("two_mirrors.xml"), fits.path("mirrors.exr"), *size)
    words = ["--snapshots", "25"]
    remesh = ["--spp", "6", "--remesh", "75,150,225"]
    variants = [(f"seed {i}", [*remesh, "--seed", str(i)]) for i in (1, 2, 3)]
    variants += [
        ("no remeshing", ["--spp", "6", "--seed", "1"]),
        # As much time as the others: its draws cost less.
        ("edges of li2019", ["--spp", "7", *remesh[2:], "--seed", "1", "--sampler", "li2019"]),
        ("no boundary", [*remesh, "--seed", "1", "--terms", TERMS]),
        ("small start", [*remesh, "--seed", "1", "-D", "radius=0.15"]),
    ]
    truth = os.path.join(fits.generated, "creature.ply")
    return shape_rows(
        fits, "mirrors", "two_mirrors", [target], truth, 300, size, words, variants, 0.1
    )


def shadows(fits):
    size = ["width=64", "height=48"]
    target = fits.render(scene("hidden_object.xml"), fits.path("shadows.exr"), *size)
    words = ["--spp", "6", "--remesh", "50,100", "--snapshots", "25"]
    lamps = ["--sampler", "silhouettes"]  # regions of light apart
    variants = [(f"seed {i}", [*lamps, "--seed", str(i)]) for i in (1, 2, 3)]
    variants += [
        ("edges of forest", ["--seed", "1"]),
        ("uniform pixels", [*lamps, "--seed", "1", "--pixels", "uniform"]),
        ("no boundary", ["--seed", "1", "--terms", TERMS]),
    ]
    truth = os.path.join(fits.generated, "creature.ply")
    return shape_rows(
        fits, "shadows", "hidden_object", [target], truth, 150, size, words, variants, 0.1
    )


def exact(fits):
    size = ["width=64", "height=48"]
    target = fits.render(
        scene("hidden_object.xml"), fits.path("exact.exr"), *size, spp=8, method="analytic"
    )
    words = ["--spp", "1", "--snapshots", "10", "--sampler", "analytic"]
    newton = ["--optimiser", "lbfgs", "--step", "1"]
    steps = {"lbfgs": [10, 20, 40], "lbfgs remeshed": [45], "adam": [20, 60]}
    variants = [
        ("lbfgs", newton),
        ("lbfgs remeshed", [*newton, "--remesh", "15,30"]),
        ("adam", []),
    ]
    truth = os.path.join(fits.generated, "creature.ply")
    return shape_rows(
        fits, "exact", "hidden_object", [target], truth, steps, size, words, variants, 0.1
    )


def views(fits):
    size = ["width=40"]
    targets = [
        fits.render(scene("eight_views.xml"), fits.path(f"view_{i}.exr"), *size, sensor=i)
        for i in range(8)
    ]
    words = ["--spp", "2", "--snapshots", "30"]
    remesh = ["--remesh", "40,80,120"]
    variants = [(f"seed {i}", [*remesh, "--seed", str(i)]) for i in (1, 2, 3)]
    variants += [
        (f"no remeshing{seed}", ["--seed", i])
        for seed, i in (("", "1"), (" 2", "2"), (" 3", "3"))
    ]
    truth = BUNNY
    return shape_rows(
        fits, "views", "eight_views", targets, truth, 160, size, words, variants, 0.1
    )


def pose(fits):
    size = ["width=64", "height=32"]
    target = fits.render(scene("two_mirrors.xml"), fits.path("pose.exr"), *size, spp=1024)
    names = [f"object.translate.{a}" for a in "xyz"] + [f"object.rotate.{a}" for a in "xyz"]
    names += ["clay.reflectance", "sensor.translate.x"]
    start = {"x": 0.15, "y": -0.1, "z": 0.2, "angle": 12, "clay": 0.4, "view": 0.2}
    words = [w for n in names for w in ("--wrt", n)]
    words += [w for n, v in start.items() for w in ("-D", f"{n}={v}")]
    words += [w for d in size for w in ("-D", d)]
    words += ["--spp", "8", "--step", "2", "--step-half-life", "30"]
    words += ["--truth", os.path.join(fits.generated, "creature.ply")]
    variants = fits.chosen([(f"seed {i}", ["--seed", str(i)]) for i in (1, 2, 3)])
    known = {f"clay.reflectance.{c}": (0.4, 0.6) for c in "rgb"} | {"sensor.translate.x": (0.2, 0)}
    rows = []
    for name, seed in variants:
        folder = f"pose_{name.replace(' ', '_')}"
        fit = fits.fit(folder, scene("two_mirrors.xml"), target, 160, *words, *seed)
        first, last = (fit["snapshots"][i]["meshes"][0] for i in (0, -1))
        if not rows:
            rows = [["chamfer / diagonal", f"{first['chamfer']:.4f}", "0"]]
            for s in fit["scalars"]:
                rows.append([s["name"], *known.get(s["name"], (0, ""))])
            rows.append(["seconds", "", ""])
        found = [last["chamfer"], *(s["value"] for s in fit["scalars"])]
        for row, number in zip(rows, found):
            row.append(f"{number:.5f}")
        rows[-1].append(seconds_of(fit))
    return ["what", "start", "truth", *(name for name, _ in variants)], rows


def positions(file):
    """Flat list of coordinates of a binary PLY by limn."""
    content = open(file, "rb").read()
    end = content.index(b"end_header\n") + 11
    count = int(content.split(b"element vertex ")[1].split()[0])
    return struct.unpack(f"<{3 * count}f", content[end : end + 12 * count])


def drift(fits):
    size = ["width=48", "height=24"]
    truth = fits.path("coarse.ply")
    if not os.path.exists(truth):
        generate = os.path.join(os.path.dirname(fits.limn), "limn_generate")
        subprocess.run([generate, "creature", truth, "--faces", "3000"], check=True)
    size += [f"mesh={os.path.abspath(truth)}"]
    target = fits.render(scene("two_mirrors.xml"), fits.path("drift.exr"), *size, spp=4096)
    words = ["--wrt", "object.vertex_positions", "--truth", truth, "--spp", "4", "--step", "0.02"]
    words += [w for d in size for w in ("-D", d)]
    moved, rows = [], []
    for seed in (1, 2, 3):
        folder = f"drift_{seed}"
        fit = fits.fit(folder, scene("two_mirrors.xml"), target, 60, *words, "--seed", str(seed))
        first, last = (fit["snapshots"][i]["meshes"][0] for i in (0, -1))
        start, end = (positions(fits.path(folder, m["file"])) for m in (first, last))
        moved.append([b - a for a, b in zip(start, end)])
        rows.append([f"seed {seed}", f"{last['chamfer']:.5f}", f"{last['normal_angle']:.2f}"])
    # Systematic drift would move all seeds the same way; random walks have no angle in common.
    norm = [math.sqrt(sum(x * x for x in m)) for m in moved]
    angles = [
        sum(x * y for x, y in zip(moved[i], moved[k])) / (norm[i] * norm[k])
        for i in range(len(moved))
        for k in range(i)
    ]
    rows.append(["cosines of pairs", " ".join(f"{a:.2f}" for a in angles), ""])
    return ["fit", "chamfer / diagonal", "normals"], rows


# What the sampler "analytic" and the optimiser "lbfgs" make of a loss, beside Adam and beside
# gradients with noise. Steps of Adam are halved as they go on, or it would end in circles.
FUNCTION = ["--sampler", "analytic", "--points", "faces"]
NEWTON = [*FUNCTION, "--optimiser", "lbfgs"]


def curve(fit):
    """At each step: losses and gradients so far, processor seconds, loss.

    Every step takes one of both, but for those of L-BFGS, which say how many they took.
    """
    points, count = [], 0
    for number, step in enumerate(fit["history"], 1):
        points.append((max(number, count), step["loss"]))
        count += step["evaluations"]
    each = (fit["seconds"] or 0) / max(1, count)
    return [(k, k * each, loss) for k, loss in points]


def reached(fit, part):
    """Losses and gradients, and seconds, from which on the loss is at most that part of the first.

    None where it never stays there.
    """
    points, found = curve(fit), None
    for count, seconds, loss in reversed(points):
        if loss > part * points[0][2]:
            break
        found = count, seconds
    return found


def targets_of(fits, name, base, defines, sensors=1):
    """For each sensor the image as a function of the scene, and what samples have in the mean."""
    lists = []
    for kind, more in (("", {"points": "faces"}), ("_mean", {"spp": 32})):
        lists.append([
            fits.render(scene(base), fits.path(f"{name}{kind}_{i}.exr"), *fits.size, *defines,
                        sensor=i, method="analytic", **more)
            for i in range(sensors)
        ])  # fmt: skip
    return lists


def compare(fits, name, base, targets, defines, parameters, variants, error):
    """A row for each of (name, steps, options); error(folder, fit): of the parameters at last."""
    rows = []
    chosen = fits.chosen([(variant, (steps, more)) for variant, steps, more in variants])
    for variant, (steps, more) in chosen:
        folder = f"{name}_{variant.replace(' ', '_')}"
        own = targets[0] if "analytic" in more else targets[1]
        words = [w for p in parameters for w in ("--wrt", p)]
        words += [w for d in [*fits.size, *defines] for w in ("-D", d)]
        words += [w for t in own[1:] for w in ("--target", t)]
        fit = fits.fit(folder, scene(base), own[0], steps, *words, *more)
        first = fit["history"][0]["loss"]
        cells = [variant, fit["steps"], f"{fit['history'][-1]['loss'] / first:.1e}"]
        for part in (0.1, 0.01, 0.001):
            at = reached(fit, part)
            cells.append(f"{at[0]}, {at[1]:.0f} s" if at else "not")
        rows.append([*cells, error(folder, fit), seconds_of(fit)])
    return ["fit", "steps", "last / first loss", "to 1/10", "to 1/100", "to 1/1000", "error",
            "seconds"], rows  # fmt: skip


def angles(truths):
    """The root of the mean squared error of angles, in degrees."""

    def error(_, fit):
        squares = [(s["value"] - t) ** 2 for s, t in zip(fit["scalars"], truths)]
        return f"{math.degrees(math.sqrt(sum(squares) / len(squares))):.3f} degrees"

    return error


TREE = 20  # degrees from the start to the truth


def tree(fits):
    targets = targets_of(fits, "tree", "tree_shadow.xml", [f"turn={TREE}"])
    noisy = ["--spp", "16", "--step", "3", "--step-half-life", "25", "--seed", "1"]
    variants = [
        ("lbfgs", 8, [*NEWTON, "--step", "5"]),
        ("adam", 45, [*FUNCTION, "--optimiser", "adam", "--step", "3", "--step-half-life", "12"]),
        ("adam of forest", 60, noisy),
    ]
    return compare(fits, "tree", "tree_shadow.xml", targets, [], ["object.rotate.y"], variants,
                   angles([math.radians(TREE)]))  # fmt: skip


# By how many degrees each gear is off at the start.
GEARS = [11, -9, 12, -12, 8, 10, -11, 16, -18, 17, -15, 18, -17, 17, -16]


def gears(fits):
    targets = targets_of(fits, "gears", "gears.xml", [])
    start = [f"off_{i}={a}" for i, a in enumerate(GEARS)]
    names = [f"gear_{i}.rotate.y" for i in range(len(GEARS))]
    noisy = ["--spp", "16", "--step", "4", "--step-half-life", "20", "--seed", "1"]
    variants = [
        ("lbfgs", 28, [*NEWTON, "--step", "5"]),
        ("adam", 80, [*FUNCTION, "--optimiser", "adam", "--step", "4", "--step-half-life", "20"]),
        ("adam of forest", 80, noisy),
    ]
    return compare(fits, "gears", "gears.xml", targets, start, names, variants,
                   angles([math.radians(-a) for a in GEARS]))  # fmt: skip


def stone(fits):
    """The ball's vertices, and the mesh whose vertices lie elsewhere along its normals."""
    ball = os.path.join(fits.generated, "ball.ply")
    content = open(ball, "rb").read()
    flat = positions(ball)
    places = [flat[i : i + 3] for i in range(0, len(flat), 3)]
    faces = [struct.unpack("<3i", content[i : i + 12])
             for i in range(len(content) - 13 * 320 + 1, len(content), 13)]  # fmt: skip
    directions = normals(places, faces)
    moved = []
    for p, n in zip(places, directions):
        by = 0.16 * math.sin(3 * p[0] + 1) * math.cos(2.5 * p[1]) + 0.1 * math.sin(4 * p[2] + 2)
        moved.append([x + by * d for x, d in zip(p, n)])
    file = fits.path("stone.obj")
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in moved]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    open(file, "w", encoding="utf-8").write("\n".join(lines) + "\n")
    return file, moved


def normals(places, faces):
    """Of vertices: the mean of those of the faces around, weighted by their angles there."""

    def unit(v):
        size = math.sqrt(sum(x * x for x in v))
        return [x / size for x in v]

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    sums = [[0, 0, 0] for _ in places]
    for face in faces:
        for k in range(3):
            at, b, c = (places[face[(k + i) % 3]] for i in range(3))
            u, v = (unit([x - y for x, y in zip(p, at)]) for p in (b, c))
            angle = math.acos(sum(x * y for x, y in zip(u, v)))
            for i, x in enumerate(unit(cross(u, v))):
                sums[face[k]][i] += angle * x
    return [unit(s) for s in sums]


def displacement(fits):
    mesh, truth = stone(fits)
    shape = [f"mesh={os.path.abspath(mesh)}", "format=obj"]
    targets = targets_of(fits, "stone", "displacement.xml", shape, 8)

    def error(folder, fit):
        found = positions(fits.path(folder, fit["snapshots"][-1]["meshes"][0]["file"]))
        squares = [(a - b) ** 2 for a, b in zip(found, [x for v in truth for x in v])]
        return f"{math.sqrt(sum(squares) / len(truth)):.4f}"

    even = ["--smoothing", "0"]
    noisy = ["--spp", "4", "--step", "2", "--step-half-life", "40", "--seed", "1"]
    variants = [
        ("lbfgs", 40, [*even, *NEWTON, "--step", "1"]),
        ("adam", 100, [*even, *FUNCTION, "--step", "2", "--step-half-life", "30"]),
        ("adam of forest", 100, [*even, *noisy]),
    ]
    return compare(fits, "displacement", "displacement.xml", targets, [],
                   ["object.displacement"], variants, error)  # fmt: skip


def curves(fits):
    import matplotlib  # noqa: PLC0415

    matplotlib.use("agg")
    from matplotlib import pyplot  # noqa: PLC0415

    names, rows = ["tree", "gears", "displacement"], []
    figure, panels = pyplot.subplots(len(names), 2, figsize=(9, 8), sharey="row")
    for name, (by_count, by_time) in zip(names, panels):
        for variant in ("lbfgs", "adam", "adam of forest", "lbfgs of forest same"):
            folder = fits.path(f"{name}_{variant.replace(' ', '_')}")
            if not os.path.exists(folder):
                continue
            fit = json.load(open(os.path.join(folder, "fit.json"), encoding="utf-8"))
            times = os.path.join(folder, "seconds.json")
            fit["seconds"] = json.load(open(times, encoding="utf-8"))
            points = [p for p in curve(fit) if p[2] > 0]
            first = fit["history"][0]["loss"]
            for panel, x in ((by_count, 0), (by_time, 1)):
                panel.plot([p[x] for p in points], [p[2] / first for p in points], label=variant)
            rows.append([name, variant, f"{points[-1][2] / first:.1e}"])
        by_count.set_ylabel(f"{name}: loss over the first")
        for panel in (by_count, by_time):
            panel.set_yscale("log")
            panel.set_xscale("log")
            panel.grid(alpha=0.3)
    panels[-1][0].set_xlabel("losses and gradients")
    panels[-1][1].set_xlabel("seconds of the processor")
    panels[1][0].legend(frameon=False)
    figure.tight_layout()
    file = os.path.join(ROOT, "scenes", "pictures", "fit_curves.webp")
    figure.savefig(file, dpi=90, pil_kwargs={"quality": 80, "method": 6})
    return ["scene", "fit", "last / first loss"], rows


def films(fits):
    """What L-BFGS shows at some of its steps, and what it is to meet."""
    import matplotlib  # noqa: PLC0415

    matplotlib.use("agg")
    from matplotlib import pyplot  # noqa: PLC0415

    shown = {"tree": (0, 1, 2, 4, 8), "gears": (0, 8, 12, 16, 28), "displacement": (0, 4, 8, 16, 40)}
    columns = max(map(len, shown.values())) + 1
    figure, panels = pyplot.subplots(len(shown), columns, figsize=(9, 4.9))
    for (name, steps), row in zip(shown.items(), panels):
        files = [f"step_{step:05}_view_0.png" for step in steps] + ["view_0_target.png"]
        for panel, file, title in zip(row, files, [*(f"{name}, {s}" for s in steps), "target"]):
            image = pyplot.imread(fits.path(f"{name}_lbfgs", file))
            panel.imshow(image, interpolation="nearest")
            panel.set_title(title, fontsize=8)
            panel.axis("off")
    figure.tight_layout(pad=0.4)
    file = os.path.join(ROOT, "scenes", "pictures", "fit_films.webp")
    figure.savefig(file, dpi=90, pil_kwargs={"quality": 85, "method": 6})
    return ["scene", "steps"], [[name, *steps] for name, steps in shown.items()]


# A row for each: truth, start, and fits at some of their steps.
SHOWN = [
    ("creature.ply", [("mirrors_seed_1", 0), ("mirrors_seed_1", 75), ("mirrors_seed_1", 300),
                      ("mirrors_edges_of_li2019", 300), ("mirrors_no_remeshing", 300),
                      ("mirrors_no_boundary", 300)]),
    ("creature.ply", [("shadows_seed_1", 0), ("shadows_seed_1", 50), ("shadows_seed_1", 150),
                      ("shadows_edges_of_forest", 150), ("shadows_uniform_pixels", 150),
                      ("shadows_no_boundary", 150)]),
    ("bunny.obj", [("views_seed_1", 0), ("views_seed_1", 30), ("views_seed_1", 60),
                   ("views_seed_1", 90), ("views_seed_1", 120), ("views_seed_1", 160)]),
]  # fmt: skip


def picture(fits):
    from PIL import Image  # noqa: PLC0415

    tile, rows, table = 128, [], []
    for truth, shown in SHOWN:
        true = os.path.join(fits.generated, truth) if truth.endswith("ply") else BUNNY
        meshes = [true] + [fits.path(f, f"step_{step:05}_object.ply") for f, step in shown]
        row = []
        for k, mesh in enumerate(meshes):
            file = fits.path("picture", f"{len(rows)}_{k}.exr")
            view = [f"mesh={os.path.abspath(mesh)}", f"format={mesh[-3:]}", f"width={tile}"]
            fits.render(scene("eight_views.xml"), file, *view, spp=64, sensor=7)
            row.append(Image.open(file[:-3] + "png").convert("RGB"))
        rows.append(row)
        table.append([truth, "truth", *(f"{f} {step}" for f, step in shown)])
    whole = Image.new("RGB", (tile * max(map(len, rows)), tile * len(rows)), "white")
    for y, row in enumerate(rows):
        for x, shape in enumerate(row):
            whole.paste(shape, (tile * x, tile * y))
    whole.save(os.path.join(ROOT, "scenes", "pictures", "fits.webp"), quality=80, method=6)
    return ["row", *([""] * 7)], table


EXPERIMENTS = {"mirrors": mirrors, "shadows": shadows, "exact": exact, "views": views, "pose": pose,
               "drift": drift, "tree": tree, "gears": gears, "displacement": displacement,
               "curves": curves, "films": films, "picture": picture}  # fmt: skip


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", choices=EXPERIMENTS, metavar="NAME", help=", ".join(EXPERIMENTS))
    parser.add_argument("-o", "--output", default=os.path.join(ROOT, "out", "fits"))
    parser.add_argument("--steps", type=int, help="in place of the experiment's own number")
    parser.add_argument("--size", type=int, help="pixels a side: of tree, gears, displacement")
    parser.add_argument("--only", metavar="FITS", help="of the experiment's, with commas between")
    parser.add_argument("--threads", type=int, help="default: all cores")
    parser.add_argument("--limn", default=os.path.join(ROOT, "build", "limn"), help="the program")
    arguments = parser.parse_args()
    if arguments.only and arguments.name in ("drift", "curves", "films", "picture"):
        parser.error(f"--only: {arguments.name} is one whole")
    os.makedirs(arguments.output, exist_ok=True)
    head, rows = EXPERIMENTS[arguments.name](Fits(arguments))
    for row in [head, *rows]:
        print("  ".join(f"{cell!s:>18}" for cell in row))


if __name__ == "__main__":
    main()
