"""The page "the paper's figures": for each what the paper shows, what its method does here, what
limn's default does, and the command that repeats it."""

import math
import os
import shlex

import numpy as np
from report import charts
from report.colours import Palette
from report.comparison import (BIAS, EQUAL_ERROR, ERRORS, SECONDS, ComparisonSection, finished,
                               longest, time_ratios)
from report.fitting import FitSection
from report.markup import (Markup, command, count, document, element, figures, hint, join, notice,
                           percent, table, times)
from report.page import bias_threshold, palette_of
from report.pictures import Pictures
from report.records import ReportError, read_folder, read_record
from report.rejection import RejectionSection
from report.section import stem

from .parts import DEFAULT, FOREST, MITSUBA, PAPER, WARPED

ROLES = {PAPER: "the paper's forest", DEFAULT: "limn's default", MITSUBA: "Zhang et al. 2023"}
STYLE = Markup("""
.paper { border-left: 4px solid var(--line); padding-left: 14px; max-width: 88ch; }
.role { display: block; font-size: 12.5px; color: var(--soft); font-weight: 400; }
h4 .role { min-height: 1.5em; }
.surface { max-width: 460px; }
.surface .picture, .surface .picture img { image-rendering: auto; }
""")
GRID = 81  # points along each side of a surface
MOST_WEDGES = 600  # More are a blot.


def _words(text):
    """`name` as code."""
    pieces = text.split("`")
    return join(*(element("code", t) if i % 2 else t for i, t in enumerate(pieces)))


# Each of the following: markup and what it says in the summary, of one part of a figure.


def _comparison(result, part, kind, group, palette, threshold):
    """kind: Figure.table."""
    section = ComparisonSection(result, group, palette, threshold, ROLES)
    ratios, best = time_ratios(result.data), _best(time_ratios(result.data))
    base = next((longest(m) for m in section.methods if m.text("name") == PAPER and finished(m)),
                None)

    def time(_, method, summary):
        return element("td", EQUAL_ERROR["time for equal error"](section, method, summary),
                       class_="best" if method.text("name") in best else None)

    def per_sample(_, method, summary):
        if base is None or not base.number("mse"):
            return "–"
        return times(summary.number("mse") * summary.number("spp")
                     / (base.number("mse") * base.number("spp")))

    columns = {"mean squared error": ERRORS["mean squared error"],
               **({"after equal samples": per_sample} if kind == "samples" else {}),
               "time for equal error": time, **SECONDS, **BIAS}
    short = any(longest(m).number("setup_seconds") > 0.5 * longest(m).number("seconds")
                for m in section.methods if finished(m))
    options = [f"{name[2:]} {value}" for name, value in zip(part.options[::2], part.options[1::2])]
    html = join(
        element("h3", ", ".join([section.title, *options])), section.pictures_of_methods(),
        notice("", "Most of the time went into set-up, which decides here: more --minutes tell"
               " more.") if short else None,
        section.method_table(columns, "Methods"), section.command())
    factor = (ratios[PAPER][0] / ratios[DEFAULT][0] if PAPER in ratios and DEFAULT in ratios
              else None)
    return html, " or ".join(best) or "–", factor, section.style


def _best(ratios):
    """The methods with the least time for equal error, but for two standard errors of the logarithm
    of their quotient. The best comes first."""
    ranking = sorted(ratios, key=lambda n: ratios[n][0])
    spread = {n: error / ratio for n, (ratio, error) in ratios.items()}
    return [n for n in ranking if math.log(ratios[n][0] / ratios[ranking[0]][0])
            <= 2 * math.hypot(spread[n], spread[ranking[0]])]


def _fit(result, group, palette):
    """The pictures of a fit, over what it found elsewhere, and how far it is from the truth."""
    section = FitSection(result, group, palette)
    method = section.arguments.text("method")
    steps = [(f"step {s.number('step')}", f"{s.number('step'):05}", s.values["pictures"][0])
             for s in section.snapshots]
    steps.append(("target", "target", section.data.values["targets"][0]))
    cards = [section.card(head, section.figure(picture, head, "the scene"),
                          section.figure(f"elsewhere_{name}.png", f"{head}, elsewhere", "elsewhere"))
             for head, name, picture in steps]
    (step, last), first = section.meshes[-1], section.meshes[0][1]
    rows = [[mesh.text("shape"), count(at), figures(mesh.number("chamfer")),
             figures(mesh.number("hausdorff_95")), f"{figures(mesh.number('normal_angle'))}°"]
            for at, mesh in ((0, first), (step, last))]
    html = join(element("h3", ": ".join([method, *([ROLES[method]] if method in ROLES else [])])), section.gallery(cards, wide=True),
                table(["shape", "steps", "chamfer over diagonal", "Hausdorff 95 %", "normals"], rows,
                      f"Distance to the truth, {method}"))
    return html, f"{method}: chamfer {figures(last.number('chamfer'))}"


