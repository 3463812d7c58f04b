#!/usr/bin/env python3
"""chart_plot.py REJECT.JSON PICTURE.PNG: the pair of quadrics that bounds the planes of a node, as
two surfaces in the coordinates of its dual box, with the wedges of its edges between them.

Exit status: 0 drawn, 2 the file has no chart, 3 matplotlib or numpy is missing.
"""

import json
import sys

GRID = 81
MOST_WEDGES = 600  # More are a blot.


def heights(chart, level, up):
    """u_up of the surface f = level over a grid of the two other axes; NaN outside of the box."""
    import numpy as np

    i, j = [k for k in range(3) if k != up]
    u, v = np.meshgrid(np.linspace(-1, 1, GRID), np.linspace(-1, 1, GRID), indexing="ij")
    linear, square, product = chart["linear"], chart["square"], chart["product"]
    # product_k belongs to the two axes other than k.
    a = square[up] * np.ones_like(u)
    b = linear[up] + product[j] * u + product[i] * v
    c = linear[i] * u + square[i] * u * u + linear[j] * v + square[j] * v * v
    c = c + product[up] * u * v - level
    with np.errstate(all="ignore"):
        # The root that goes over into -c / b where a fades.
        root = np.sqrt(b * b - 4 * a * c)
        w = -2 * c / (b + np.where(b >= 0, root, -root))
    return u, v, np.where(np.abs(w) <= 1, w, np.nan), (i, j)


def draw(chart, file):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    up = max(range(3), key=lambda k: abs(chart["linear"][k]))
    figure = plt.figure(figsize=(5, 5), dpi=150)
    axes = figure.add_subplot(projection="3d")
    for level, colour in ((chart["low"], "#2f6fb7"), (chart["high"], "#f28e2b")):
        u, v, w, (i, j) = heights(chart, level, up)
        axes.plot_surface(u, v, w, color=colour, alpha=0.35, linewidth=0, rstride=2, cstride=2)
    step = max(1, len(chart["edges"]) // MOST_WEDGES)
    for a, b in chart["edges"][::step]:
        axes.plot([a[i], b[i]], [a[j], b[j]], [a[up], b[up]], color="#202020", linewidth=0.6)
    for axis, k in (("x", i), ("y", j), ("z", up)):
        getattr(axes, f"set_{axis}lim")(-1, 1)
        getattr(axes, f"set_{axis}ticks")([-1, 0, 1])
        getattr(axes, f"set_{axis}label")(f"u{k + 1}")
    axes.view_init(elev=24, azim=-56)
    figure.savefig(file, bbox_inches="tight", pad_inches=0.4)


def main():
    with open(sys.argv[1], encoding="utf-8") as stream:
        chart = json.load(stream).get("chart")
    if not chart:
        return 2
    try:
        import matplotlib  # noqa: F401
        import numpy  # noqa: F401
    except ImportError:
        return 3
    draw(chart, sys.argv[2])
    return 0


if __name__ == "__main__":
    sys.exit(main())
