"""Are stated errors true? The errors that runs state against the spread of runs with other seeds,
for single pixels and for the sum of the image."""

import concurrent.futures
import json
import math
import os
import re
import shutil
import subprocess
import textwrap

import exr
import numpy as np
from common import commit_line, read_json, write_json
from report import charts
from report.charts import FAINT, TEXT
from report.colours import Palette
from report.markup import document, element, figures, table

from .families import find

# Families with one of their values each: what they are hard in is not too hard for any method.
SCENES = {"contact": 0.1, "small-lamps": 0.1, "near-mirrors": 0.1, "sun": 3, "depth": 4,
          "open": 0.5, "crossing": 4, "grazing": 10}
LEVELS = (8, 16, 64, 256)  # samples per pixel
SEEDS = 32
RESOLUTION = 4  # few pixels, so that all of it takes some minutes of processor time
LOW, HIGH = 0.8, 1.25  # ratios beyond these are off
ENOUGH = 64  # from so many samples on
BEGIN, END = "<!-- calibration: begin -->", "<!-- calibration: end -->"


def gradient_methods(limn):
    """All public methods of `limn gradient`, as the program lists them."""
    text = subprocess.run([limn, "gradient", "--help"], capture_output=True, text=True).stdout
    names = re.search(r"Method: ([^;]*);", text)[1]
    return [name.strip() for name in names.split(",")]


def run(limn, file, parameter, method, spp, seed, folder):
    """(sum, its stated error, image, its stated errors), or None if the method refuses the scene."""
    os.makedirs(folder, exist_ok=True)
    image, record = os.path.join(folder, "d.exr"), os.path.join(folder, "d.json")
    done = subprocess.run(
        [limn, "gradient", file, "--wrt", parameter, "--method", method, "--spp", str(spp), "--seed",
         str(seed), "--threads", "1", "--quiet", "-o", image, "--json", record],
        cwd=os.path.dirname(file), capture_output=True, text=True)
    try:
        if done.returncode == 2:
            return None
        if done.returncode:
            raise RuntimeError(f"{file}, {method}, seed {seed}: {done.stderr.strip()}")
        with open(record, encoding="utf-8") as stream:
            found = json.load(stream)["parameters"][0]
        return (found["sum"], found["sum_stderr"], exr.grey(image),
                exr.grey(image.replace(".exr", "_stderr.exr")))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def ratios(runs):
    """Of the stated errors to the spread, root mean squares: of the sum, and over all pixels.
    beyond: the share of sums more than three stated errors from the mean of the others."""
    sums, errors = np.array([r[0] for r in runs]), np.array([r[1] for r in runs])
    images, image_errors = np.array([r[2] for r in runs]), np.array([r[3] for r in runs])
    n = len(runs)
    away = np.abs(sums - sums.mean()) * n / (n - 1)
    spread = sums.std(ddof=1)
    beyond = away > 3 * np.hypot(errors, spread / math.sqrt(n - 1))

    def ratio(stated, variance):
        return math.sqrt(stated / variance) if variance > 0 else None

    return {"sum": ratio((errors**2).mean(), spread**2),
            "pixel": ratio((image_errors**2).mean(), images.var(axis=0, ddof=1).mean()),
            "beyond": float(beyond.mean())}


def measure(limn, output, seed, jobs, methods):
    """Rows for every scene, method and number of samples. Those in the output's folder are kept.
    methods: all if empty."""
    rows = stored(output)
    done = {(r["scene"], r["method"]) for r in rows}
    methods = methods or gradient_methods(limn)
    for name, value in SCENES.items():
        scene = find(name).point(value)[0]
        file = scene.write(os.path.join(output, "calibration", name), RESOLUTION)
        for method in methods:
            if (name, method) not in done:
                rows += _rows_of(limn, file, (name, scene.parameter, method), seed, jobs)
                write_json(_record(output), rows)
                print(f"{name}, {method}", flush=True)
    return rows


def _rows_of(limn, file, about, seed, jobs):
    """One for every number of samples; none if the method refuses the scene."""
    name, parameter, method = about
    rows = []
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for spp in LEVELS:
            def one(k, spp=spp):
                return run(limn, file, parameter, method, spp, seed + k, f"{file}-{k}")

            runs = list(pool.map(one, range(SEEDS)))
            if None in runs:
                break
            rows.append({"scene": name, "method": method, "spp": spp, **ratios(runs)})
    return rows


def _record(output):
    return os.path.join(output, "calibration.json")


def stored(output):
    return read_json(_record(output)) or []


def pooled(rows, key):
    """The geometric mean over scenes; None where there is none."""
    logarithms = [math.log(r[key]) for r in rows if r[key]]
    return math.exp(sum(logarithms) / len(logarithms)) if logarithms else None


def _number(value):
    return "–" if value is None else f"{value:.2f}"


