"""The charts, as SVG that takes its colours and its font from the page."""

import io
import itertools
import math
import re

from .errors import ReportError
from .markup import Markup, figures, superscript, with_error

try:
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as pyplot
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator
except ImportError as missing:
    MISSING = str(missing)
    pyplot = None
else:
    MISSING = None

TEXT, GRID, FAINT = "#a2005e", "#a2015e", "#a2025e"
PAGE = {TEXT: "currentColor", GRID: "var(--grid)", FAINT: "var(--faint)"}
STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "limn",
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "text.color": TEXT,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": TEXT,
    "axes.titlesize": 11,
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
    if pyplot is None:
        raise ReportError(
            f"the charts need matplotlib and numpy ({MISSING}): on Debian `apt-get install"
            " python3-matplotlib python3-numpy` and run this with /usr/bin/python3, elsewhere `pip"
            " install matplotlib numpy`"
        )


def _svg(figure, palette, text):
    """The figure as an <svg> for a page: unique ids, its colours and font; `text` is its label."""
    stream = io.StringIO()
    figure.savefig(
        stream,
        format="svg",
        transparent=True,
        bbox_inches="tight",
        pad_inches=0.05,
        metadata={"Date": None, "Creator": None},
    )
    pyplot.close(figure)
    svg = stream.getvalue()
    svg = svg[svg.index("<svg") :]
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
    label = text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
    svg = svg.replace(
        "<svg",
        f'<svg role="img" aria-label="{label}" '
        f'style="width:{float(width) * 1.25:.0f}px;aspect-ratio:{width}/{height}"',
        1,
    )
    return Markup(f'<div class="chart" tabindex="0">{svg}</div>')


def _power(value, _=None):
    """Labels of a logarithmic axis: 0.01, 1, 10, 10⁵."""
    exponent = round(math.log10(value))
    if value <= 0 or abs(value - 10.0**exponent) > 1e-6 * value:
        return figures(value, 1)
    return f"10{superscript(exponent)}" if abs(exponent) > 3 else f"{value:g}"


def _log_axis(axis, low, high):
    """Ticks at powers of ten, and at 2 and 5 between where the axis is short."""
    decades = math.log10(high / low)
    axis.set_major_locator(LogLocator(subs=(1,) if decades > 2.2 else (1, 2, 5), numticks=12))
    axis.set_major_formatter(FuncFormatter(_power))
    axis.set_minor_locator(LogLocator(subs="auto", numticks=12) if decades < 8 else NullLocator())
    axis.set_minor_formatter(NullFormatter())


def slope_text(method):
    slope = method.record_or_none("slope")
    if slope is None or slope.number("value") is None:
        return None
    return with_error(slope.number("value"), slope.number("stderr"))


def _draw_method(panel, method, key, palette):
    """One method's means with error bars over its single runs; returns the plotted positions."""
    name, ink = method.text("name"), palette.ink(method.text("name"))
    runs = [(r.number("seconds"), r.number(key)) for r in method.records("runs")]
    runs = [(t, e) for t, e in runs if t and e and e > 0]
    points = [
        (s.number("seconds"), s.number(key), s.number(f"{key}_stderr") or 0)
        for s in method.records("summary")
    ]
    shown = [(t, e, d) for t, e, d in points if t and e is not None and e > 0]
    if len(runs) > len(shown):
        panel.plot(*zip(*runs), linestyle="none", marker=".", markersize=4, color=ink, alpha=0.45)
    if shown:
        t, e, d = zip(*shown)
        # A bar that reaches zero ends at a twentieth of the value: the axis has no zero.
        low = [min(width, 0.95 * value) for value, width in zip(e, d)]
        slope = slope_text(method) if key == "mse" else None
        panel.errorbar(
            t,
            e,
            yerr=[low, d],
            marker=palette.marker(name),
            color=ink,
            label=f"{name} (slope {slope})" if slope else name,
        )
    below = [t for t, e, _ in points if t and e is not None and e <= 0]
    return shown, [(t, ink) for t in below]


def _draw_guide(panel, shown):
    """Slope -1 through the last point of the first method: error falls as 1 / time without bias."""
    t, e, _ = shown[-1]
    low, high = panel.get_xlim()
    panel.plot(
        [low, high],
        [e * t / low, e * t / high],
        color=FAINT,
        linewidth=1,
        linestyle=":",
        label="slope −1",
        zorder=0,
    )
    panel.set_xlim(low, high)