def _rejection(result, group, palette):
    section = RejectionSection(result, group, palette, ROLES)
    mesh, node = stem(result.data.text("mesh")), result.data.record("node")
    rates = {v.text("name"): v.number("hit_rate") for v in section.variants}
    shown = [f"{name} {percent(rates[name])}" for name in (FOREST, PAPER) if name in rates]
    html = join(
        element("h3", f"{mesh}: {count(result.data.number('edges'))} edges,"
                f" {count(node.number('edges'))} of them in the node"),
        section.slices(), _surface(result), section.rates(), section.command())
    return html, f"{mesh.split('_')[0]}: accepted by {' and '.join(shown)}"


def _surface(result):
    """The bounding quadrics of the node, where there are any."""
    chart = result.data.record_or_none("chart")
    if chart is None or not chart.values:
        return None
    draw_quadrics(chart.values, os.path.join(result.folder, "chart.png"))
    words = ("the quadrics (blue, orange) that bound the planes of the node's edges (black"
             f" segments), in the coordinates of the dual box; {chart.text('method')}")
    return element("div", Pictures(result.folder).figure("chart.png", "bounding quadrics", words),
                   class_="surface")


def _heights(chart, level, up):
    """u_up of the surface f = level over a grid of the two other axes; NaN outside of the box."""
    i, j = [k for k in range(3) if k != up]
    u, v = np.meshgrid(np.linspace(-1, 1, GRID), np.linspace(-1, 1, GRID), indexing="ij")
    linear, square, product = chart["linear"], chart["square"], chart["product"]
    # product_k belongs to the two axes other than k.
    a = square[up] * np.ones_like(u)
    b = linear[up] + product[j] * u + product[i] * v
    c = (linear[i] * u + square[i] * u * u + linear[j] * v + square[j] * v * v
         + product[up] * u * v - level)
    with np.errstate(all="ignore"):
        # The root that goes over into -c / b where a fades.
        root = np.sqrt(b * b - 4 * a * c)
        w = -2 * c / (b + np.where(b >= 0, root, -root))
    return u, v, np.where(np.abs(w) <= 1, w, np.nan)


