"""Error after a fixed time against the family's knob, a line for each method."""

import math

from report import charts
from report.charts import ALARM, FAINT, TEXT

from .table import OURS, methods_of
from .verdicts import BIASED, BLACK, FAILS, LATE, REFUSES, number

TOP, BOTTOM = 30.0, 0.01  # of the error's axis, at least
CEILING = 1e3  # beyond it, the error stands at the axis' end
RING = {"markerfacecolor": "none", "linestyle": "none"}
MARKED = {BIASED: {**RING, "marker": "o", "markeredgecolor": ALARM, "markeredgewidth": 2},
          LATE: {**RING, "marker": "s", "markeredgecolor": FAINT, "markeredgewidth": 1.2}}


def _limits(records):
    errors = [f.get("error") for r in records if r for f in r["methods"].values()]
    known = [e for e in errors if e and math.isfinite(e)]
    low, high = min([BOTTOM, *(e / 1.5 for e in known)]), max([TOP, *(e * 3 for e in known)])
    return max(low, 1e-4), min(high, CEILING)


def _line(panel, records, method, look, limits):
    """Returns (place, verdict) of the points without an error to show."""
    shown, words = [], []
    for record in records:
        at = (record or {"methods": {}})["methods"].get(method, {})
        error = at.get("error")
        shown.append(min(max(error, limits[0]), limits[1]) if error else math.nan)
        words.append((at.get("verdict"), not error))
    strong = method == OURS
    panel.plot(range(len(shown)), shown, label=method, linewidth=2.6 if strong else 1.4,
               zorder=4 if strong else 3, **look)
    for x, (y, (word, _)) in enumerate(zip(shown, words)):
        if word in MARKED and not math.isnan(y):
            panel.plot([x], [y], markersize=14, zorder=5, **MARKED[word])
    return [(x, word) for x, (word, missing) in enumerate(words)
            if word and (missing or word in (FAILS, REFUSES))]


@charts.chart(8.6, 3.7)
def draw(figure, panel, palette, family, records):
    low, high = limits = _limits(records)
    panel.set_yscale("log")
    panel.set_ylim(low, high)
    above = []
    for method in methods_of([(family, records)]):
        look = {"color": palette.ink(method), "marker": palette.marker(method)}
        above += [(x, word, look) for x, word in _line(panel, records, method, look, limits)]
    own = [((r or {}).get("reference") or {}).get("error") for r in records]
    panel.plot(range(len(records)), [e or math.nan for e in own], color=FAINT, linestyle=":",
               linewidth=1.2, label="reference's own")
    panel.axhline(BLACK, color=TEXT, linestyle="--", linewidth=1, label="a black image")
    foot = panel.get_xaxis_transform()
    for k, (x, word, look) in enumerate(above):  # no error: at the top, with its word
        y = 0.97 - 0.06 * (k % 3)
        panel.plot([x], [y], transform=foot, **look)
        panel.annotate(word, (x, y), (6, -3), xycoords=foot, textcoords="offset points",
                       fontsize=8, color=ALARM)
    for word, look in MARKED.items():
        panel.plot([], [], markersize=11, label=word, **look)
    panel.set_xticks(range(len(records)), [number(v) for v in family.values])
    panel.set_xlim(-0.4, len(records) - 0.6)
    panel.set_xlabel(family.knob)
    panel.set_ylabel("relative error")
    charts.log_axis(panel.yaxis, low, high)
    panel.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return (f"Relative error of each method against the knob of {family.name}; the numbers are in"
            " the table below")