def error_against_time(data, palette):
    """Two panels, log-log: mean squared error, and the same without the worst pixels."""
    with pyplot.rc_context(STYLE):
        figure, panels = pyplot.subplots(1, 2, figsize=(10.4, 4.2), sharex=True, sharey=True)
        floor = data.record("reference").number("mean_squared_error")
        titles = ("mean squared error", "without the worst 0.1 % of pixels")
        shown = []
        for panel, key, title in zip(panels, ("mse", "trimmed_mse"), titles):
            panel.set_title(title, loc="left")
            panel.set_xlabel("measured seconds, set-up included")
            shown.append(_draw_methods(panel, data, key, palette))
        _time_and_error_axes(panels, [p for lines in shown for line in lines for p in line], floor)
        for panel, lines in zip(panels, shown):
            if lines:
                _draw_guide(panel, lines[0])
        if floor and floor > 0:
            panels[0].axhline(
                floor, color=TEXT, linestyle="--", linewidth=1, label="reference's own error"
            )
        panels[0].set_ylabel("error, squared units of the derivative")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.99, 0.9))
        figure.tight_layout()
        return _svg(
            figure,
            palette,
            f"Error against time for {data.text('parameter')}; "
            "the numbers are in the table of all times",
        )


def _draw_methods(panel, data, key, palette):
    """All methods of one panel; returns the points of each method that has any."""
    lines = []
    for method in data.records("methods"):
        shown, below = _draw_method(panel, method, key, palette)
        lines += [shown] if shown else []
        for t, ink in below:  # Not on a logarithmic axis: said at its foot.
            panel.plot(
                [t],
                [0.02],
                transform=panel.get_xaxis_transform(),
                marker="v",
                color=ink,
                clip_on=False,
            )
    return lines


def _time_and_error_axes(panels, points, floor):
    """Logarithmic, around all points with some air, and a factor of 4 at least."""
    values = [
        [t for t, _, _ in points] or [1],
        [v for _, e, d in points for v in (e, e + d)] or [1],
    ]
    if floor and floor > 0:
        values[1].append(floor)
    for axis, (low, high) in zip(("x", "y"), ((min(v), max(v)) for v in values)):
        air = max(1.25 if axis == "x" else 1.6, (4 * low / high) ** 0.5)
        getattr(panels[0], f"set_{axis}scale")("log")
        getattr(panels[0], f"set_{axis}lim")(low / air, high * air)
        for panel in panels:
            getattr(panel, f"set_{axis}scale")("log")
            _log_axis(getattr(panel, f"{axis}axis"), low / air, high * air)


def factors(rows, baseline, palette):
    """Time for equal error, one line per scene and one mark per method, on a logarithmic axis.
    rows: [(scene, [(method, factor, stderr)])]."""
    with pyplot.rc_context(STYLE):
        methods = list(dict.fromkeys(m for _, marks in rows for m, _, _ in marks))
        lines = max(1, sum(len(marks) for _, marks in rows))
        figure, panel = pyplot.subplots(figsize=(8.6, 0.9 + 0.24 * lines + 0.16 * len(rows)))
        y, centers, seen = 0, [], set()
        for _, marks in rows:
            start = y
            panel.axhspan(y - 0.6, y + len(marks) - 0.4, color=GRID, alpha=0.35, linewidth=0)
            for method, factor, error in sorted(marks, key=lambda mark: methods.index(mark[0])):
                bars = [[min(error or 0, 0.95 * factor)], [error or 0]]
                panel.errorbar(
                    [factor],
                    [y],
                    xerr=bars,
                    marker=palette.marker(method),
                    linestyle="none",
                    color=palette.ink(method),
                    label=None if method in seen else method,
                )
                seen.add(method)
                y += 1
            centers.append((start + y - 1) / 2)
            y += 0.7
        panel.set_xscale("log")
        panel.axvline(1, color=TEXT, linewidth=1, linestyle="--")
        if len(rows) == 1:  # Each line names its method; no legend needed.
            panel.set_yticks(range(len(methods)), methods)
        else:
            panel.set_yticks(centers, [scene for scene, _ in rows])
        panel.tick_params(axis="y", length=0)
        panel.invert_yaxis()
        panel.grid(axis="y", visible=False)
        low, high = panel.get_xlim()
        panel.set_xlim(min(low, 0.5), max(high, 2))
        _log_axis(panel.xaxis, *panel.get_xlim())
        panel.set_xlabel(f"time for equal error, {baseline} = 1 (further right: slower)")
        if len(rows) > 1:
            figure.legend(loc="upper left", bbox_to_anchor=(0.92, 0.9))
        return _svg(
            figure,
            palette,
            "Time for equal error by scene and method; the numbers are in the table",
        )


