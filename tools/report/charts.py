"""The charts, as SVG that takes its colours and its font from the page."""

import functools
import io
import itertools
import math
import re

from .markup import Markup, element, figures, superscript, with_error
from .records import ReportError

try:
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as pyplot
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator
except ImportError as missing:
    MISSING = str(missing)
else:
    MISSING = None

# Stand-ins of the page's colours, which a chart is drawn with.
TEXT, GRID, FAINT, ALARM = "#a2005e", "#a2015e", "#a2025e", "#a2035e"
PAGE = {TEXT: "currentColor", GRID: "var(--grid)", FAINT: "var(--faint)", ALARM: "var(--bad)"}
STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "limn",
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "text.color": TEXT,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": TEXT,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": TEXT,
    "ytick.labelcolor": TEXT,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "errorbar.capsize": 3,
    "lines.linewidth": 1.8,
    "lines.markersize": 6,
}

_numbers = itertools.count()


def require_matplotlib():
    if MISSING:
        raise ReportError(
            f"the charts need matplotlib and numpy ({MISSING}): on Debian `apt-get install"
            " python3-matplotlib python3-numpy` and run this with /usr/bin/python3, elsewhere `pip"
            " install matplotlib numpy`")


def chart(width, height, columns=1, **shared):
    """Turns draw(figure, panel or panels, palette, ...), which returns a label for those who
    cannot see the chart, into a function of (palette, ...) that returns the chart's markup.
    width, height: in inches; shared: of the panels' axes, as of pyplot.subplots."""

    def decorate(draw):
        @functools.wraps(draw)
        def drawn(palette, *data):
            with pyplot.rc_context(STYLE):
                figure, panels = pyplot.subplots(1, columns, figsize=(width, height), **shared)
                return _markup(figure, palette, draw(figure, panels, palette, *data))

        return drawn

    return decorate


def _markup(figure, palette, label):
    """The figure as an <svg> for a page: unique ids, its colours and font."""
    stream = io.StringIO()
    figure.savefig(stream, format="svg", transparent=True, bbox_inches="tight", pad_inches=0.05,
                   metadata={"Date": None, "Creator": None})
    pyplot.close(figure)
    svg = stream.getvalue()
    svg = svg[svg.index("<svg"):]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.S)
    svg = re.sub(r"font: ([^;\"]*?)([0-9.]+)px [^;\"]*", r"font-size: \2px", svg)
    prefix = f"chart{next(_numbers)}-"
    used = set(re.findall(r"(?:href=\"|url\()#([^\")]+)", svg))
    svg = re.sub(r' id="([^"]+)"', lambda m: f' id="{prefix}{m[1]}"' if m[1] in used else "", svg)
    svg = re.sub(r"(href=\"|url\()#", rf"\g<1>#{prefix}", svg)
    svg = re.sub(r' xmlns:xlink="[^"]*"| xmlns="[^"]*"', "", svg).replace("xlink:href", "href")
    for stand_in, colour in PAGE.items():
        svg = svg.replace(stand_in, colour)
    svg = palette.page_colours(svg)
    width, height = re.search(r'viewBox="0 0 ([0-9.]+) ([0-9.]+)"', svg).groups()
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    opened = element("svg", role="img", aria_label=label,
                     style=f"width:{float(width) * 1.25:.0f}px;aspect-ratio:{width}/{height}")
    svg = svg.replace("<svg", opened.removesuffix("></svg>"), 1)
    return Markup(f'<div class="chart" tabindex="0">{svg}</div>')


def _power(value, _=None):
    """Labels of a logarithmic axis: 0.01, 1, 10, 10⁵."""
    exponent = round(math.log10(value))
    if value <= 0 or abs(value - 10.0**exponent) > 1e-6 * value:
        return figures(value, 1)
    return f"10{superscript(exponent)}" if abs(exponent) > 3 else f"{value:g}"


def log_axis(axis, low, high):
    """Ticks at powers of ten, and at 2 and 5 between where the axis is short."""
    decades = math.log10(high / low)
    axis.set_major_locator(LogLocator(subs=(1,) if decades > 2.2 else (1, 2, 5), numticks=12))
    axis.set_major_formatter(FuncFormatter(_power))
    axis.set_minor_locator(LogLocator(subs="auto", numticks=12) if decades < 8 else NullLocator())
    axis.set_minor_formatter(NullFormatter())


def _legend_beside(figure, panel):
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.99, 0.9))
    figure.tight_layout()


def _down(value, error):
    """A bar's lower half; it ends above zero, which a logarithmic axis does not have."""
    return min(error, 0.95 * value)


