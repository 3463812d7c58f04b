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
    scenes/fits/fits.py regularised  from bad starts, see ../regularised
    scenes/fits/fits.py bad_starts   a film of these: scenes/pictures/bad_starts.webp
    scenes/fits/fits.py sweeps       derivatives by sigma and gamma: scenes/pictures/sweeps.webp
    scenes/fits/fits.py curves    of these three: scenes/pictures/fit_curves.webp
    scenes/fits/fits.py picture   of the shapes that these found: scenes/pictures/fits.webp

Writes OUT/NAME/ (pictures, meshes, report.html) and prints a table. A fit that is there is not run
again; an interrupted one goes on. --only 'seed 2,seed 3' runs and prints these fits alone.
"""

import argparse
import json
import math
import os
import resource
import subprocess
import sys
from dataclasses import dataclass, field

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path.insert(0, os.path.join(ROOT, "tools"))

from common import labelled, read_json  # noqa: E402
from report.python import use_one_with_matplotlib  # noqa: E402

BUNNY = "/usr/share/glmark2/models/bunny.obj"
CREATURE = os.path.join(ROOT, "build", "generated", "creature.ply")
BALL = os.path.join(ROOT, "build", "generated", "ball.ply")

# How limn fit names its methods.
LI2019, SILHOUETTES, ANALYTIC = (
    f"--method {name}" for name in ("li2019", "silhouettes", "analytic"))
NO_BOUNDARY = "--terms interior,camera"  # What mirrors show has edges, too.
# A loss that is a function, without noise, and what L-BFGS makes of it. Steps of Adam are halved as
# they go on, or it would end in circles.
FUNCTION = f"{ANALYTIC} --points faces"
NEWTON = f"{FUNCTION} --optimiser lbfgs"


class Fits:
    """Runs limn, and keeps what it wrote. Options are texts with spaces between."""

    def __init__(self, arguments):
        self.limn, self.out = arguments.limn, arguments.output
        self.threads, self.steps = arguments.threads, arguments.steps
        n = arguments.size
        self.size = [f"width={n}", f"height={n}"] if n else []
        self.only = arguments.only.split(",") if arguments.only else None

    def path(self, *names):
        return os.path.join(self.out, *names)

    def chosen(self, variants):
        """The names that --only gives."""
        unknown = [name for name in self.only or [] if name not in variants]
        if unknown:
            sys.exit(f"--only: no fit {unknown[0]!r}; there are {', '.join(variants)}")
        return [name for name in variants if not self.only or name in self.only]

    def run(self, *words):
        """Processor time [s]."""
        threads = ["--threads", str(self.threads)] if self.threads else []
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        if subprocess.run([self.limn, *words, *threads], check=False).returncode != 0:
            sys.exit(1)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

    def render(self, name, file, defines, options="--spp 256", sensor=0):
        """The path of OUT/FILE, which is made if it is not there."""
        if not os.path.exists(self.path(file)):
            self.run("render", scene(name), *defined(defines), "--sensor", str(sensor), "--seed",
                     "99", *options.split(), "-o", self.path(file))
        return self.path(file)

    def fit(self, folder, name, targets, steps, options, defines):
        """The fit's figures; "seconds" are those of the processor, None where another ran it."""
        out, times = self.path(folder), self.path(folder, "seconds.json")
        done, steps, seconds = read_json(self.path(folder, "fit.json")), self.steps or steps, None
        if done and os.path.exists(self.path(folder, "state.cbor")):
            if done["steps"] < steps:
                seconds = self.run("fit", "--resume", out, "--steps", str(steps))
        else:
            seconds = self.run("fit", scene(name), *repeated("--target", targets), "--steps",
                               str(steps), "-o", out, *defined(defines), *options.split())
        known = read_json(times)
        if seconds and (known is not None or not done):
            known = (known or 0) + seconds
            with open(times, "w", encoding="utf-8") as stream:
                json.dump(known, stream)
        return read_json(self.path(folder, "fit.json")) | {"seconds": known}


def scene(name):
    return os.path.join(HERE, f"{name}.xml")


def repeated(option, values):
    return [word for value in values for word in (option, value)]


def defined(defines):
    return repeated("-D", defines)


def folder_of(name, variant):
    return f"{name}_{variant.replace(' ', '_')}"


def seconds_of(fit):
    return "not known" if fit["seconds"] is None else f"{fit['seconds']:.0f}"


def seeds(options, names=("seed 1", "seed 2", "seed 3")):
    return {name: f"{options} --seed {i}" for i, name in enumerate(names, 1)}


