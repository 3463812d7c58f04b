#!/usr/bin/env python3
"""Where is the ball? Found from its shadow alone: the camera does not see it.

    find_the_ball.py [--quick]

Writes shadow.png (what is seen), start.png and found.png.
"""

import sys
from pathlib import Path

import limn
import numpy as np

quick = "--quick" in sys.argv
size, spp, steps = (24, 8, 6) if quick else (64, 16, 40)
scene = limn.load(Path(__file__).with_name("ball.xml"), width=size, height=size)
target = limn.render(scene, spp=16 * spp, seed=1)
limn.write_png("shadow.png", target)

names = ["ball.translate.x", "ball.translate.z"]
offset = np.array([0.35, -0.25])  # from where it was
for name, step in zip(names, offset):
    scene.move(name, step)
limn.write_png("start.png", limn.render(scene, spp=spp))

mean, square = np.zeros(2), np.zeros(2)
for i in range(steps):  # Adam
    loss = limn.image_loss(scene, target, spp=spp, seed=2 + i)
    found = limn.backward(scene, loss.adjoint, names, spp=spp, seed=2 + i)
    g = np.array([float(found[name].value) for name in names])
    mean, square = 0.8 * mean + 0.2 * g, 0.95 * square + 0.05 * g**2
    step = -0.04 * (mean / (1 - 0.8 ** (i + 1))) / np.sqrt(square / (1 - 0.95 ** (i + 1)))
    for name, s in zip(names, step):
        scene.move(name, s)
    offset += step
    print(f"{i:3}  loss {loss.value:9.3g} +- {loss.stderr:.2g}  off by {np.hypot(*offset):.3f}")
limn.write_png("found.png", limn.render(scene, spp=spp))