def _draw_method(panel, method, key, palette):
    """One method's means with error bars over its single runs; returns the plotted points."""
    name = method.text("name")
    look = {"marker": palette.marker(name), "color": palette.ink(name)}
    runs = [(r.number("seconds"), r.number(key)) for r in method.records("runs")]
    runs = [(t, e) for t, e in runs if t and e and e > 0]
    points = [(s.number("seconds"), s.number(key), s.number(f"{key}_stderr") or 0)
              for s in method.records("summary")]
    points = [p for p in points if p[0] and p[1] is not None]
    shown = [p for p in points if p[1] > 0]
    if len(runs) > len(shown):
        panel.plot(*zip(*runs), linestyle="none", marker=".", markersize=4, color=look["color"],
                   alpha=0.45)
    if shown:
        t, e, d = zip(*shown)
        slope = method.record_or_none("slope") if key == "mse" else None
        if slope and slope.number("value") is not None:
            name += f" (slope {with_error(slope.number('value'), slope.number('stderr'))})"
        panel.errorbar(t, e, yerr=[list(map(_down, e, d)), d], label=name, **look)
    for t, e, _ in points:
        if e <= 0:  # Not on a logarithmic axis: shown at its foot.
            panel.plot([t], [0.02], transform=panel.get_xaxis_transform(), marker="v",
                       color=look["color"], clip_on=False)
    return shown


@chart(10.4, 4.2, 2, sharex=True, sharey=True)
def error_against_time(figure, panels, palette, data):
    """Log-log: mean squared error, and its trimmed mean."""
    floor = data.record("reference").number("mean_squared_error")
    keys = {"mse": "mean squared error", "trimmed_mse": "trimmed mean (without the largest 0.1 %)"}
    lines = [[_draw_method(panel, m, key, palette) for m in data.records("methods")]
             for panel, key in zip(panels, keys)]
    points = [p for of_panel in lines for line in of_panel for p in line]
    errors = [v for _, e, d in points for v in (e, e + d)] or [1]
    _around(panels, "x", [t for t, _, _ in points] or [1], 1.25)
    _around(panels, "y", errors + ([floor] if floor and floor > 0 else []), 1.6)
    for panel, of_panel, title in zip(panels, lines, keys.values()):
        panel.set_title(title)
        panel.set_xlabel("measured seconds, set-up included")
        guide = next(filter(None, of_panel), None)
        if guide:  # Error falls as 1 / time without bias: through the first method's last point.
            t, e, _ = guide[-1]
            ends = panel.get_xlim()
            panel.plot(ends, [e * t / x for x in ends], color=FAINT, linewidth=1, linestyle=":",
                       label="slope −1", zorder=0)
            panel.set_xlim(ends)
    if floor and floor > 0:
        panels[0].axhline(floor, color=TEXT, linestyle="--", linewidth=1,
                          label="reference's own error")
    panels[0].set_ylabel("error, squared units of the derivative")
    _legend_beside(figure, panels[0])
    return (f"Error against time for {data.text('parameter')}; "
            "the numbers are in the table of all time budgets")


def _around(panels, axis, values, least):
    """A logarithmic axis around all values, with some air and a factor of 4 at least."""
    low, high = min(values), max(values)
    air = max(least, (4 * low / high) ** 0.5)
    for panel in panels:
        getattr(panel, f"set_{axis}scale")("log")
        getattr(panel, f"set_{axis}lim")(low / air, high * air)
        log_axis(getattr(panel, f"{axis}axis"), low / air, high * air)


@chart(8.6, 1)
def factors(figure, panel, palette, rows, baseline):
    """Time for equal error, one line per scene and one mark per method, on a logarithmic axis.
    rows: [(scene, [(method, factor, stderr)])]."""
    methods = list(dict.fromkeys(m for _, marks in rows for m, _, _ in marks))
    lines = max(1, sum(len(marks) for _, marks in rows))
    figure.set_figheight(0.9 + 0.24 * lines + 0.16 * len(rows))
    y, centers, seen = 0, [], set()
    for _, marks in rows:
        panel.axhspan(y - 0.6, y + len(marks) - 0.4, color=GRID, alpha=0.35, linewidth=0)
        centers.append(y + (len(marks) - 1) / 2)
        for method, factor, error in sorted(marks, key=lambda mark: methods.index(mark[0])):
            panel.errorbar([factor], [y], xerr=[[_down(factor, error or 0)], [error or 0]],
                           marker=palette.marker(method), linestyle="none",
                           color=palette.ink(method), label=None if method in seen else method)
            seen.add(method)
            y += 1
        y += 0.7
    panel.set_xscale("log")
    panel.axvline(1, color=TEXT, linewidth=1, linestyle="--")
    if len(rows) == 1:  # Each line names its method; no legend needed.
        panel.set_yticks(range(len(methods)), methods)
    else:
        panel.set_yticks(centers, [scene for scene, _ in rows])
        figure.legend(loc="upper left", bbox_to_anchor=(0.92, 0.9))
    panel.tick_params(axis="y", length=0)
    panel.invert_yaxis()
    panel.grid(axis="y", visible=False)
    low, high = panel.get_xlim()
    panel.set_xlim(min(low, 0.5), max(high, 2))
    log_axis(panel.xaxis, *panel.get_xlim())
    panel.set_xlabel(f"time for equal error, {baseline} = 1 (further right: slower)")
    return "Time for equal error by scene and method; the numbers are in the table"