@dataclass
class Shape:
    """A sphere, of BASE_start.xml, whose vertices move until its images meet those of BASE.xml."""

    base: str
    size: list
    truth: str
    steps: object  # in all; or of each variant those to show, the last in all
    options: str
    variants: dict  # name: options
    target: str = "--spp 256"  # options of its rendering
    sensors: int = 1


SHAPES = {
    "mirrors": Shape(
        "two_mirrors", ["width=64", "height=32"], CREATURE, 300, "--snapshots 25",
        {**seeds("--spp 6 --remesh 75,150,225"),
         "no remeshing": "--spp 6 --seed 1",
         # As much time as the others: its draws cost less.
         "edges of li2019": f"--spp 7 --remesh 75,150,225 --seed 1 {LI2019}",
         "no boundary": f"--spp 6 --remesh 75,150,225 --seed 1 {NO_BOUNDARY}",
         "small start": "--spp 6 --remesh 75,150,225 --seed 1 -D radius=0.15"}),
    "shadows": Shape(
        "hidden_object", ["width=64", "height=48"], CREATURE, 150,
        "--spp 6 --remesh 50,100 --snapshots 25",
        {**seeds(SILHOUETTES),
         "edges of forest": "--method forest --seed 1",
         "uniform pixels": f"{SILHOUETTES} --seed 1 --pixels uniform",
         "no boundary": f"--seed 1 {NO_BOUNDARY}"}),
    "exact": Shape(
        "hidden_object", ["width=64", "height=48"], CREATURE,
        {"lbfgs": [10, 20, 40], "lbfgs remeshed": [45], "adam": [20, 60]},
        f"--spp 1 --snapshots 10 {ANALYTIC}",
        {"lbfgs": "--optimiser lbfgs --step 1",
         "lbfgs remeshed": "--optimiser lbfgs --step 1 --remesh 15,30",
         "adam": ""},
        target="--spp 8 --method analytic"),
    "views": Shape(
        "eight_views", ["width=40"], BUNNY, 160, "--spp 2 --snapshots 30",
        {**seeds("--remesh 40,80,120"),
         **seeds("", ("no remeshing", "no remeshing 2", "no remeshing 3"))}, sensors=8),
}


def fit_shape(fits, name):
    shape = SHAPES[name]
    file = "{}.exr" if shape.sensors == 1 else "{}_{}.exr"
    targets = [fits.render(shape.base, file.format(name, i), shape.size, shape.target, i)
               for i in range(shape.sensors)]
    rows = []
    for variant in fits.chosen(shape.variants):
        options = f"{shape.options} {shape.variants[variant]}"
        step = "" if "--step" in options.split() else "--step 2"
        shown = shape.steps[variant] if isinstance(shape.steps, dict) else [shape.steps]
        fit = fits.fit(folder_of(name, variant), f"{shape.base}_start", targets, shown[-1],
                       f"--wrt object.vertex_positions --truth {shape.truth} --smoothing 0.1 {step} "
                       + options, shape.size)
        meshes = {s["step"]: s["meshes"][0] for s in fit["snapshots"]}
        if not rows:
            rows.append(_shape_row("start", fit, meshes[0], 0))
        for at in [s for s in shown[:-1] if s in meshes and s < fit["steps"]] + [fit["steps"]]:
            rows.append(_shape_row(variant, fit, meshes[at], at))
    return ["fit", "steps", "chamfer", "95 %", "normals", "inside out", "crossings", "loss",
            "seconds"], rows


def _shape_row(name, fit, mesh, steps):
    last = [h["loss"] for h in fit["history"][:steps][-5:]]
    return [name, steps, f"{mesh['chamfer']:.4f}", f"{mesh['hausdorff_95']:.4f}",
            f"{mesh['normal_angle']:.1f}", mesh["inside_out"], mesh["crossings"],
            f"{sum(last) / len(last):.5f}" if last else "", seconds_of(fit) if last else ""]


def pose(fits, _):
    size = ["width=64", "height=32"]
    target = fits.render("two_mirrors", "pose.exr", size, "--spp 1024")
    names = [f"object.{move}.{a}" for move in ("translate", "rotate") for a in "xyz"]
    names += ["clay.reflectance", "sensor.translate.x"]
    start = ["x=0.15", "y=-0.1", "z=0.2", "angle=12", "clay=0.4", "view=0.2"]
    known = {f"clay.reflectance.{c}": (0.4, 0.6) for c in "rgb"} | {"sensor.translate.x": (0.2, 0)}
    variants, rows = seeds(""), []
    for name in fits.chosen(variants):
        options = (f"{' '.join(repeated('--wrt', names))} --spp 8 --step 2 --step-half-life 30"
                   f" --truth {CREATURE} {variants[name]}")
        fit = fits.fit(folder_of("pose", name), "two_mirrors", [target], 160, options, start + size)
        first, last = (fit["snapshots"][i]["meshes"][0] for i in (0, -1))
        if not rows:
            rows = [["chamfer / diagonal", f"{first['chamfer']:.4f}", "0"],
                    *([s["name"], *known.get(s["name"], (0, ""))] for s in fit["scalars"]),
                    ["seconds", "", ""]]
        for row, number in zip(rows, [last["chamfer"], *(s["value"] for s in fit["scalars"])]):
            row.append(f"{number:.5f}")
        rows[-1].append(seconds_of(fit))
    return ["what", "start", "truth", *fits.chosen(variants)], rows


