#!/usr/bin/env python3
"""Times images of limn and of Mitsuba 3's llvm_ad_rgb in turns, one thread each.

    tools/mitsuba/image_speed.py SCENE... [-D name=value] [--spp N] [--rounds N]
                                 [--sampler multijitter] [--limn PROGRAM]

Processor time without set-up: what samples beyond the first take, of Mitsuba after images that
compile. Variances are those between rounds, each of its own seed.
Columns: limn's samples per second over Mitsuba's; Mitsuba's variance over limn's at equal samples;
their product, Mitsuba's squared error x time over limn's (above 1: limn ahead). Needs
`pip install mitsuba==3.9.1`.
"""
import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import common  # noqa: E402
import exr  # noqa: E402
import mitsuba as mi  # noqa: E402

mi.set_variant("llvm_ad_rgb")
import drjit as dr  # noqa: E402


def limn_image(command, spp, seed):
    """Seconds and image (H by W by 3)."""
    def seconds():
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "image.exr")
        before = seconds()
        subprocess.run([*command, "-o", file, "--spp", str(spp), "--seed", str(seed)], check=True,
                       stderr=subprocess.DEVNULL)
        taken, channels = seconds() - before, exr.read(file)
    return taken, np.stack([channels[c] for c in "RGB"], -1).astype(float)


def mitsuba_image(scene, spp, seed):
    before = time.process_time()
    image = mi.render(scene, seed=seed, spp=spp)
    dr.eval(image)
    dr.sync_thread()
    return time.process_time() - before, np.array(image, dtype=float)[..., :3]


def load_mitsuba(file, defines, sampler):
    mi.file_resolver().append(os.path.dirname(os.path.abspath(file)))
    config = mi.parser.ParserConfig("llvm_ad_rgb")
    config.parallel = False
    state = mi.parser.parse_file(config, file, **dict(text.split("=", 1) for text in defines))
    for node in state.nodes:
        if sampler and node.props.plugin_name() == "independent":
            node.props.set_plugin_name(sampler)
    mi.parser.transform_all(config, state)
    scene = mi.parser.instantiate(config, state)
    return scene[0] if isinstance(scene, list) else scene


def seconds_beyond_first(rounds):
    first, all_of = (statistics.median(r[k][0] for r in rounds) for k in (0, 1))
    return all_of - first


def variance(rounds):
    return np.var(np.stack([r[1][1] for r in rounds]), axis=0, ddof=1).mean()


def compare(file, arguments):
    scene = load_mitsuba(file, arguments.D, arguments.sampler)
    dr.set_thread_count(1)  # loading in parallel with one thread would wait for ever
    defines = [word for define in arguments.D for word in ("-D", define)]
    command = [arguments.limn, "render", file, *defines, "--threads", "1", "--quiet"]
    counts = (1, arguments.spp)
    for spp in counts:
        mitsuba_image(scene, spp, arguments.rounds)
    ours, theirs = [], []
    for seed in range(arguments.rounds):
        ours.append([limn_image(command, spp, seed) for spp in counts])
        theirs.append([mitsuba_image(scene, spp, seed) for spp in counts])
    rate = seconds_beyond_first(theirs) / seconds_beyond_first(ours)
    gain = variance(theirs) / variance(ours)
    print(f"{os.path.basename(file):40} samples/s {rate:5.2f}  variance {gain:5.2f}  "
          f"error x time {rate * gain:5.2f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("-D", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--spp", type=int, default=16, help="samples per pixel, at least 2")
    parser.add_argument("--rounds", type=int, default=4, help="at least 2")
    parser.add_argument("--sampler", help="Mitsuba's, in place of an independent one")
    parser.add_argument("--limn", default=os.path.join(common.ROOT, "build", "limn"))
    arguments = parser.parse_args()
    for file in arguments.scenes:
        dr.set_thread_count(os.cpu_count())
        compare(file, arguments)


if __name__ == "__main__":
    main()
