#!/usr/bin/env python3
"""Renders scenes with limn and with Mitsuba 3 and says whether the images agree.

    tools/mitsuba/compare_with_mitsuba.py SCENE... [-D name=value] [--spp N]
    tools/mitsuba/compare_with_mitsuba.py --suite [--only TEXT]

Each renderer makes SEEDS independent images. Per block of pixels and channel, the difference of
the two means over its standard error (Welch) is turned into a standard normal z. The suite holds
one scene per feature that both renderers have. Needs `pip install mitsuba==3.9.1`.

Mitsuba's scalar variants look tent and gaussian filters up in a table of 31 steps. Pixels on a
border of light differ by up to a percent of its step there, so the suite's cases of these filters
are left out under them (src/README.md has the figures); those of the other variants are as exact
as limn's to 6e-5.
"""
import argparse
import math
import os
import subprocess
import sys
import tempfile

import mitsuba as mi
import numpy as np

from compare_with_mitsuba_scenes import suite

SEEDS = 8
LIMN = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "build", "limn")


def limn_images(scene, defines, spp, options):
    images = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(SEEDS):
            file = os.path.join(folder, "image.exr")
            command = [LIMN, "render", scene, "-o", file, "--spp", str(spp), "--seed", str(seed)]
            command += ["--quiet", *options]
            for name, value in defines.items():
                command += ["-D", f"{name}={value}"]
            subprocess.run(command, check=True)
            images.append(np.array(mi.Bitmap(file), dtype=np.float64))
    return np.stack(images)


def mitsuba_images(scene, defines, spp):
    loaded = mi.load_file(scene, **defines)
    images = [np.array(mi.render(loaded, seed=s, spp=spp), dtype=np.float64) for s in range(SEEDS)]
    return np.stack(images)[..., :3]


def block_means(images, block):
    """SEEDS by H by W by C to SEEDS by rows by columns by C."""
    rows = range(0, images.shape[1], block)
    columns = range(0, images.shape[2], block)
    return np.stack([np.stack([images[:, y:y + block, x:x + block].mean(axis=(1, 2))
                               for x in columns], axis=1) for y in rows], axis=1)


def z_scores(a, b):
    """Welch's t, as a normal z of the same tail (Wallace 1959)."""
    va = a.var(axis=0, ddof=1) / len(a)
    vb = b.var(axis=0, ddof=1) / len(b)
    difference = a.mean(axis=0) - b.mean(axis=0)
    # Mitsuba computes in single precision: below this nothing can be told.
    rounding = 1e-6 * (np.abs(a).mean() + np.abs(b).mean())
    variance = va + vb + rounding**2
    t = difference / np.sqrt(variance)
    nu = variance**2 / ((va**2 + vb**2) / (len(a) - 1) + rounding**4)
    z = np.sqrt(nu * np.log1p(t * t / nu)) * (8 * nu + 1) / (8 * nu + 3)
    return np.copysign(z, t)


def compare(name, scene, defines, spp, options):
    ours = limn_images(scene, defines, spp, options)
    theirs = mitsuba_images(scene, defines, spp)
    if ours.shape != theirs.shape:
        print(f"{name:36} sizes differ: {ours.shape} {theirs.shape}")
        return False
    block = max(1, -(-max(ours.shape[1:3]) // 8))
    z = z_scores(block_means(ours, block), block_means(theirs, block))
    total = z_scores(ours.mean(axis=(1, 2)), theirs.mean(axis=(1, 2)))
    largest = np.abs(z).max()
    p = -math.expm1(z.size * math.log1p(-min(1 - 1e-16, math.erfc(largest / math.sqrt(2)))))
    ratio = ours.mean() / theirs.mean()
    agree = p > 1e-4 and np.abs(total).max() < 4.5
    print(f"{name:36} blocks {z.size:4}  rms z {np.sqrt(np.mean(z**2)):6.2f}  max |z| {largest:6.2f}"
          f"  p {p:8.2g}  image z {total[0]:6.2f} {total[1]:6.2f} {total[2]:6.2f}"
          f"  mean ratio {ratio:.5f}  {'agree' if agree else 'DISAGREE'}", flush=True)
    return agree


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("-D", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--spp", type=int, default=64, help="samples per pixel of each image")
    parser.add_argument("--shading", default="continuous", help="limn's --shading")
    parser.add_argument("--suite", action="store_true", help="one scene per feature")
    parser.add_argument("--only", default="", help="cases of the suite whose name contains this")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    arguments = parser.parse_args()
    mi.set_variant(arguments.variant)
    mi.set_log_level(mi.LogLevel.Error)
    defines = dict(define.split("=", 1) for define in arguments.D)
    results = [compare(scene, scene, defines, arguments.spp, ["--shading", arguments.shading])
               for scene in arguments.scenes]
    if arguments.suite:
        with tempfile.TemporaryDirectory() as folder:
            for name, scene, options in suite(folder):
                if arguments.only not in name:
                    continue
                if arguments.variant.startswith("scalar") and ("gaussian" in name or "tent" in name):
                    print(f"{name:36} left out: {arguments.variant} tabulates this filter")
                else:
                    results.append(compare(name, scene, {}, arguments.spp, options))
    print(f"{sum(results)} of {len(results)} agree")
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