def drift(fits, _):
    import numpy as np
    from paper_figures.meshes import read

    truth = os.path.abspath(fits.path("coarse.ply"))
    if not os.path.exists(truth):
        generate = os.path.join(os.path.dirname(fits.limn), "limn_generate")
        subprocess.run([generate, "creature", truth, "--faces", "3000"], check=True)
    size = ["width=48", "height=24", f"mesh={truth}"]
    target = fits.render("two_mirrors", "drift.exr", size, "--spp 4096")
    moved, rows = [], []
    for seed in (1, 2, 3):
        folder = f"drift_{seed}"
        fit = fits.fit(folder, "two_mirrors", [target], 60, "--wrt object.vertex_positions --truth"
                       f" {truth} --spp 4 --step 0.02 --seed {seed}", size)
        first, last = (fit["snapshots"][i]["meshes"][0] for i in (0, -1))
        start, end = (read(fits.path(folder, m["file"]))[0].ravel() for m in (first, last))
        moved.append((end - start) / np.linalg.norm(end - start))
        rows.append([f"seed {seed}", f"{last['chamfer']:.5f}", f"{last['normal_angle']:.2f}"])
    # Systematic drift would move all seeds the same way; random walks have no angle in common.
    cosines = [a @ b for i, a in enumerate(moved) for b in moved[:i]]
    rows.append(["cosines of pairs", " ".join(f"{c:.2f}" for c in cosines), ""])
    return ["fit", "chamfer / diagonal", "normals"], rows


@dataclass
class Function:
    """A loss that is a function of the parameters, by L-BFGS, by Adam, and by Adam of gradients with
    noise."""

    scene: str
    parameters: list
    truth: list  # angles in degrees; of displacement the positions
    variants: dict  # name: (steps, options)
    start: list = field(default_factory=list)  # defines
    target: list = field(default_factory=list)  # defines of its images, in place of these
    sensors: int = 1

    def error(self, fits, folder, fit):
        """The root of the mean squared error of angles, in degrees."""
        squares = [(math.degrees(s["value"]) - t) ** 2 for s, t in zip(fit["scalars"], self.truth)]
        return f"{math.sqrt(sum(squares) / len(squares)):.3f} degrees"


class Displacement(Function):
    def error(self, fits, folder, fit):
        """The same of positions."""
        from paper_figures.meshes import read

        found, _ = read(fits.path(folder, fit["snapshots"][-1]["meshes"][0]["file"]))
        return f"{math.sqrt(((found - self.truth) ** 2).sum(axis=1).mean()):.4f}"


TREE = 20  # degrees from the start to the truth
# By how many degrees each gear is off at the start.
GEARS = [11, -9, 12, -12, 8, 10, -11, 16, -18, 17, -15, 18, -17, 17, -16]


def tree(_):
    return Function("tree_shadow", ["object.rotate.y"], [TREE], {
        "lbfgs": (8, f"{NEWTON} --step 1.4"),
        "adam": (45, f"{FUNCTION} --optimiser adam --step 0.9 --step-half-life 12"),
        "adam of forest": (60, "--method forest --spp 16 --step 0.9 --step-half-life 25 --seed 1"),
    }, target=[f"turn={TREE}"])


def gears(_):
    return Function("gears", [f"gear_{i}.rotate.y" for i in range(len(GEARS))], [-a for a in GEARS], {
        "lbfgs": (28, f"{NEWTON} --step 1.8"),
        "adam": (80, f"{FUNCTION} --optimiser adam --step 1.4 --step-half-life 20"),
        "adam of forest": (80, "--method forest --spp 16 --step 1.4 --step-half-life 20 --seed 1"),
    }, start=[f"off_{i}={a}" for i, a in enumerate(GEARS)])


