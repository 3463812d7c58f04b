#!/usr/bin/env python3
"""What L-BFGS makes of gradients with noise, which limn fit refuses: those of the forest of edges.

    scenes/fits/noisy_lbfgs.py tree -o out/fits
    scenes/fits/noisy_lbfgs.py gears --seeds new -o out/fits

SciPy's L-BFGS-B turns the tree or the gears (fits.py) by losses and gradients of 16 samples per
pixel. --seeds same: all from one seed, so that the loss is a function, but its gradient is that of
other samples' mean (the default); new: each from seeds of its own. Needs `import limn`, NumPy and
SciPy, and the target that fits.py made. Writes OUT/NAME_lbfgs_of_forest_SEEDS/ with fit.json and
seconds.json, as fits.py has them, and prints the curve.
"""

import argparse
import json
import math
import os
import time

import numpy as np
from fits import GEARS, ROOT, TREE, scene
from scipy.optimize import minimize

import limn

SAMPLES = 16
# Scene, parameters, their names in the file and what stands there at the start, true angles from
# the start on (degrees).
FITS = {
    "tree": ("tree_shadow.xml", ["object.vertex_positions"], ["turn"], [0], [TREE]),
    "gears": (
        "gears.xml",
        [f"gear_{i}.rotate.y" for i in range(len(GEARS))],
        [f"off_{i}" for i in range(len(GEARS))],
        GEARS,
        [-a for a in GEARS],
    ),
}


def of_turn(at, name, value):
    """The derivative by a turn: that of a shape's vertices is about the axis of the world, as the
    file turns it; rotate.y would be about the center of the bounds, which differ at every angle."""
    if not name.endswith(".vertex_positions"):
        return float(value)
    p = np.asarray(at.parameters[name].value, float)
    return float((value[:, 0] * p[:, 2] - value[:, 2] * p[:, 0]).sum())


class Noisy:
    """Loss and gradient over natural steps, 0.01 radians each; the last are kept."""

    def __init__(self, name, target, new_seeds):
        self.file, self.names, self.defines, self.start, _ = FITS[name]
        self.target, self.new_seeds = limn.read_exr(target), new_seeds
        self.history, self.begun = [], time.process_time()
        self.last = None

    def __call__(self, x):
        if self.last is None or not np.array_equal(self.last[0], x):
            self.last = (x.copy(), self.evaluate(x))
        return self.last[1]

    def evaluate(self, x):
        angles = [a + math.degrees(0.01 * v) for a, v in zip(self.start, x)]
        at = limn.load(scene(self.file), **dict(zip(self.defines, angles)))
        own = {"spp": SAMPLES, "seed": 1, "threads": 1}
        if self.new_seeds:
            own["seed"] += len(self.history)
        loss = limn.image_loss(at, self.target, **own)
        found = limn.backward(at, loss.adjoint, self.names, **own)
        seconds = time.process_time() - self.begun
        self.history.append({"loss": loss.value, "evaluations": 1, "seconds": seconds})
        return loss.value, 0.01 * np.array([of_turn(at, n, found[n].value) for n in self.names])


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", choices=FITS)
    parser.add_argument("--seeds", choices=["same", "new"], default="same")
    parser.add_argument("--evaluations", type=int, default=60, help="at most, of loss and gradient")
    parser.add_argument("-o", "--output", default=os.path.join(ROOT, "out", "fits"))
    arguments = parser.parse_args()
    target = os.path.join(arguments.output, f"{arguments.name}_mean_0.exr")
    noisy = Noisy(arguments.name, target, arguments.seeds == "new")
    # The scale of losses is not that of steps: without one its first step is as long as a gradient.
    first, gradient = noisy(np.zeros(len(noisy.names)))
    scale = 2 / np.abs(gradient).max()

    def scaled(x):
        loss, gradient = noisy(x)
        return scale * loss, scale * gradient

    options = {"maxfun": arguments.evaluations, "ftol": 0, "gtol": 0}
    found = minimize(scaled, np.zeros(len(noisy.names)), jac=True, method="L-BFGS-B",
                     options=options)  # fmt: skip
    truth = np.radians(FITS[arguments.name][4])
    error = math.degrees(np.sqrt(np.mean((0.01 * found.x - truth) ** 2)))
    for i, h in enumerate(noisy.history):
        print(f"{i:4} {h['seconds']:8.1f} s  loss {h['loss'] / first:.3e} of the first")
    print(f"{found.message}; {error:.3f} degrees off")
    folder = f"{arguments.name}_lbfgs_of_forest_{arguments.seeds}"
    os.makedirs(os.path.join(arguments.output, folder), exist_ok=True)
    files = {"fit": {"history": noisy.history, "error": error, "message": str(found.message)},
             "seconds": noisy.history[-1]["seconds"]}  # fmt: skip
    for name, content in files.items():
        with open(os.path.join(arguments.output, folder, f"{name}.json"), "w") as file:
            json.dump(content, file)


if __name__ == "__main__":
    main()
