#!/usr/bin/env python3
"""Vertices of a shape from images by Mitsuba 3: its gradients (prb_projective, Zhang et al. 2023), its
large steps and its uniform Adam (Nicolet et al. 2021), with the units of `limn fit`.

    scenes/fits/mitsuba_fit.py SCENE -D width=64 --target A.exr --wrt object --steps 150 -o FOLDER

The shape must be a mesh without seams. A target for each sensor. Writes FOLDER/mesh.ply (the last
one) and FOLDER/fit.json: losses, seconds of processor time of each step without the compilation of
kernels, which depends on what Dr.Jit has cached. Needs what tools/mitsuba/mitsuba_gradient.py needs,
and has its exit status.
"""

import argparse
import json
import os
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "tools", "mitsuba"))
from mitsuba_gradient import BAD_INPUT, Failure, load_mitsuba, path_settings  # noqa: E402


def write_ply(file, positions, faces):
    import numpy as np

    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<u4", 3)])
    rows["count"], rows["corners"] = 3, faces
    with open(file, "wb") as stream:
        stream.write(
            f"ply\nformat binary_little_endian 1.0\nelement vertex {len(positions)}\n"
            "property float x\nproperty float y\nproperty float z\n"
            f"element face {len(faces)}\nproperty list uchar uint vertex_indices\nend_header\n".encode()
        )
        stream.write(positions.astype("<f4").tobytes() + rows.tobytes())


class Shape:
    """The vertices that are fitted, in the coordinates of the large steps."""

    def __init__(self, mi, dr, params, name, smoothing):
        import numpy as np

        self._dr, self._params, self._key = dr, params, f"{name}.vertex_positions"
        if self._key not in params:
            raise Failure(BAD_INPUT, f'no mesh "{name}" with vertex positions')
        self.faces = np.array(params[f"{name}.faces"]).reshape(-1, 3)
        v = self.positions()
        self.diagonal = float(np.linalg.norm(v.max(0) - v.min(0)))
        edges = np.unique(np.sort(self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), 1), axis=0)
        mean_edge = float(np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1).mean())
        self._steps = mi.ad.LargeSteps(
            params[self._key],
            params[f"{name}.faces"],
            lambda_=(smoothing * self.diagonal / mean_edge) ** 2,
        )

    def positions(self):
        import numpy as np

        return np.array(self._params[self._key]).reshape(-1, 3)

    def coordinates(self):
        return self._steps.to_differential(self._params[self._key])

    def place(self, coordinates):
        self._params[self._key] = self._steps.from_differential(coordinates)
        self._params.update()


def run(arguments):
    mi, dr = load_mitsuba(arguments.threads)
    dr.set_flag(dr.JitFlag.KernelHistory, True)
    defines = dict(arguments.D)
    settings = path_settings(mi, arguments.scene, defines)
    scene = mi.load_file(arguments.scene, optimize=False, **defines)
    if len(scene.sensors()) != len(arguments.target):
        raise Failure(BAD_INPUT, f"{len(arguments.target)} targets for {len(scene.sensors())} sensors")
    targets = [mi.TensorXf(mi.Bitmap(file))[..., :3] for file in arguments.target]
    params = mi.traverse(scene)
    shape = Shape(mi, dr, params, arguments.wrt, arguments.smoothing)
    integrator = mi.load_dict(
        {"type": "prb_projective", "guiding": arguments.guiding, **settings}
    )
    integrator.proj_seed_spp = min(integrator.proj_seed_spp, arguments.guiding_spp)
    size = arguments.step * 0.01 * shape.diagonal
    optimiser = mi.ad.Adam(lr=size, uniform=True)
    optimiser["u"] = shape.coordinates()
    history = []
    for step in range(arguments.steps):
        begin = time.process_time()
        optimiser.set_learning_rate(size * 2 ** (-step / arguments.half_life))
        shape.place(optimiser["u"])
        loss = 0
        for view, target in enumerate(targets):
            seed = 2 * (step * len(targets) + view) + arguments.seed * (1 << 24)
            image = mi.render(
                scene,
                params,
                integrator=integrator,
                sensor=view,
                spp=arguments.spp,
                spp_grad=arguments.spp,
                seed=seed,
                seed_grad=seed + 1,
            )
            one = dr.mean(dr.square(image - target), axis=None) / len(targets)
            dr.backward(one)
            loss += float(one.array[0])
        optimiser.step()
        compiling = sum(k.get("backend_time", 0) for k in dr.kernel_history()) / 1000
        seconds = max(0.0, time.process_time() - begin - compiling)
        history.append({"step": step, "loss": loss, "seconds": seconds})
    shape.place(optimiser["u"])
    os.makedirs(arguments.output, exist_ok=True)
    write_ply(os.path.join(arguments.output, "mesh.ply"), shape.positions(), shape.faces)
    with open(os.path.join(arguments.output, "fit.json"), "w", encoding="utf-8") as stream:
        json.dump({"version": mi.__version__, "history": history}, stream, indent=1)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene")
    parser.add_argument("-D", action="append", default=[], type=lambda d: tuple(d.split("=", 1)))
    parser.add_argument("--target", action="append", required=True, help="one for each sensor")
    parser.add_argument("--wrt", required=True, help="id of the shape")
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--spp", type=int, default=8, help="of the image, and of each term")
    parser.add_argument("--step", type=float, default=1, help="over 1 %% of the shape's diagonal")
    parser.add_argument("--half-life", type=float, default=float("inf"), help="of steps")
    parser.add_argument("--smoothing", type=float, default=0.1, help="over the shape's diagonal")
    parser.add_argument("--guiding", default="octree", help="octree, grid or none")
    parser.add_argument("--guiding-spp", type=int, default=16, help="that build the octree, each time")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int)
    parser.add_argument("-o", "--output", required=True)
    try:
        run(parser.parse_args())
    except Failure as failure:
        print(f"mitsuba_fit.py: {failure}", file=sys.stderr)
        sys.exit(failure.status)


if __name__ == "__main__":
    main()