def displacement(fits):
    """The ball, and the mesh whose vertices lie elsewhere along its normals."""
    import numpy as np
    from paper_figures.meshes import read, write_obj

    p, faces = read(BALL)
    by = 0.16 * np.sin(3 * p[:, 0] + 1) * np.cos(2.5 * p[:, 1]) + 0.1 * np.sin(4 * p[:, 2] + 2)
    moved, file = p + by[:, None] * vertex_normals(p, faces), fits.path("stone.obj")
    write_obj(file, moved, faces)
    return Displacement("displacement", ["object.displacement"], moved, {
        "lbfgs": (40, f"--smoothing 0 {NEWTON} --step 1"),
        "adam": (100, f"--smoothing 0 {FUNCTION} --step 2 --step-half-life 30"),
        "adam of forest": (100, "--method forest --smoothing 0 --spp 4 --step 2 --step-half-life 40 --seed 1"),
    }, target=[f"mesh={os.path.abspath(file)}", "format=obj"], sensors=8)


def vertex_normals(positions, faces):
    """The mean of those of the faces around, weighted by their angles there."""
    import numpy as np

    def unit(v):
        return v / np.linalg.norm(v, axis=-1, keepdims=True)

    sums = np.zeros_like(positions)
    for k in range(3):
        at, b, c = (positions[faces[:, (k + i) % 3]] for i in range(3))
        u, v = unit(b - at), unit(c - at)
        angle = np.arccos((u * v).sum(axis=1))
        np.add.at(sums, faces[:, k], angle[:, None] * unit(np.cross(u, v)))
    return unit(sums)


FUNCTIONS = {"tree": tree, "gears": gears, "displacement": displacement}
TARGETS = {"displacement": "stone"}  # names of their files


def fit_function(fits, name):
    """A row for each variant."""
    function, rows = FUNCTIONS[name](fits), []
    # For each sensor the image as a function of the scene, and what samples have in the mean.
    exact, mean = ([fits.render(function.scene, f"{TARGETS.get(name, name)}{kind}_{i}.exr",
                                fits.size + function.target, f"--method analytic {options}", i)
                    for i in range(function.sensors)]
                   for kind, options in (("", "--points faces"), ("_mean", "--spp 32")))
    for variant in fits.chosen(function.variants):
        steps, options = function.variants[variant]
        folder = folder_of(name, variant)
        fit = fits.fit(folder, function.scene, exact if FUNCTION in options else mean, steps,
                       " ".join(repeated("--wrt", function.parameters)) + f" {options}",
                       fits.size + function.start)
        first = fit["history"][0]["loss"]
        cells = [variant, fit["steps"], f"{fit['history'][-1]['loss'] / first:.1e}"]
        for part in (0.1, 0.01, 0.001):
            at = reached(fit, part)
            cells.append(f"{at[0]}, {at[1]:.0f} s" if at else "not")
        rows.append([*cells, function.error(fits, folder, fit), seconds_of(fit)])
    return ["fit", "steps", "last / first loss", "to 1/10", "to 1/100", "to 1/1000", "error",
            "seconds"], rows


def curve(fit):
    """At each step: losses and gradients so far, processor seconds, loss. Every step takes one of
    both, but for those of L-BFGS, which say how many they took."""
    points, count = [], 0
    for number, step in enumerate(fit["history"], 1):
        points.append((max(number, count), step["loss"]))
        count += step["evaluations"]
    each = (fit["seconds"] or 0) / max(1, count)
    return [(k, k * each, loss) for k, loss in points]


def reached(fit, part):
    """Losses and gradients, and seconds, from which on the loss is at most that part of the first;
    None where it never stays there."""
    points, found = curve(fit), None
    for count, seconds, loss in reversed(points):
        if loss > part * points[0][2]:
            break
        found = count, seconds
    return found


@dataclass
class Start:
    """A start from which an object, a light or the camera is to find back: see regularised()."""

    scene: str
    parameters: list
    sigma: float
    start: list  # defines; OUT: the folder of fits
    truth: list = field(default_factory=list)
    goal: list = field(default_factory=list)  # what the truth's values are; else the loss tells
    far: float = 0  # how far the start is from it
    # Of a start that overlaps its target: defines, and the truth's values from there.
    near: tuple = ()
    steps: int = 60
    caustic: object = None  # that particles find: the defines that show it, of the parameters' values
    options: str = "--spp 4 --step 4 --step-half-life 20 --snapshots 5"


def moves(name, axes):
    return [f"{name}.translate.{axis}" for axis in axes]


