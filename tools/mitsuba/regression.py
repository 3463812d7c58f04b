#!/usr/bin/env python3
"""Compares limn's images with the reference images of Mitsuba's own regression tests.

    tools/mitsuba/regression.py DIR [--only TEXT] [--path DIR] [-D name=value] [--at-least N]

DIR is a clone of mitsuba-data, or a folder in it. A scene NAME.xml or NAME_INTEGRATOR.xml counts if
refs/NAME_ref_rgb.exr and refs/NAME_ref_rgb_var.exr lie beside it: the image, and the variance of
one sample. Scenes that limn does not open are listed with the reason.

Two tests for each, of two million samples, by --shading mitsuba:

- Mitsuba's (src/render/tests/test_renders.py): in XYZ, the probability of a difference as large,
  from the reference's variance alone, is above 1 - 0.99^(1 / pixels) for 99.75 % of the values.
- limn's: SEEDS images of their own seeds, and with their means by blocks of pixels a normal score
  of the difference from the reference, both variances together. All blocks agree if a score as
  large as the largest has a probability above 1e-4 among so many. Where only this test fails,
  Mitsuba 3.9.1 renders the scene: if its image fails, too, the reference is not Mitsuba's image any
  more, and limn's is held against the new one. Two reasons are known: a sum of 32000 numbers in
  single precision is off by up to 1e-3 where they are equal (1.00108 for a red of 1), and scalar
  variants of Mitsuba tabulate filters in 31 steps.

With --at-least the exit status is 1 where fewer scenes pass both. That, and files that are neither
plain nor zipped, takes `pip install mitsuba==3.9.1`.
"""

import argparse
import math
import os
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import census  # noqa: E402
import common  # noqa: E402
import exr  # noqa: E402

SAMPLES = 2e6
SEEDS = 8
REFERENCE_SAMPLES = 32000
LEAST_SHARE = 0.9975
LEAST_P = 1e-4
XYZ = np.array([[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169],
                [0.019334, 0.119193, 0.950227]])
erfc = np.vectorize(math.erfc, otypes=[float])


def read(file):
    """H by W by 3."""
    try:
        channels = exr.read(file)
        return np.stack([channels.get(name, channels.get("Y")) for name in "RGB"], -1)
    except ValueError:
        import mitsuba as mi
        mi.set_variant("scalar_rgb")
        return np.array(mi.Bitmap(file), dtype=np.float64)[..., :3]


def references_of(scene):
    """The reference and its variance; None where there are none."""
    folder, name = os.path.split(scene)
    name = name[:-len(".xml")]
    for stem in (name, name.rpartition("_")[0]):
        stem = os.path.join(folder, "refs", stem + "_ref_rgb")
        files = [stem + ".exr", stem + "_var.exr"]
        if all(map(os.path.exists, files)):
            return [read(file) for file in files]
    return None


def images_of(limn, scene, options, spp, shading="mitsuba"):
    """SEEDS by H by W by 3."""
    images = []
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "image.exr")
        for seed in range(SEEDS):
            command = [limn, "render", scene, "-o", file, "--spp", str(spp), "--seed", str(seed),
                       "--generator", "independent", "--shading", shading, "--quiet", *options]
            subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
            images.append(read(file))
    return np.stack(images)


def mitsuba_images_of(scene, options, spp):
    """The same by Mitsuba itself, in a variant that has exact filters, as limn has."""
    import mitsuba as mi
    if not hasattr(mi, "set_variant"):
        raise ImportError("this is the folder that this file is in")
    mi.set_variant("llvm_ad_rgb")
    values = dict(text.split("=", 1) for flag, text in zip(options, options[1:]) if flag == "-D")
    loaded = mi.load_file(scene, **values)
    return np.stack([np.array(mi.render(loaded, seed=seed, spp=spp), dtype=np.float64)[..., :3]
                     for seed in range(SEEDS)])


def mitsuba_share(image, reference, variance, spp):
    """The share of values that pass Mitsuba's test."""
    image, reference, variance = (x @ XYZ.T for x in (image, reference, variance))
    z = np.abs(image - reference) * np.sqrt(spp / np.maximum(variance, 1e-4))
    pixels = z.shape[0] * z.shape[1]
    return np.mean(erfc(z / math.sqrt(2)) > 1 - 0.99 ** (1 / pixels))


