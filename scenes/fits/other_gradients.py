#!/usr/bin/env python3
"""The same steps with limn's gradients and with those of Mitsuba 3's prb_projective.

    scenes/fits/other_gradients.py mirrors --gradients mitsuba --time 90 -o out/fits/mirrors_mitsuba
    scenes/fits/other_gradients.py views --gradients limn --time 90 -o out/fits/views_limn

Mitsuba's LargeSteps and its Adam (uniform) move the vertices of one sphere whichever gradients they
get, both on one thread; each renderer fits images of its own. No remeshing. Needs `import limn`
and `pip install mitsuba==3.9.1 cholespy`, with LLVM (tools/mitsuba/README.md). Writes the shape at
the end (OUT.ply), prints a line for every tenth step, and OUT.json with all: processor seconds
without compilation, loss, distances to the true shape over its diagonal.
"""

import argparse
import json
import math
import os
import sys
import time
from collections import namedtuple

import numpy as np

import limn

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path.insert(0, os.path.join(ROOT, "tools", "mitsuba"))
from mitsuba_gradient import load_mitsuba  # noqa: E402

# Scene, size, number of sensors, samples per pixel of limn and of Mitsuba (16 took it farther in
# the same time than 64, and "none" for guiding farther than the octree, which each step builds
# anew).
FITS = {
    "mirrors": ("two_mirrors", {"width": 64, "height": 32}, 1, 6, 16),
    "views": ("eight_views", {"width": 40}, 8, 2, 8),
}
VERTICES = "object.vertex_positions"


# A fit: a scene file, the defines that make it the start, those of start and truth, sensors.
Fit = namedtuple("Fit", "scene start defines views")


class Limn:
    def __init__(self, fit, spp):
        scene, start, defines, views = fit
        self.scenes = [limn.load(scene, **start, **defines).view(i) for i in range(views)]
        true = [limn.load(scene, **defines).view(i) for i in range(views)]
        self.targets = [limn.render(s, spp=256, seed=99, threads=1).value for s in true]
        self.spp = spp

    def step(self, positions, seed):
        """Loss and its gradient."""
        value, gradient = 0, 0
        for i, (scene, target) in enumerate(zip(self.scenes, self.targets)):
            scene[VERTICES] = positions
            own = {"spp": self.spp, "seed": seed * len(self.scenes) + i, "threads": 1}
            loss = limn.image_loss(scene, target, **own)
            value += loss.value
            # Four times the default: what the figures in README.md were taken with.
            found = limn.backward(scene, loss.adjoint, VERTICES, camera_samples=1, **own)
            gradient = gradient + found[VERTICES].value
        return value / len(self.scenes), gradient / len(self.scenes)


class Mitsuba:
    def __init__(self, mi, dr, fit, spp, guiding):
        scene, start, defines, views = fit
        self.mi, self.dr, self.views = mi, dr, views
        defines = {key: str(value) for key, value in defines.items()}
        true = mi.load_file(scene, optimize=False, **defines)
        depth = 3 if views == 1 else 2
        self.integrator = mi.load_dict({"type": "prb_projective", "max_depth": depth,
                                        "rr_depth": 1000, "guiding": guiding, "sppc": spp,
                                        "sppp": spp, "sppi": spp})  # fmt: skip
        self.spp = spp
        self.scene = mi.load_file(scene, optimize=False, **start, **defines)
        self.params = mi.traverse(self.scene)
        self.targets = [mi.render(true, sensor=i, spp=256, seed=99, integrator=self.integrator)
                        for i in range(views)]  # fmt: skip
        dr.eval(self.targets)

    def step(self, positions, seed):
        """Images and derivatives have seeds of their own: the gradient is unbiased."""
        mi, dr = self.mi, self.dr
        vertices = mi.Float(positions.ravel().astype(np.float32))
        dr.enable_grad(vertices)
        self.params[VERTICES] = vertices
        self.params.update()
        value = 0
        for i, target in enumerate(self.targets):
            own = (seed * self.views + i) * 2
            image = mi.render(self.scene, self.params, sensor=i, spp=self.spp, seed=own,
                              seed_grad=own + 1, integrator=self.integrator)  # fmt: skip
            loss = dr.mean((image - target) ** 2, axis=None)
            dr.backward(loss)
            value += float(loss.array[0])
        gradient = np.array(dr.grad(vertices)).reshape(-1, 3)
        return value / self.views, gradient / self.views