def worst_rows(rows, count=3):
    """Those from ENOUGH samples on whose sums are furthest off."""
    known = [r for r in rows if r["sum"] and r["spp"] >= ENOUGH]
    return sorted(known, key=lambda r: -abs(math.log(r["sum"])))[:count]


def spread(rows, key):
    """From the least to the largest of the means over scenes, of methods and numbers of samples."""
    groups = {}
    for r in rows:
        groups.setdefault((r["method"], r["spp"]), []).append(r)
    means = [mean for mean in (pooled(group, key) for group in groups.values()) if mean]
    return f"{min(means):.2f}–{max(means):.2f}" if means else "–"


def markdown(rows):
    beyond = {}
    for r in rows:
        if r["spp"] >= ENOUGH:
            beyond.setdefault(r["method"], []).append(r["beyond"])
    lines = []
    for method in ("adaptive", "fd", None):
        own = [r for r in rows if method in (None, r["method"])]
        if own:
            lines.append(f"{f'`{method}`' if method else 'all methods'} {spread(own, 'sum')} (sums),"
                         f" {spread(own, 'pixel')} (pixels)")
    text = (f"Ratios of the stated error to the spread of {SEEDS} seeds at {LEVELS[0]} to {LEVELS[-1]} samples,"
            f" geometric means over {len(SCENES)} scenes: " + "; ".join(lines) + ".")
    if beyond:
        most = max(beyond, key=lambda name: sum(beyond[name]) / len(beyond[name]))
        share = 100 * sum(beyond[most]) / len(beyond[most])
        text += (f" From {ENOUGH} samples on at most {share:.1f} % of a method's sums (`{most}`) are"
                 f" off by more than three errors; the most extreme ratios are ")
        text += ", ".join(f"{_number(r['sum'])} ({r['scene']}, `{r['method']}`)"
                          for r in worst_rows(rows)) + "."
    text += f" {commit_line()}"
    return "\n".join(textwrap.wrap(text, 100)) + "\n"


@charts.chart(10, 4, columns=2, sharey=True)
def draw(figure, panels, palette, rows):
    methods = list(dict.fromkeys(r["method"] for r in rows))
    for panel, key, title in zip(panels, ("sum", "pixel"), ("sum of the image", "pixels")):
        panel.set_xscale("log", base=2)
        panel.set_yscale("log")
        panel.axhspan(LOW, HIGH, color=FAINT, alpha=0.15, linewidth=0)
        panel.axhline(1, color=TEXT, linestyle="--", linewidth=1)
        for k, method in enumerate(methods):
            own = [r for r in rows if r["method"] == method]
            color, aside = palette.ink(method), 2 ** (0.06 * (k - len(methods) / 2))
            known = [r for r in own if r[key]]
            panel.plot([r["spp"] * aside for r in known], [r[key] for r in known], ".", alpha=0.5,
                       color=color, markersize=4)
            means = [pooled([r for r in own if r["spp"] == spp], key) or math.nan for spp in LEVELS]
            panel.plot([spp * aside for spp in LEVELS], means, color=color, label=method,
                       marker=palette.marker(method), linewidth=1.4)
        panel.set_xticks(LEVELS, [str(spp) for spp in LEVELS])
        panel.set_xlabel("samples per pixel")
        panel.set_title(title)
    values = [r[key] for r in rows for key in ("sum", "pixel") if r[key]]
    low, high = min([0.5, *values]) / 1.05, max([2, *values]) * 1.05
    panels[0].set_ylim(low, high)
    charts.log_axis(panels[0].yaxis, low, high)
    panels[0].set_ylabel("stated error / spread")
    panels[1].legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return "Stated errors over the spread of seeds, by method and samples per pixel"


def html(rows):
    palette = Palette(list(dict.fromkeys(r["method"] for r in rows)))
    lines = [[r["scene"], r["method"], str(r["spp"]), figures(r["sum"]), figures(r["pixel"]),
              f"{100 * r['beyond']:.0f} %"] for r in rows]
    return document(
        "limn: stated errors", palette, "", [],
        element("p", f"Root mean squares of stated errors over the spread of {SEEDS} seeds: points"
                     f" are scenes, lines their geometric means, the band {LOW} to {HIGH}."),
        draw(palette, rows),
        table(["scene", "method", "spp", "sum", "pixels", "beyond 3"], lines, "All ratios"))


def write(output, rows):
    """The page; returns its file."""
    page = os.path.join(output, "calibration.html")
    with open(page, "w", encoding="utf-8") as out:
        out.write(html(rows))
    return page


def publish(file, rows):
    """Puts the table between its markers on a page, or at the page's end if it has none."""
    with open(file, encoding="utf-8") as stream:
        text = stream.read()
    if BEGIN not in text:
        text += f"\n## Stated errors\n\n{BEGIN}\n{END}\n"
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    with open(file, "w", encoding="utf-8") as out:
        out.write(f"{before}{BEGIN}\n{markdown(rows)}{END}{after}")