def block_sums(values, block):
    """... by H by W by 3 to ... by rows by columns by 3."""
    rows = np.add.reduceat(values, range(0, values.shape[-3], block), axis=-3)
    return np.add.reduceat(rows, range(0, values.shape[-2], block), axis=-2)


def block_of(image):
    return max(1, -(-max(image.shape[:2]) // 8))


def mean_of(images):
    """The mean of the images' blocks, and its variance."""
    sums = block_sums(images, block_of(images[0]))
    return sums.mean(axis=0), sums.var(axis=0, ddof=1) / SEEDS


def reference_of(image, variance):
    """The same for a reference, whose variance is that of one sample."""
    block = block_of(image)
    # Variances as differences of squares may come out below zero.
    return block_sums(image, block), block_sums(np.maximum(variance, 0), block) / REFERENCE_SAMPLES


def largest_score(images, theirs, their_seeds, rounding=2.0**-11):
    """The largest score of a block, and the probability of one as large among so many.

    theirs: what mean_of or reference_of says; their_seeds: SEEDS or infinity, likewise; rounding:
    of a pixel, relative (images in halves).
    """
    mean, ours = mean_of(images)
    rounded = block_sums((images.mean(axis=0) * rounding) ** 2, block_of(images[0])) + 1e-20
    total = ours + theirs[1] + rounded
    t = (mean - theirs[0]) / np.sqrt(total)
    # Welch's t, as a normal score of the same tail (Wallace 1959).
    known = ours**2 / (SEEDS - 1) + theirs[1]**2 / (their_seeds - 1)
    nu = np.minimum(total**2 / np.maximum(known, 1e-300), 1e6)
    z = np.sqrt(nu * np.log1p(t * t / nu)) * (8 * nu + 1) / (8 * nu + 3)
    largest = z.max()
    p = -math.expm1(z.size * math.log1p(-min(1 - 1e-16, math.erfc(largest / math.sqrt(2)))))
    return largest, p


def judge_reference(images, theirs, scene, options, spp):
    """True if Mitsuba's image of today is not the reference, but limn's image; and words for it."""
    try:
        mitsuba_images = mitsuba_images_of(scene, options, 4 * spp)
    except ImportError:
        return False, f"{'':6}Mitsuba is not installed, which could say whether the reference is its"
    apart, p_apart = largest_score(mitsuba_images, theirs, math.inf)
    ours, p_ours = largest_score(images, mean_of(mitsuba_images), SEEDS)
    words = (f"{'':6}Mitsuba's own image: max z {apart:.2f} (p {p_apart:.2g}) from the reference, "
             f"{ours:.2f} (p {p_ours:.2g}) from limn's")
    return p_apart <= LEAST_P < p_ours, words


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", metavar="TEXT", help="scenes whose path contains this")
    arguments = census.read_arguments(parser)
    limn = arguments.limn
    passed = tested = found = 0
    print(f"{'scene':52} {'Mitsuba: share':>14} {'limn: max z':>12} {'p':>8}")
    for scene in census.find_scenes(arguments.folder):
        name = os.path.relpath(scene, arguments.folder)
        references = references_of(scene) if arguments.only in name else None
        if not references:
            continue
        found += 1
        message, options = census.open_scene(limn, scene, arguments.defines, arguments.path)
        if message:
            print(f"{name:52} {census.reason_of(message)}", flush=True)
            continue
        tested += 1
        reference, variance = references
        spp = max(1, int(SAMPLES / reference[..., 0].size / SEEDS))
        images = images_of(limn, scene, options, spp)
        if images.shape[1:] != reference.shape:
            print(f"{name:52} sizes differ: {images.shape[1:]} {reference.shape}", flush=True)
            continue
        share = mitsuba_share(images.mean(axis=0), reference, variance, SEEDS * spp)
        theirs = reference_of(reference, variance)
        largest, p = largest_score(images, theirs, math.inf)
        right, why = p > LEAST_P, ""
        if not right and share >= LEAST_SHARE:
            right, why = judge_reference(images, theirs, scene, options, spp)
        good = share >= LEAST_SHARE, right
        passed += all(good)
        words = " ".join("passes" if g else "FAILS" for g in good)
        print(f"{name:52} {share:13.4%} {largest:12.2f} {p:8.2g}  {words}", flush=True)
        if why:
            print(why, flush=True)
    print(f"{passed} pass both of {tested} that open, of {found} with references")
    return 0 if passed >= arguments.at_least else 1


if __name__ == "__main__":
    sys.exit(main())