def hit_rates(rows, palette):
    """rows: [(variant, rate, stderr)]."""
    with pyplot.rc_context(STYLE):
        figure, panel = pyplot.subplots(figsize=(5.6, 0.9 + 0.34 * len(rows)))
        for y, (name, rate, error) in enumerate(rows):
            panel.barh(
                y,
                100 * rate,
                height=0.62,
                color=palette.ink(name),
                alpha=0.85,
                xerr=100 * (error or 0),
                ecolor=TEXT,
            )
            panel.annotate(
                f"{100 * rate:.1f} %",
                (100 * (rate + (error or 0)), y),
                (6, 0),
                textcoords="offset points",
                va="center",
            )
        panel.set_yticks(range(len(rows)), [name for name, _, _ in rows])
        panel.tick_params(axis="y", length=0)
        panel.set_xlim(0, 118)  # Room for the figure beside a full bar.
        panel.set_xticks(range(0, 101, 20))
        panel.invert_yaxis()
        panel.grid(axis="y", visible=False)
        panel.set_xlabel("descents that end on a silhouette, %")
        return _svg(figure, palette, "Hit rates by variant; the numbers are in the table")


def false_accepts_by_depth(variants, palette):
    """Share of accepted nodes without a silhouette, and of nodes tested that were accepted."""
    with pyplot.rc_context(STYLE):
        figure, panels = pyplot.subplots(1, 2, figsize=(10.4, 3.6), sharex=True)
        for variant in variants:
            name = variant.text("name")
            rows = [
                (
                    d.number("depth"),
                    d.number("nodes_tested"),
                    d.number("accepted"),
                    d.number("false_accepts"),
                )
                for d in variant.records("by_depth")
            ]
            style = {"color": palette.ink(name), "marker": palette.marker(name), "label": name}
            wrong = [(depth, 100 * f / a) for depth, _, a, f in rows if a]
            taken = [(depth, 100 * a / n) for depth, n, a, _ in rows if n]
            for panel, points in zip(panels, (wrong, taken)):
                if points:
                    panel.plot(*zip(*points), **style)
        for panel, title in zip(
            panels,
            ("accepted nodes that hold no silhouette, %", "tested nodes that were accepted, %"),
        ):
            panel.set_title(title, loc="left")
            panel.set_xlabel("depth in the tree")
            panel.set_ylim(bottom=0)
            panel.xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(integer=True))
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.99, 0.9))
        figure.tight_layout()
        return _svg(figure, palette, "False accepts by depth; the numbers are in the table")


def loss_over_steps(rows, palette):
    """rows: (step, loss, its standard error); losses below zero are noise, and are left out."""
    with pyplot.rc_context(STYLE):
        figure, panel = pyplot.subplots(figsize=(7.2, 3.0))
        shown = [(s, v, e) for s, v, e in rows if v is not None and v > 0]
        if shown:
            steps, losses, errors = zip(*shown)
            ink = palette.ink("fit")
            low = [max(v - e, 0.05 * v) for v, e in zip(losses, errors)]
            high = [v + e for v, e in zip(losses, errors)]
            panel.fill_between(steps, low, high, color=ink, alpha=0.25, linewidth=0)
            panel.plot(steps, losses, color=ink)
            panel.set_yscale("log")
            _log_axis(panel.yaxis, min(losses), max(1.01 * min(losses), *high))
        panel.set_xlabel("step")
        panel.set_ylabel("loss")
        return _svg(figure, palette, f"loss over {len(rows)} steps, with its standard error")


def distance_over_steps(shapes, palette):
    """shapes: name to rows (step, chamfer over diagonal, mean angle of normals in degrees)."""
    with pyplot.rc_context(STYLE):
        figure, panels = pyplot.subplots(1, 2, figsize=(9.6, 3.0))
        for panel, column, title in zip(
            panels, (1, 2), ("chamfer distance / diagonal", "angle of normals [degrees]")
        ):
            for (name, rows), line in zip(shapes.items(), itertools.cycle(["-", "--", ":", "-."])):
                panel.plot(
                    [r[0] for r in rows],
                    [r[column] for r in rows],
                    color=palette.ink("fit"),
                    linestyle=line,
                    marker="o",
                    label=name,
                )
            panel.set_ylim(bottom=0)
            panel.set_xlabel("step")
            panel.set_title(title)
        if len(shapes) > 1:
            panels[0].legend()
        figure.tight_layout()
        return _svg(figure, palette, "distance to the true shape over steps")