VIEW_OF_FLOOR = ["y=1.9", "look=0"]
OVER_LAMP = ["mesh=OUT/pane.obj", "ior=3", "y=2.6", "lamp_y=1.4", "lamp_angle=-90", "glow=8000"]
REGULARISED = {
    "albedos": Start("room", [f"{c}.reflectance" for c in ("white", "red", "green", "grey")], 0.01,
                     [f"{c}=0.4, 0.4, 0.4" for c in ("white", "red", "green", "grey")]),
    "camera": Start("room", moves("sensor", "x"), 0.01, ["view_x=0.5"], [], [0], 0.5),
    "light": Start("room", moves("lamp", "xz"), 0.04, ["lamp_x=0.8", "lamp_z=0.6"], [],
                   [-0.8, -0.6], 1),
    "rotation": Start("room", [f"box.rotate.{a}" for a in "xyz"], 0.01,
                      ["pitch=20", "yaw=30", "roll=-20"]),
    "focus": Start("room", ["sensor.focus_distance"], 0.01, ["aperture=0.15", "focus=2.5"],
                   ["aperture=0.15"], [3.5], 1),
    "shadow": Start("room", moves("box", "xz"), 0.15, [*VIEW_OF_FLOOR, "x=0.4", "z=-0.3"],
                    VIEW_OF_FLOOR, [-0.4, 0.3], 0.5),
    "far shadow": Start("room", moves("box", "xz"), 0.15, [*VIEW_OF_FLOOR, "x=0.75", "z=-0.3"],
                        VIEW_OF_FLOOR, [-0.75, 0.3], 0.808, ([*VIEW_OF_FLOOR, "x=0.2"], [-0.2, 0]), 90),
    "torus": Start("torus", moves("torus", "xy"), 0.16, ["x=1.5", "y=0.2"], [], [-1.5, -0.2],
                   1.513, (["x=0.3"], [-0.3, 0])),
    "wide torus": Start("torus", moves("torus", "xy"), 0.16, ["x=1.8", "y=0.2", "fov=70"],
                         ["fov=70"], [-1.8, -0.2], 1.811, (["x=0.3", "fov=70"], [-0.3, 0])),
    "mirrors": Start("../fits/two_mirrors", moves("object", "xyz"), 0.16,
                     ["width=48", "height=24", "x=0.2", "y=1.3", "z=0.2"],
                     ["width=48", "height=24"], [-0.2, -1.3, -0.2], 1.330,
                     (["width=48", "height=24", "y=0.3"], [0, -0.3, 0]), 90),
    "velocity": Start("torus", [*(f"torus.velocity.{a}" for a in "xy"), "torus.vertex_positions"],
                      0.02, ["mesh=OUT/rough.obj", "close=1", "x=-0.3", "x1=0.3", "y=-0.8", "y1=0.8"],
                      ["mesh=OUT/cube.obj", "close=1", "x=-1", "x1=1"], [1.4, -1.6], 2.126, (), 90),
    "texture": Start("mirror", ["paint.reflectance.data"], 0.0025, ["paint=OUT/grey.png"],
                     ["paint=OUT/paint.png"],
                     options="--spp 4 --step 20 --step-half-life 20 --snapshots 5"),
    "index": Start("pane", ["glass.eta"], 0.04, ["ior=1.1"], ["ior=1.9"], [1.9], 0.8, (["ior=1.8"], [1.9]), 90),
    "caustic index": Start("lens", ["glass.eta"], 0.01, ["ior=1.15"], ["ior=1.5"], [1.5], 0.35,
                             (["ior=1.45"], [1.5]), caustic=lambda index: [f"ior={index}"]),
    "caustic place": Start("lens", moves("pane", "xz"), 0.1, [*OVER_LAMP, "x=0.25"],
                           [*OVER_LAMP, "x=-0.25", "z=0.1"], [-0.5, 0.1], 0.51,
                           ([*OVER_LAMP, "x=-0.2", "z=0.1"], [-0.05, 0]),
                           caustic=lambda x, z: [*OVER_LAMP, f"x={0.25 + x}", f"z={z}"],
                           options="--spp 16 --step 12 --step-half-life 20 --snapshots 5"),
    "vertices": Start("torus", ["torus.vertex_positions"], 0.4, ["mesh=OUT/cube.obj", "x=0.9"],
                      ["mesh=OUT/rough.obj", "x=-0.9"], [], 0,
                      (["mesh=OUT/cube.obj", "x=-0.9"], []), 150,
                      options="--spp 4 --smoothing 0.5 --step 20 --step-half-life 40 --snapshots 5"),
}


