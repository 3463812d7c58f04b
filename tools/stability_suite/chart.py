"""Error after a fixed time against the family's knob, a line for each method: as SVG for the page,
and as a PNG beside it."""

import math
import os

from report import charts
from report.charts import FAINT, GRID, STYLE, TEXT, pyplot

from .table import chart_file, methods_of
from .verdicts import BIASED, BLACK, FAILS, LATE, REFUSES, number

ALARM = "#b3261e"
WHITE = {TEXT: "#1c2127", GRID: "#e4e8ec", FAINT: "#8a939e"}  # the page's colours on white
TOP, BOTTOM = 30.0, 0.01  # of the error's axis, at least
CEILING = 1e3  # beyond it, the error stands at the axis' end


class OnWhite:
    """The palette for a PNG."""

    def __init__(self, palette):
        self.palette, self.marker = palette, palette.marker

    def ink(self, method):
        light = dict(line.split(":", 1) for line in self.palette.css(0).split(";"))
        return light["--method-" + str(self.palette.methods.index(method))]


def _style(on_white):
    return {k: WHITE.get(v, v) if on_white and isinstance(v, str) else v for k, v in STYLE.items()}


def _limits(errors):
    known = [e for e in errors if e and math.isfinite(e)]
    low = min([BOTTOM] + [e / 1.5 for e in known])
    high = max([TOP] + [e * 3 for e in known])
    return max(low, 1e-4), min(high, CEILING)


def _line(panel, family, records, method, look, low, high):
    ink, marker = look.ink(method), look.marker(method)
    shown, above, handles = [], [], None
    for x, record in enumerate(records):
        figures = (record or {"methods": {}})["methods"].get(method)
        if figures is None:
            shown.append((x, math.nan))
            continue
        error, word = figures.get("error"), figures["verdict"]
        shown.append((x, min(max(error, low), high) if error else math.nan))
        if word in (FAILS, REFUSES) or not error:
            above.append((x, word))
    ours = method == "adaptive"
    (handles,) = panel.plot(*zip(*shown), color=ink, marker=marker, label=method,
                            linewidth=2.6 if ours else 1.4, zorder=4 if ours else 3)
    for (x, y), record in zip(shown, records):
        word = record and record["methods"].get(method, {}).get("verdict")
        if math.isnan(y):
            continue
        if word == BIASED:
            panel.plot([x], [y], marker="o", markersize=14, markerfacecolor="none",
                       markeredgecolor=ALARM, markeredgewidth=2, zorder=5)
        if word == LATE:
            panel.plot([x], [y], marker="s", markersize=14, markerfacecolor="none",
                       markeredgecolor=ink, markeredgewidth=1.2, linestyle="none", zorder=5)
    return handles, [(x, word, ink, marker) for x, word in above]


def _draw(family, records, methods, look, faint, text):
    figure, panel = pyplot.subplots(figsize=(8.6, 3.7))
    errors = [f.get("error") for r in records if r for f in r["methods"].values()]
    low, high = _limits(errors)
    panel.set_yscale("log")
    panel.set_ylim(low, high)
    above = []
    for method in methods:
        above += _line(panel, family, records, method, look, low, high)[1]
    floor = [((r or {}).get("reference") or {}).get("error") for r in records]
    floor = [f if f else math.nan for f in floor]
    panel.plot(range(len(records)), floor, color=faint, linestyle=":", linewidth=1.2,
               label="reference's own")
    panel.axhline(BLACK, color=text, linestyle="--", linewidth=1, label="a black image")
    for k, (x, word, ink, marker) in enumerate(above):  # no error: at the top, with its word
        y = 0.97 - 0.06 * (k % 3)
        panel.plot([x], [y], marker=marker, color=ink, transform=panel.get_xaxis_transform())
        panel.annotate(word, (x, y), (6, -3), xycoords=panel.get_xaxis_transform(),
                       textcoords="offset points", fontsize=8, color=ALARM)
    panel.plot([], [], marker="o", markersize=11, markerfacecolor="none", linestyle="none",
               markeredgecolor=ALARM, markeredgewidth=2, label="biased")
    panel.plot([], [], marker="s", markersize=11, markerfacecolor="none", linestyle="none",
               markeredgecolor=faint, markeredgewidth=1.2, label="late")
    panel.set_xticks(range(len(records)), [number(v) for v in family.values])
    panel.set_xlim(-0.4, len(records) - 0.6)
    panel.set_xlabel(family.knob)
    panel.set_ylabel("relative error")
    charts._log_axis(panel.yaxis, low, high)
    panel.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return figure


def draw(output, family, records, palette):
    """Writes the PNG; returns the SVG for the page."""
    methods = [m for m in methods_of([(family, records)])]
    os.makedirs(os.path.join(output, "charts"), exist_ok=True)
    with pyplot.rc_context(_style(True)):
        figure = _draw(family, records, methods, OnWhite(palette), WHITE[FAINT], WHITE[TEXT])
        pyplot.title(f"{family.name}: error after {records_seconds(records)} s", loc="left")
        figure.savefig(chart_file(output, family), dpi=110, bbox_inches="tight",
                       metadata={"Software": None})
        pyplot.close(figure)
    with pyplot.rc_context(STYLE):
        figure = _draw(family, records, methods, palette, FAINT, TEXT)
        return charts._svg(figure, palette, f"Relative error of each method against the knob of "
                                            f"{family.name}; the numbers are in the table below")


def records_seconds(records):
    return ", ".join(f"{s:g}" for s in sorted({r["settings"]["seconds"] for r in records if r}))
