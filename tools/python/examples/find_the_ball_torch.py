#!/usr/bin/env python3
"""find_the_ball.py by PyTorch's own Adam: the gradient goes through limn to the vertices, and on to
what moves them. Needs torch.

    find_the_ball_torch.py [--quick]

Writes found_by_torch.png.
"""

import sys
from pathlib import Path

import limn
import limn.torch
import torch

quick = "--quick" in sys.argv
size, spp, steps = (24, 8, 4) if quick else (64, 16, 40)
scene = limn.load(Path(__file__).with_name("ball.xml"), width=size, height=size)
target = torch.from_numpy(limn.render(scene, spp=16 * spp, seed=1).value)

vertices = torch.tensor(scene["ball.vertex_positions"])
offset = torch.tensor([0.35, 0.0, -0.25], requires_grad=True)  # from where it was
adam = torch.optim.Adam([offset], lr=0.04, betas=(0.8, 0.95))
for i in range(steps):
    adam.zero_grad()
    # Two images of noise of their own: the gradient of their product has no bias.
    a, b = (
        limn.torch.render(scene, {"ball.vertex_positions": vertices + offset}, spp=spp, seed=seed)
        for seed in (2 * i + 2, 2 * i + 3)
    )
    loss = ((a - target) * (b - target)).mean()
    loss.backward()
    adam.step()
    print(f"{i:3}  loss {loss.item():9.3g}  off by {offset.detach().norm().item():.3f}")
limn.write_png("found_by_torch.png", a.detach().numpy())
