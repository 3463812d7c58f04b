#!/usr/bin/env python3
"""A picture, and how it changes when the object rises: with errors, and checked.

    which_way.py [SCENE [PARAMETER]] [--quick]
"""

import sys
from pathlib import Path

import limn

quick = "--quick" in sys.argv
words = [w for w in sys.argv[1:] if not w.startswith("-")]
file = words[0] if words else Path(__file__).with_name("ball.xml")
name = words[1] if len(words) > 1 else "ball.translate.x"

scene = limn.load(file, width=32, height=32) if quick else limn.load(file)
spp = 16 if quick else 128
image = limn.render(scene, spp=spp)
change = limn.gradient(scene, name, spp=spp)[name]
limn.write_png("image.png", image)
limn.write_signed_png("change.png", change)

unit = scene.parameters[name].unit or "unit"
total, error = change.value.sum(), (change.stderr.astype(float) ** 2).sum() ** 0.5
print(f"{file}: {scene.width} x {scene.height}, {image.spp} samples per pixel, {image.seconds:.2f} s")
print(f"d(sum of the image) / d({name}) = {total:.4g} +- {error:.2g} per {unit}")
print("against finite differences:", limn.check(scene, name, spp=max(2, spp // 4)).verdict)