def regularised_files(fits):
    """Meshes and bitmaps of these fits."""
    import numpy as np
    from PIL import Image
    from paper_figures.meshes import torus, write_obj

    points, faces = torus(168)
    write_obj(fits.path("torus.obj"), 0.5 * points, faces)
    points = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 0.5, 0]]) * 0.5
    faces = np.array([(0, 1, 2), (0, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)])
    write_obj(fits.path("lens.obj"), points, faces)
    write_obj(fits.path("pane.obj"), 0.2 * points[:4], faces[:2])
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.35
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([f for a, b, c, d in sides for f in ((a, b, c), (a, c, d))])
    rng = np.random.default_rng(1)
    write_obj(fits.path("cube.obj"), cube, faces)
    write_obj(fits.path("rough.obj"), cube + rng.uniform(-0.15, 0.15, cube.shape), faces)
    paint = rng.integers(26, 230, (8, 8, 3)).astype(np.uint8)
    Image.fromarray(paint).save(fits.path("paint.png"))
    Image.fromarray(np.full_like(paint, 128)).save(fits.path("grey.png"))


def regularised(fits, _):
    """After Quinn 2021, Sec. 5.2 and 5.4: exact gradients, a pyramid, and blurred first steps."""
    regularised_files(fits)
    meshes = {name: [f"mesh=OUT/{mesh}.obj", "format=obj"] for name, mesh in
              (("torus", "torus"), ("../fits/two_mirrors", "torus"), ("lens", "lens"))}
    rows = []
    for name in fits.chosen(REGULARISED):
        s, found = REGULARISED[name], []
        # The last of several defines counts.
        start, truth, near = (
            [d.replace("OUT", os.path.abspath(fits.out)) for d in
             meshes.get(s.scene, []) + own]
            for own in (s.start, s.truth, s.near[0] if s.near else []))
        base = f"../regularised/{s.scene}"
        target = fits.render(base, f"regularised_{name.replace(' ', '_')}.exr", truth,
                             "--spp 1024 --method light-traced" if s.caustic else "--spp 256")
        # Exact steps find caustics by paths alone.
        blur = f"--sigma {s.sigma} --blur-steps {s.steps if s.caustic else s.steps * 2 // 3}"
        first = None
        image = "--caustics particles" if s.caustic else ""
        for variant, more in (("exact", image), ("pyramid", f"--pyramid 5 {image}"), ("blurred", blur),
                              ("particles", f"{blur} {image}"), ("good start", image)):
            ends = []
            if not {"good start": s.near, "particles": s.caustic}.get(variant, True):
                continue
            for seed in (1, 2, 3):
                fit = fits.fit(folder_of(name, f"{variant} {seed}"), base, [target], s.steps,
                               " ".join(repeated("--wrt", s.parameters)) +
                               f" {s.options} --seed {seed} {more}",
                               near if variant == "good start" else start)
                first = first or fit["history"][0]["loss"]
                goal = s.near[1] if variant == "good start" else s.goal
                ends.append(_end(fit, goal, s.far, first))
            found.append(" ".join(ends))
        rows.append([name, *found, *[""] * (5 - len(found))])
    return ["fit", "exact", "pyramid", "blurred", "particles or good start", "good start"], rows


def caustic_at(fits, start, folder, step):
    """A picture of a caustic after so many steps of a fit, whose snapshots are of paths."""
    goes = read_json(fits.path(folder, "fit.json"))["history"]
    values = list(goes[max(step, 1) - 1]["values"].values())
    defines = [d.replace("OUT", os.path.abspath(fits.out)) for d in
               ["mesh=OUT/lens.obj", "format=obj", *start.caustic(*values)]]
    return fits.render(f"../regularised/{start.scene}", f"{folder}_{step}.exr", defines,
                       "--spp 64 --method light-traced")[:-3] + "png"