@chart(5.6, 1)
def acceptance(figure, panel, palette, rows):
    """rows: [(variant, rate, stderr)]."""
    figure.set_figheight(0.9 + 0.34 * len(rows))
    for y, (name, rate, error) in enumerate(rows):
        end = rate + (error or 0)
        panel.barh(y, 100 * rate, height=0.62, color=palette.ink(name), alpha=0.85,
                   xerr=100 * (error or 0), ecolor=TEXT)
        panel.annotate(f"{100 * rate:.1f} %", (100 * end, y), (6, 0), textcoords="offset points",
                       va="center")
    panel.set_yticks(range(len(rows)), [name for name, _, _ in rows])
    panel.tick_params(axis="y", length=0)
    panel.set_xlim(0, 118)  # Room for the figure beside a full bar.
    panel.set_xticks(range(0, 101, 20))
    panel.invert_yaxis()
    panel.grid(axis="y", visible=False)
    panel.set_xlabel("descents that end on a silhouette, %")
    return "Acceptance rates by variant; the numbers are in the table"


@chart(10.4, 3.6, 2, sharex=True)
def false_positives_by_depth(figure, panels, palette, variants):
    """Share of accepted nodes without a silhouette, and of nodes tested that were accepted."""
    shares = {"accepted nodes that hold no silhouette, %": ("false_accepts", "accepted"),
              "tested nodes that were accepted, %": ("accepted", "nodes_tested")}
    for panel, (title, (part, whole)) in zip(panels, shares.items()):
        for variant in variants:
            name = variant.text("name")
            points = [(d.number("depth"), 100 * d.number(part) / d.number(whole))
                      for d in variant.records("by_depth") if d.number(whole)]
            if points:
                panel.plot(*zip(*points), color=palette.ink(name), marker=palette.marker(name),
                           label=name)
        panel.set_title(title)
        panel.set_xlabel("depth in the tree")
        panel.set_ylim(bottom=0)
        panel.xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(integer=True))
    _legend_beside(figure, panels[0])
    return "False positives by depth; the numbers are in the table"


@chart(7.2, 3.0)
def loss_over_steps(figure, panel, palette, rows):
    """rows: (step, loss, its standard error). Those below zero are noise: ticks below the curve."""
    below = [s for s, v, _ in rows if v is not None and v <= 0]
    panel.set_xlim(rows[0][0], max(rows[-1][0], rows[0][0] + 1))
    shown = [(s, v, e) for s, v, e in rows if v is not None and v > 0]
    if shown:
        steps, losses, errors = zip(*shown)
        low = [v - _down(v, e) for v, e in zip(losses, errors)]
        high = [v + e for v, e in zip(losses, errors)]
        panel.fill_between(steps, low, high, color=palette.ink("fit"), alpha=0.25, linewidth=0)
        panel.plot(steps, losses, color=palette.ink("fit"))
        panel.set_yscale("log")
        log_axis(panel.yaxis, min(losses), max(1.01 * min(losses), *high))
    panel.set_xlabel("step")
    panel.set_ylabel("loss")
    text = f"loss over {len(rows)} steps, with its standard error"
    if not below:
        return text
    panel.plot(below, [0.02] * len(below), linestyle="", marker="|", color=palette.ink("fit"),
               transform=panel.get_xaxis_transform())
    panel.set_xlabel("step (marks: losses below zero, which an unbiased estimate may be)")
    return f"{text}; an unbiased estimate, below zero at the {len(below)} steps with a mark"


@chart(9.6, 3.0)
def values_over_steps(figure, panel, palette, numbers):
    """numbers: name to rows (step, value)."""
    for (name, rows), line in zip(numbers.items(), itertools.cycle(["-", "--", ":", "-."])):
        panel.plot([r[0] for r in rows], [r[1] for r in rows], linestyle=line,
                   color=palette.ink("fit"), label=name)
    panel.set_xlabel("step")
    panel.legend()
    return "values over steps"


@chart(9.6, 3.0, 2)
def distance_over_steps(figure, panels, palette, shapes):
    """shapes: name to rows (step, chamfer over diagonal, mean angle of normals in degrees)."""
    titles = ("chamfer distance / diagonal", "angle of normals [degrees]")
    for column, (panel, title) in enumerate(zip(panels, titles), 1):
        for (name, rows), line in zip(shapes.items(), itertools.cycle(["-", "--", ":", "-."])):
            panel.plot([r[0] for r in rows], [r[column] for r in rows], linestyle=line,
                       color=palette.ink("fit"), marker="o", label=name)
        panel.set_ylim(bottom=0)
        panel.set_xlabel("step")
        panel.set_title(title)
    if len(shapes) > 1:
        panels[0].legend()
    figure.tight_layout()
    return "distance to the true shape over steps"
