#!/usr/bin/env python3
"""A derivative in parts, by workers of a Dask cluster: here two processes of this machine.

    parts_with_dask.py [--quick]

Joined they are the very bits of one run. For other machines give Client the address of their
scheduler; all workers need the same build of limn.
"""

import sys
from pathlib import Path

import limn
import numpy as np
from dask.distributed import Client, LocalCluster

NAME = "ball.translate.x"


def load(quick):
    size = 32 if quick else 128
    return limn.load(Path(__file__).with_name("ball.xml"), width=size, height=size)


def make(k, n, scene_of, quick, spp):
    # A scene is read where it is needed; a part travels back.
    return limn.part((k, n), limn.gradient, scene_of(quick), NAME, spp=spp, threads=1)


def main():
    quick = "--quick" in sys.argv
    spp, n = (20, 3) if quick else (256, 8)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with Client(cluster) as client:
            futures = client.map(make, range(1, n + 1), n=n, scene_of=load, quick=quick, spp=spp)
            parts = client.gather(futures)
    scene = load(quick)
    change = limn.merge(parts, scene)[NAME]
    limn.write_signed_png("change.png", change)
    print(f"{n} parts, {sum(len(p.data) for p in parts) / 1e6:.1f} MB: {change}")
    if quick:
        alone = limn.gradient(scene, NAME, spp=spp)[NAME]
        assert np.array_equal(change.value, alone.value)
        assert np.array_equal(change.stderr, alone.stderr)


if __name__ == "__main__":
    main()