def start_sphere(scene, file):
    """A welded copy of what limn's fits start from, as a file for both."""
    mesh = limn.load(scene).mesh("object")
    kept, index = np.unique(mesh.weld, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    good = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    limn.write_ply(file, mesh.positions[kept], faces[good])


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", choices=FITS)
    parser.add_argument("--gradients", choices=("limn", "mitsuba"), required=True)
    parser.add_argument("--guiding", choices=("octree", "grid", "none"), default="none")
    parser.add_argument("--spp", type=int, help="in place of the experiment's own number")
    parser.add_argument("--time", type=float, required=True, help="processor seconds")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", required=True, metavar="OUT")
    arguments = parser.parse_args()
    name, defines, views, own, other = FITS[arguments.name]
    scene, start = os.path.join(HERE, f"{name}.xml"), arguments.output + "_start.ply"
    start_sphere(os.path.join(HERE, f"{name}_start.xml"), start)
    mi, dr = load_mitsuba()
    shape = {"mesh": os.path.abspath(start)} | ({"format": "ply"} if views > 1 else {})
    mesh = limn.load(scene, **shape, **defines).mesh("object")
    positions, faces = np.array(mesh.positions), np.array(mesh.faces)
    true = limn.load(scene, **defines).mesh("object")
    size = float(np.linalg.norm(np.ptp(true.positions, axis=0)))
    fit = Fit(scene, shape, defines, views)
    if arguments.gradients == "limn":
        source = Limn(fit, arguments.spp or own)
    else:
        source = Mitsuba(mi, dr, fit, arguments.spp or other, arguments.guiding)
        dr.set_thread_count(1)  # before, loading waits for itself

    # Steps and smoothing of fits.py: 2 % and 10 % of the diagonal.
    diagonal = float(np.linalg.norm(positions.max(0) - positions.min(0)))
    sides = positions[faces] - positions[np.roll(faces, 1, axis=1)]
    mean_edge = float(np.linalg.norm(sides, axis=2).mean())
    steps = mi.ad.LargeSteps(mi.Float(positions.ravel()), mi.UInt(faces.ravel().astype(np.uint32)),
                             lambda_=(0.1 * diagonal / mean_edge) ** 2)  # fmt: skip
    adam = mi.ad.Adam(lr=0.02 * diagonal, beta_2=0.95, uniform=True)
    adam["u"] = steps.to_differential(mi.Float(positions.ravel()))
    source.step(positions, 0)  # compiles kernels; of no other account
    history, begin, step = [], time.process_time(), 0
    while time.process_time() - begin < arguments.time:
        step += 1
        vertices = steps.from_differential(adam["u"])
        positions = np.array(vertices).reshape(-1, 3)
        loss, gradient = source.step(positions, step + 100000 * arguments.seed)
        dr.backward(dr.sum(vertices * mi.Float(gradient.ravel().astype(np.float32))))
        adam.step()
        # Half as long every 120 steps, as remeshing does in fits.py.
        adam.set_learning_rate(0.02 * diagonal * 0.5 ** (step / 120))
        if step % 10:
            continue
        seconds = time.process_time() - begin
        far = limn.mesh_distance(positions, faces, true.positions, true.faces)
        history.append({"step": step, "seconds": seconds, "loss": loss,
                        "chamfer": far["chamfer"] / size, "hausdorff_95": far["hausdorff_95"] / size,
                        "normals": math.degrees(far["normal_angle"])})  # fmt: skip
        last = history[-1]
        print(f"{step:4} {seconds:6.1f} s  loss {loss:.3g}  chamfer {last['chamfer']:.4f}  95 % "
              f"{last['hausdorff_95']:.4f}  normals {last['normals']:.1f}", flush=True)  # fmt: skip
    limn.write_ply(arguments.output + ".ply", positions, faces)
    with open(arguments.output + ".json", "w", encoding="utf-8") as stream:
        json.dump({"spp": source.spp, "history": history}, stream, indent=1)


if __name__ == "__main__":
    main()