def draw_quadrics(chart, file):
    """A PNG of the two surfaces, with the wedges of the node's edges between them."""
    up = max(range(3), key=lambda k: abs(chart["linear"][k]))
    i, j = [k for k in range(3) if k != up]
    figure = charts.pyplot.figure(figsize=(5, 5), dpi=150)
    axes = figure.add_subplot(projection="3d")
    for level, colour in ((chart["low"], "#2f6fb7"), (chart["high"], "#f28e2b")):
        axes.plot_surface(*_heights(chart, level, up), color=colour, alpha=0.35, linewidth=0,
                          rstride=2, cstride=2)
    for a, b in chart["edges"][::max(1, len(chart["edges"]) // MOST_WEDGES)]:
        axes.plot([a[i], b[i]], [a[j], b[j]], [a[up], b[up]], color="#202020", linewidth=0.6)
    for axis, k in (("x", i), ("y", j), ("z", up)):
        axes.set(**{f"{axis}lim": (-1, 1), f"{axis}ticks": [-1, 0, 1], f"{axis}label": f"u{k + 1}"})
    axes.view_init(elev=24, azim=-56)
    figure.savefig(file, bbox_inches="tight", pad_inches=0.4)
    charts.pyplot.close(figure)


def _draws(record):
    ray, edges = record.number("ray_ns"), count(record.number("edges"))
    rows, rays = [], {}
    for row in record.records("rows"):
        name, draw = row.text("name"), row.number("draw_ns")
        rays[name] = figures(draw / ray)
        rows.append([join(name, element("span", ROLES.get(name, ""), class_="role")),
                     figures(draw), rays[name], percent(row.number("hit_rate")),
                     figures(row.number("efficiency")), figures(row.number("build_ms") / 1000),
                     figures(row.number("bytes_per_edge"))])
    head = ["sampler", "draw, ns", "draw, rays", "acceptance rate", "efficiency", "build, s",
            "bytes per edge"]
    html = join(element("h3", f"{edges} edges; a ray takes {figures(ray)} ns"),
                table(head, rows, "Draws"), command(record.text("command")))
    shown = [f"{name} {rays[name]}" for name in (PAPER, FOREST) if name in rays]
    return html, f"rays a draw, {edges} edges: {', '.join(shown)}"


def _budget(record):
    """limn's methods, and every share of the budget that Mitsuba's image had."""
    rows = record.records("rows")
    base = next(r.number("mse") for r in rows if r.text("name") == PAPER)
    least = {name: min(r.number("mse") for r in rows if r.text("name") == name)
             for name in {r.text("name"): 0 for r in rows}}
    shown = [[join(r.text("name"), element("span", ROLES.get(r.text("name"), ""), class_="role")),
              str(r.number("spp")), *([count(r.number("leaves")), str(r.number("trials"))]
                                      if r.number("trials") else ["–", "–"]),
              figures(r.number("mse")),
              element("td", times(r.number("mse") / base),
                      class_="best" if r.number("mse") == min(least.values()) else None)] for r in rows]
    head = ["method", "spp of the image", "leaves", "trials each", "mean squared error",
            f"over {PAPER}"]
    missing = record.text("missing", "")
    html = join(element("h3", f"An equal budget: {count(record.number('spp'))} samples per pixel"),
                notice("", missing) if missing else None, table(head, shown, "Equal budget"))
    words = ", ".join(f"{name} {figures(error)}" for name, error in least.items())
    return html, f"squared error by an equal budget: {words}"


def _edges(records):
    """All meshes of a figure in one table."""
    counts = [(r, r.number("edges"), r.number("without_concave")) for r in records]
    rows = [[os.path.basename(r.text("mesh")), f"{every:,}", f"{without:,}",
             percent(without / every)] for r, every, without in counts]
    shares = [without / every for _, every, without in counts]
    html = table(["mesh", "edges", "without concave ones", "share"], rows,
                 "Edges with and without concave ones")
    return html, f"{percent(min(shares))} to {percent(max(shares))} are not concave"


def _bias(records):
    """The derivative summed over all pixels against that of the first record, whose method has no
    bias: a table, and a chart over the rays of warped-area sampling."""
    first, *others = [(r.text("method"), r.record("settings"), *r.records("parameters"))
                      for r in records]
    truth, truth_error = first[2].number("sum"), first[2].number("sum_stderr")
    rows, points = [[first[0], "–", figures(truth), "–", "–"]], []
    for method, settings, found in others:
        rays, total = int(settings.number("auxiliary rays")), found.number("sum")
        both = math.hypot(found.number("sum_stderr"), truth_error)
        bias, spread = total / truth - 1, both / abs(truth)
        rows.append([method, str(rays), figures(total), f"{100 * bias:.2g} ± {100 * spread:.1g} %",
                     figures((total - truth) / both)])
        if method == WARPED and bias > 0:
            points.append((rays, bias, spread))
    head = ["method", "rays", "derivative, all pixels", "bias", "in standard errors"]
    return join(element("h3", "Bias over rays"),
                element("p", "An area light of two triangles over a plane, moved sideways; bars are"
                        " two standard errors."),
                _bias_over_rays(Palette([WARPED]), points) if len(points) > 1 else None,
                table(head, rows, "Bias of warped-area sampling"))


@charts.chart(6, 3.4)
def _bias_over_rays(figure, panel, palette, points):
    """points: (rays, relative bias above 0, its standard error)."""
    rays, bias, error = zip(*points)
    low, high = [min(2 * e, 0.95 * b) for b, e in zip(bias, error)], [2 * e for e in error]
    panel.errorbar(rays, [100 * b for b in bias], marker="o", color=charts.TEXT,
                   yerr=[[100 * e for e in low], [100 * e for e in high]])
    panel.set_xscale("log", base=2)
    panel.set_yscale("log")
    charts.log_axis(panel.yaxis, *panel.get_ylim())
    panel.set_xticks(rays, [str(r) for r in rays])
    panel.set_xlabel("auxiliary rays")
    panel.set_ylabel(f"bias of {WARPED}, %")
    return "Bias over rays; the numbers are in the table"


class _Page:
    def __init__(self, paper_figures, folder, again):
        self.figures, self.folder, self.again = paper_figures, folder, again
        self.results = {}
        for part in (p for f in paper_figures for p in f.runs if p.kind in ("compare", "reject", "fit")):
            try:
                self.results[part.name] = read_folder(folder(part))[0]
            except ReportError:
                pass
        self.palette = palette_of(self.results.values())
        self.threshold = bias_threshold(self.results.values())
        self.missing, self.styles = 0, []

    def _records(self, entry, kind):
        files = [os.path.join(self.folder(part), kind + ".json") for part in entry.runs
                 if part.kind == kind]
        return [read_record(file) for file in files if os.path.exists(file)]

    def _parts(self, entry, identifier):
        """Markup, verdicts and times of the paper's method over limn's default."""
        parts, verdicts, factors = [], [], []
        for part in entry.runs:
            result, group = self.results.get(part.name), f"{identifier}-{part.name}"
            if result is None:
                continue
            if result.kind in ("reject", "fit"):
                show = _rejection if result.kind == "reject" else _fit
                shown = show(result, group, self.palette)
            else:
                *shown, factor, style = _comparison(result, part, entry.table,
                                                    group.replace(".", "-"), self.palette,
                                                    self.threshold)
                factors += [factor] if factor else []
                self.styles.append(style)
            parts.append(shown[0])
            verdicts.append(shown[1])
        drawn = [_draws(record) for record in self._records(entry, "draws")]
        drawn += [_budget(record) for record in self._records(entry, "budget")]
        counted = self._records(entry, "edges")
        drawn += [_edges(counted)] if counted else []
        warped = self._records(entry, "gradient")
        parts += [html for html, _ in drawn] + ([_bias(warped)] if len(warped) > 1 else [])
        return parts, verdicts + [words for _, words in drawn], factors

    def section(self, entry, identifier):
        """Its markup, and its row of the summary."""
        parts, verdicts, factors = self._parts(entry, identifier)
        self.missing += not parts
        again = shlex.join([*self.again, "--only", ",".join(p.name for p in entry.runs)])
        html = element(
            "section", element("h2", f"{entry.numbers}: {entry.title}"),
            element("p", element("strong", "The paper: "), _words(entry.shows), class_="paper"),
            element("p", element("strong", "Here: "), _words(entry.reading), class_="paper"),
            *parts or [hint("No results here yet.")],
            command(again, "All of it again"), id=identifier)
        link = element("a", f"{entry.numbers}: {entry.title}", href=f"#{identifier}")
        ends = sorted({min(factors), max(factors)}) if factors else []
        ratio = " to ".join(map(times, ends)) or "–"
        return html, [link, ratio, element("td", _joined(verdicts) or "–", class_="words")]


def _joined(verdicts):
    """Each once, and how often where any comes again."""
    often = {v: verdicts.count(v) for v in verdicts}
    if all(n == 1 for n in often.values()):
        return ", ".join(verdicts)
    return ", ".join(f"{v} ({n} of {len(verdicts)})" for v, n in often.items())


def write(file, paper_figures, folder, again):
    """folder(part): where a part's results lie. again: the command, but for --only. Returns how many
    figures have no results."""
    page = _Page(paper_figures, folder, again)
    sections = [page.section(entry, f"figure-{i}") for i, entry in enumerate(paper_figures)]
    intro = element(
        "p", "Soroka, Peters and Marschner 2025, Quadric-Based Silhouette Sampling for"
        f" Differentiable Rendering (doi 10.1145/3731146). {PAPER}: the paper's forest, complete;"
        f" {DEFAULT}: limn's default. Derivatives: red gets brighter, blue darker; methods of one"
        " comparison have the same time, set-up included, and one scale.")
    summary = table(["figure", f"time of {PAPER} for the error of {DEFAULT}",
                     "least time for equal error, or what was counted"],
                    [row for _, row in sections], "Who is right, by figure")
    text = document("The paper's figures", page.palette, join(STYLE, *page.styles),
                    [intro, summary], *(html for html, _ in sections))
    with open(file, "w", encoding="utf-8") as out:
        out.write(text)
    return page.missing
