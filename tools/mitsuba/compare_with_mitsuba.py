#!/usr/bin/env python3
"""Renders scenes with limn and with Mitsuba 3 and says whether the images agree.

    tools/mitsuba/compare_with_mitsuba.py SCENE... [-D name=value] [--spp N]

Each renderer makes SEEDS independent images, and regression.py scores their blocks and their means.
Needs `pip install mitsuba==3.9.1`.
"""
import argparse
import os
import sys

import mitsuba as mi

import regression

LIMN = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "build", "limn")
mi.set_variant("llvm_ad_rgb")
mi.set_log_level(mi.LogLevel.Error)


def compare(scene, defines, spp, shading):
    defines = [word for define in defines for word in ("-D", define)]
    ours = regression.images_of(LIMN, scene, defines, spp, shading)
    theirs = regression.mitsuba_images_of(scene, defines, spp)
    if ours.shape != theirs.shape:
        print(f"{scene:36} sizes differ: {ours.shape} {theirs.shape}")
        return False
    # Mitsuba computes in single precision: below 1e-6 nothing can be told.
    (z, p), (z_mean, p_mean) = (
        regression.largest_score(a, regression.mean_of(b), regression.SEEDS, 1e-6)
        for a, b in ((ours, theirs), [x.mean(axis=(1, 2), keepdims=True) for x in (ours, theirs)]))
    agree = min(p, p_mean) > regression.LEAST_P
    print(f"{scene:36} blocks: max z {z:6.2f}  p {p:8.2g}  image: max z {z_mean:6.2f}  p {p_mean:8.2g}"
          f"  mean ratio {ours.mean() / theirs.mean():.5f}  {'agree' if agree else 'DISAGREE'}",
          flush=True)
    return agree


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("-D", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--spp", type=int, default=64, help="samples per pixel of each image")
    parser.add_argument("--shading", default="continuous", help="limn's --shading")
    arguments = parser.parse_args()
    results = [compare(scene, arguments.D, arguments.spp, arguments.shading)
               for scene in arguments.scenes]
    print(f"{sum(results)} of {len(results)} agree")
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