def bad_starts(fits, _):
    """Targets, exact and blurred fits, step by step."""
    from PIL import Image

    names, tile, high, across = fits.chosen(REGULARISED), 72, 90, 5
    frames, rows = [], []
    for step in range(0, 95, 5):
        frame = Image.new("RGB", (across * 3 * tile, -(-len(names) // across) * high), "white")
        for i, name in enumerate(names):
            blurred = "particles" if REGULARISED[name].caustic else "blurred"
            for k, variant in enumerate(("target", "exact", blurred)):
                folder = folder_of(name, f"{'exact' if k == 0 else variant} 1")
                at = min(step, REGULARISED[name].steps)
                file = "view_0_target.png" if k == 0 else f"step_{at:05}_view_0.png"
                picture = Image.open(caustic_at(fits, REGULARISED[name], folder, at)
                                     if REGULARISED[name].caustic and k else
                                     fits.path(folder, file)).convert("RGB")
                size = (tile - 2, (tile - 2) * picture.height // picture.width)
                picture = picture.resize(size, Image.Resampling.NEAREST)
                frame.paste(labelled(picture, (name, "exact", blurred)[k], 9),
                            ((i % across * 3 + k) * tile, i // across * high))
        frames.append(frame)
        rows.append([step, len(names)])
    frames[0].save(os.path.join(ROOT, "scenes", "pictures", "bad_starts.webp"), quality=60,
                   method=6, save_all=True, append_images=[*frames[1:], *frames[-1:] * 6],
                   duration=200, loop=0)
    return ["step", "fits"], rows


SIGMAS, GAMMAS = ("0.04", "0.01", "0.0025", "0.0006", "0.00015"), ("1.6", "0.4", "0.1", "0.025")


def sweeps(fits, _):
    """After Quinn 2021, Figs. 5.16, 5.2 and 5.15: derivatives against sigma, images against gamma,
    the derivative of a caustic."""
    from PIL import Image

    regularised_files(fits)
    torus, room, lens = (scene(f"../regularised/{name}") for name in ("torus", "room", "lens"))
    size = ["width=64", "height=64"]
    mesh = [f"mesh={os.path.abspath(fits.path('torus.obj'))}", "format=obj"]
    pane = [d.replace("OUT", os.path.abspath(fits.out)) for d in ["format=obj", *OVER_LAMP]]
    folder, rows, tiles = fits.path("sweep"), [], [[], [], [], []]

    def show(row, label, file):
        tile = Image.open(file).convert("RGB").resize((128, 128), Image.Resampling.NEAREST)
        tiles[row].append(labelled(tile, label, 11))

    def image(row, label, file, defines, options):
        fits.run("render", file, *defined(size + defines), *options.split(), "-o", f"{folder}.exr")
        show(row, label, f"{folder}.png")

    for sigma in SIGMAS:
        image(0, f"σ {sigma}", torus, mesh, f"--spp 64 --method blurred --sigma {sigma}")
        fits.run("compare", torus, *defined(size + mesh), "--wrt", "torus.translate.x", "--methods",
                 "blurred,adaptive", "--sigma", sigma, "--time", "1", "--repeats", "5",
                 "--no-report", "-o", folder)
        show(1, "derivative", os.path.join(folder, "blurred.png"))
        found = read_json(os.path.join(folder, "compare.json"))["methods"]
        rows.append([sigma, *(f"{math.sqrt(m['summary'][0]['relative_mse']):.4f}" for m in found),
                     f"{found[0]['summary'][0]['bias']['p']:.2g}"])
    image(0, "sharp", torus, mesh, "--spp 64")
    show(1, "derivative", os.path.join(folder, "reference.png"))
    for gamma in GAMMAS:
        image(2, f"γ {gamma}", room, [], f"--spp 64 --method blurred --sigma 0.002 --gamma {gamma}")
    image(2, "γ 0", room, [], "--spp 64 --method blurred --sigma 0.002")
    image(2, "sharp", room, [], "--spp 64")
    image(3, "caustic", lens, pane, "--spp 256 --method light-traced")
    for method in ("blurred:caustics=particles", "blurred"):
        for axis in "xz":
            fits.run("gradient", lens, *defined(size + pane), "--wrt", f"pane.translate.{axis}",
                     "--method", method, "--sigma", "0.0025", "--spp", "256", "-o", f"{folder}.exr")
            show(3, f"{'particles' if 'particles' in method else 'paths'}: by {axis}", f"{folder}.png")
    high, wide = tiles[0][0].height + 2, 130
    sheet = Image.new("RGB", (6 * wide, len(tiles) * high), "white")
    for y, row in enumerate(tiles):
        for x, tile in enumerate(row):
            sheet.paste(tile, (x * wide, y * high))
    sheet.save(os.path.join(ROOT, "scenes", "pictures", "sweeps.webp"), quality=80, method=6)
    return ["sigma", "relative error", "of adaptive", "p of no bias"], rows


def _end(fit, goal, far, first):
    """How far the end is from the truth, over how far the start was; else of losses their root."""
    if goal:
        left = [v["value"] - g for v, g in zip(fit["scalars"], goal)]
        return f"{math.hypot(*left) / far:.3f}"
    last = [h["loss"] for h in fit["history"][-5:]]
    return f"{math.sqrt(max(0, sum(last)) / len(last) / first):.3f}"


def panels_of(rows, columns, height, **shared):
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    return pyplot.subplots(rows, columns, figsize=(9, height), **shared)


def save(figure, name, quality, pad=1.08):
    figure.tight_layout(pad=pad)
    figure.savefig(os.path.join(ROOT, "scenes", "pictures", name), dpi=90,
                   pil_kwargs={"quality": quality, "method": 6})


def curves(fits, _):
    figure, panels = panels_of(len(FUNCTIONS), 2, 8, sharey="row")
    rows = []
    for name, pair in zip(FUNCTIONS, panels):
        for variant in ("lbfgs", "adam", "adam of forest"):
            folder = folder_of(name, variant)
            fit = read_json(fits.path(folder, "fit.json"))
            if fit is None:
                continue
            points = curve(fit | {"seconds": read_json(fits.path(folder, "seconds.json"))})
            points, first = [p for p in points if p[2] > 0], fit["history"][0]["loss"]
            for x, panel in enumerate(pair):
                panel.plot([p[x] for p in points], [p[2] / first for p in points], label=variant)
            rows.append([name, variant, f"{points[-1][2] / first:.1e}"])
        for panel, label in zip(pair, ("losses and gradients", "seconds of the processor")):
            panel.set(yscale="log", xscale="log", xlabel=label if name == "displacement" else "")
            panel.grid(alpha=0.3)
        pair[0].set_ylabel(f"{name}: loss over the first")
    panels[1][0].legend(frameon=False)
    save(figure, "fit_curves.webp", 80)
    return ["scene", "fit", "last / first loss"], rows


# A row for each: truth, start, and fits at some of their steps.
SHOWN = [
    (CREATURE, [("mirrors_seed_1", 0), ("mirrors_seed_1", 75), ("mirrors_seed_1", 300),
                ("mirrors_edges_of_li2019", 300), ("mirrors_no_remeshing", 300),
                ("mirrors_no_boundary", 300)]),
    (CREATURE, [("shadows_seed_1", 0), ("shadows_seed_1", 50), ("shadows_seed_1", 150),
                ("shadows_edges_of_forest", 150), ("shadows_uniform_pixels", 150),
                ("shadows_no_boundary", 150)]),
    (BUNNY, [("views_seed_1", step) for step in (0, 30, 60, 90, 120, 160)]),
]


def step_label(folder, step):
    variant = folder.split("_", 1)[1].replace("_", " ")
    if variant != "seed 1":
        return variant
    return f"{step} steps" if step else "start"


def picture(fits, _):
    from PIL import Image

    tile, table = 128, []
    high = tile + 20  # of a label
    whole = Image.new("RGB", (tile * 7, high * len(SHOWN)), "white")
    for y, (truth, shown) in enumerate(SHOWN):
        meshes = [truth] + [fits.path(f, f"step_{step:05}_object.ply") for f, step in shown]
        for x, mesh in enumerate(meshes):
            view = [f"mesh={os.path.abspath(mesh)}", f"format={mesh[-3:]}", f"width={tile}"]
            file = fits.render("eight_views", f"picture/{y}_{x}.exr", view, "--spp 64", 7)
            label = step_label(*shown[x - 1]) if x else "truth"
            shape = Image.open(file[:-3] + "png").convert("RGB")
            whole.paste(labelled(shape, label, 11), (tile * x, high * y))
        table.append([os.path.basename(truth), "truth", *(f"{f} {step}" for f, step in shown)])
    whole.save(os.path.join(ROOT, "scenes", "pictures", "fits.webp"), quality=80, method=6)
    return ["row", *([""] * 7)], table


EXPERIMENTS = {**dict.fromkeys(SHAPES, fit_shape), "pose": pose, "drift": drift,
               **dict.fromkeys(FUNCTIONS, fit_function), "regularised": regularised,
               "bad_starts": bad_starts, "sweeps": sweeps,
               "curves": curves, "picture": picture}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=EXPERIMENTS, metavar="NAME", help=", ".join(EXPERIMENTS))
    parser.add_argument("-o", "--output", default=os.path.join(ROOT, "out", "fits"))
    parser.add_argument("--steps", type=int, help="in place of the experiment's own number")
    parser.add_argument("--size", type=int, help="pixels a side: of tree, gears, displacement")
    parser.add_argument("--only", metavar="FITS", help="of the experiment's, with commas between")
    parser.add_argument("--threads", type=int, help="default: all cores")
    parser.add_argument("--limn", default=os.path.join(ROOT, "build", "limn"), help="the program")
    arguments = parser.parse_args()
    if arguments.only and arguments.name in ("drift", "curves", "picture", "sweeps"):
        parser.error(f"--only: {arguments.name} is one whole")
    use_one_with_matplotlib()
    os.makedirs(arguments.output, exist_ok=True)
    head, rows = EXPERIMENTS[arguments.name](Fits(arguments), arguments.name)
    for row in [head, *rows]:
        print("  ".join(f"{cell!s:>18}" for cell in row))


if __name__ == "__main__":
    main()
