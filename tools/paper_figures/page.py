"""The page "the paper's figures": for each what the paper shows, what its method does here, what
limn's default does, and the command that repeats it."""

import math
import os
import shlex

from report.errors import ReportError
from report.markup import (
    Markup,
    count,
    document,
    element,
    figures,
    join,
    percent,
    table,
    times,
    with_error,
)
from report.pictures import Pictures, figure
from report.records import read_folder, read_record

from . import bias_chart
from .figures import DEFAULT, PAPER

# A page of unbiased methods marks one of them in one of a hundred pages.
FALSE_ALARM = 0.01
STYLE = """
.paper { border-left: 4px solid var(--line); padding-left: 14px; max-width: 88ch; }
.role { display: block; font-size: 12.5px; color: var(--soft); font-weight: 400; }
.wins { background: var(--best); }
td.verdict { white-space: normal; max-width: 52ch; }
.surface { max-width: 460px; }
.surface .picture, .surface .picture img { image-rendering: auto; }
"""


def _style():
    file = os.path.join(os.path.dirname(os.path.dirname(__file__)), "report", "style.css")
    with open(file, encoding="utf-8") as stream:
        rules = stream.read()
    return Markup(rules.replace("/*light*/", "").replace("/*dark*/", "") + STYLE)


def _role(name):
    roles = {PAPER: "the paper's forest", DEFAULT: "limn's default", "mitsuba": "Zhang et al. 2023"}
    return roles.get(name, "")


def _head(name):
    """Of a card; all are of one height."""
    return element("h4", name, element("span", _role(name) or "\u00a0", class_="role"))


def _words(text):
    """`name` as code."""
    pieces = text.split("`")
    return join(*(element("code", t) if i % 2 else t for i, t in enumerate(pieces)))


def _command(text):
    return element("pre", element("code", text), class_="command")


def _last(method):
    rungs = method.records("summary") if method.text("status") != "missing" else []
    return rungs[-1] if rungs else None


class _Comparison:
    """One compare.json. level: a bias is marked where its p is below."""

    def __init__(self, result, part, kind, level):
        self.data, self.part, self.kind, self.level = result.data, part, kind, level
        self.pictures = Pictures(result.folder)
        self.methods = self.data.records("methods")
        self.rungs = {m.text("name"): _last(m) for m in self.methods}

    def _time(self, name):
        method = next(m for m in self.methods if m.text("name") == name)
        return method.number("time_ratio"), method.number("time_ratio_stderr")

    def _per_sample(self, name):
        """Squared error after equal samples, the paper's method being 1."""
        rung, base = self.rungs[name], self.rungs.get(PAPER)
        if not rung or not base or not base.number("mse"):
            return None
        share = rung.number("mse") * rung.number("spp") / (base.number("mse") * base.number("spp"))
        return share

    def factor(self):
        """Time that the paper's method needs for the error of limn's default."""
        mine, paper = (self._time(n)[0] if self.rungs.get(n) else None for n in (DEFAULT, PAPER))
        return paper / mine if mine and paper else None

    def best(self):
        """The methods with the least time for equal error, but for two standard errors of the
        logarithm of their quotient. The best comes first.
        """
        times_of = {n: self._time(n) for n, rung in self.rungs.items() if rung and self._time(n)[0]}
        ranking = sorted(times_of, key=lambda n: times_of[n][0])
        if not ranking:
            return []
        spread = {n: (error or 0) / ratio for n, (ratio, error) in times_of.items()}

        def is_equal(name):
            quotient = times_of[name][0] / times_of[ranking[0]][0]
            return math.log(quotient) <= 2 * math.hypot(spread[name], spread[ranking[0]])

        return [n for n in ranking if is_equal(n)]

    def is_short(self):
        """Whether some method spent most of its time on its set-up."""
        return any(r.number("setup_seconds") > 0.5 * r.number("seconds")
                   for r in self.rungs.values() if r)

    def html(self):
        shown = [
            figure(self.pictures.picture("image.png", "the scene"), "the scene"),
            figure(self.pictures.picture("reference.png", "reference"), "derivative, reference"),
        ]
        cards = [element("div", _head("scene"), *shown, class_="card")]
        cards += [self._card(m) for m in self.methods if self.rungs[m.text("name")]]
        return join(
            element("h3", self._title()),
            element("div", element("div", *cards, class_="cards"), class_="gallery"),
            self._short() if self.is_short() else None,
            self._table(),
            _command(self.data.text("command")),
        )

    def _short(self):
        words = "Most of the time went into set-up, which decides here: more --minutes tell more."
        return element("p", words, class_="notice")

    def _title(self):
        defines = {
            k: v for k, v in self.data.record("defines").items() if k not in ("width", "height")
        }
        words = [os.path.splitext(os.path.basename(self.data.text("scene")))[0]]
        words += [f"{k} {os.path.splitext(os.path.basename(str(v)))[0] if k == 'mesh' else v}"
                  for k, v in defines.items() if k != "format"]
        options = self.part.options
        words += [f"{options[i][2:]} {options[i + 1]}" for i in range(0, len(options), 2)]
        return ", ".join(words)

    def _card(self, method):
        name = method.text("name")
        rung = self.rungs[name]
        return element(
            "div",
            _head(name),
            figure(
                self.pictures.picture(method.text("picture"), f"derivative by {name}"),
                f"{figures(rung.number('seconds'))} s, {count(rung.number('spp'))} samples a pixel",
            ),
            figure(
                self.pictures.picture(method.text("error_picture"), f"error of {name}"),
                f"error, mse {figures(rung.number('mse'))}",
            ),
            class_="card",
        )

    def _table(self):
        samples = self.kind == "samples"
        head = ["method", "squared error"] + (["after equal samples"] if samples else [])
        head += ["time for equal error", "set-up, s", "all, s", "bias"]
        best = self.best()
        rows = []
        for method in self.methods:
            name = method.text("name")
            rung = self.rungs[name]
            if not rung:
                why = f"{method.text('status')}: {method.text('message', '') or 'no run finished'}"
                rows.append([name, element("td", why, colspan=len(head) - 1)])
                continue
            row = [
                join(name, element("span", _role(name), class_="role")),
                with_error(rung.number("mse"), rung.number("mse_stderr")),
            ]
            if samples:
                row.append(times(self._per_sample(name)))
            ratio, error = self._time(name)
            wins = "wins" if name in best else None
            row.append(element("td", times(ratio, error), class_=wins))
            row += [figures(rung.number("setup_seconds")), figures(rung.number("seconds"))]
            row.append(self._bias(rung))
            rows.append(row)
        return table(head, rows, f"Methods, {self._title()}")

    def _bias(self, rung):
        bias = rung.record_or_none("bias")
        if bias is None or bias.number("p") is None:
            return "–"
        text = f"p {figures(bias.number('p'), 2)}"
        return element("td", "⚠ ", text, class_="bad") if bias.number("p") < self.level else text


class _Rejection:
    def __init__(self, result):
        self.data, self.pictures = result.data, Pictures(result.folder)

    def _chart(self):
        """The bounding quadrics, where there are any and a Python drew them."""
        chart = self.data.record_or_none("chart") if "chart" in self.data.values else None
        if not chart:
            return []
        if self.pictures.uri("chart.png") is None:
            return [element("p", "The surface plot of the quadrics needs matplotlib.", class_="hint")]
        words = (
            "the quadrics (blue, orange) that bound the planes of the node's edges (black"
            f" segments), in the coordinates of the dual box; {chart.text('method')}"
        )
        picture = self.pictures.picture("chart.png", "bounding quadrics")
        return [element("div", figure(picture, words), class_="surface")]

    def verdict(self):
        """Draws that end on an edge: limn's default, and the paper's."""
        hits = {v.text("name"): v.number("hit_rate") for v in self.data.records("variants")}
        mesh = os.path.basename(self.data.text("mesh")).split("_")[0]
        shown = [f"{name} {percent(hits[name])}" for name in ("forest", PAPER) if name in hits]
        return f"{mesh}: hits of {' and '.join(shown)}"

    def html(self):
        node = self.data.record("node")
        mesh = os.path.splitext(os.path.basename(self.data.text("mesh")))[0]
        overview = figure(
            self.pictures.picture(self.data.text("overview"), "the mesh, the node, the slices"),
            "mesh, node, slices",
        )
        cards = [element("div", _head("patch"), overview, class_="card")]
        rows = []
        for v in self.data.records("variants"):
            name = v.text("name")
            shown, shares = [], []
            for i, s in enumerate(v.records("slices")):
                wrong, right = s.number("false_accept"), s.number("true_reject")
                shares.append(wrong / (wrong + right) if wrong + right else None)
                shown.append(
                    figure(
                        self.pictures.picture(s.text("picture"), f"slice {i + 1} of {name}"),
                        f"slice {i + 1}: {percent(shares[-1])} of what could be rejected is not",
                    )
                )
            edges = f"{count(v.number('reachable_edges'))} edges reached from one point"
            shown.append(figure(self.pictures.picture(v.text("edges_picture"), edges), edges))
            cards.append(element("div", _head(name), *shown, class_="card"))
            rows.append(
                [
                    name,
                    *map(percent, shares),
                    count(v.number("reachable_edges")),
                    count(v.number("silhouettes")),
                    percent(v.number("hit_rate"), v.number("hit_rate_stderr")),
                ]
            )
        head = ["test", "slice 1 in vain", "slice 2 in vain", "edges reached", "silhouettes",
                "hit rate"]
        return join(
            element(
                "h3",
                f"{mesh}: {count(self.data.number('edges'))} edges,"
                f" {count(node.number('edges'))} of them in the node",
            ),
            element("div", element("div", *cards, class_="cards"), class_="gallery"),
            *self._chart(),
            table(head, rows, f"Rejection, {mesh}"),
            _command(self.data.text("command")),
        )


def _edges(parts, folder):
    """A table and what it says; None where nothing was counted."""
    rows, shares = [], []
    for part in parts:
        file = os.path.join(folder(part), "edges.json")
        if part.kind != "edges" or not os.path.exists(file):
            continue
        record = read_record(file)
        all_edges, without = record.number("edges"), record.number("without_concave")
        name = os.path.basename(record.text("mesh"))
        shares.append(without / all_edges)
        rows.append([name, f"{all_edges:,}", f"{without:,}", percent(shares[-1])])
    head = ["mesh", "edges", "without concave ones", "share"]
    if not rows:
        return None
    words = f"{percent(min(shares))} to {percent(max(shares))} are not concave"
    return table(head, rows, "Edges with and without concave ones"), words


def _draws(part, folder):
    """A table and what it says; None where nothing was measured."""
    file = os.path.join(folder(part), "draws.json")
    if part.kind != "draws" or not os.path.exists(file):
        return None
    record = read_record(file)
    ray = record.number("ray_ns")
    rows, rays = [], {}
    for row in record.records("rows"):
        name = row.text("name")
        rays[name] = row.number("draw_ns") / ray
        rows.append(
            [
                join(name, element("span", _role(name), class_="role")),
                figures(row.number("draw_ns")),
                figures(rays[name]),
                percent(row.number("hit_rate")),
                figures(row.number("efficiency")),
                figures(row.number("build_ms") / 1000),
                figures(row.number("bytes_per_edge")),
            ]
        )
    head = ["sampler", "draw, ns", "draw, rays", "hit rate", "efficiency", "build, s", "bytes per edge"]
    title = f"{count(record.number('edges'))} edges; a ray takes {figures(ray)} ns"
    shown = [f"{name} {figures(rays[name])}" for name in (PAPER, "forest") if name in rays]
    html = join(element("h3", title), table(head, rows, "Draws"), _command(record.text("command")))
    return html, f"rays a draw, {count(record.number('edges'))} edges: {', '.join(shown)}"


def _sections(paper_figures, folder, command):
    """(id, entry, html, factors, verdicts) of every figure; how many have no results."""
    missing = 0
    results = {}
    for entry in paper_figures:
        for part in entry.runs:
            try:
                if part.kind in ("compare", "reject"):
                    results[part.name] = read_folder(folder(part))[0]
            except ReportError:
                pass
    tests = sum(
        1
        for r in results.values()
        if r.kind == "compare"
        for m in r.data.records("methods")
        if _last(m) and (_last(m).record_or_none("bias") or None)
    )
    level = FALSE_ALARM / max(1, tests)
    sections = []
    for i, entry in enumerate(paper_figures):
        parts, factors, verdicts = [], [], []
        for part in entry.runs:
            drawn = _draws(part, folder)
            if drawn:
                parts.append(drawn[0])
                verdicts.append(drawn[1])
            result = results.get(part.name)
            if result is None:
                continue
            if result.kind == "reject":
                rejection = _Rejection(result)
                parts.append(rejection.html())
                verdicts.append(rejection.verdict())
                continue
            comparison = _Comparison(result, part, entry.table, level)
            parts.append(comparison.html())
            if comparison.factor():
                factors.append(comparison.factor())
            verdicts.append(" or ".join(comparison.best()) or "–")
        parts += filter(None, [bias_chart.html(entry.runs, folder)])
        counted = _edges(entry.runs, folder)
        if counted:
            parts.append(counted[0])
            verdicts.append(counted[1])
        if not parts:
            missing += 1
            parts = [element("p", "No results here yet.", class_="hint")]
        again = shlex.join([*command, "--only", ",".join(p.name for p in entry.runs)])
        html = element(
            "section",
            element("h2", f"{entry.numbers}: {entry.title}"),
            element("p", element("strong", "The paper: "), _words(entry.shows), class_="paper"),
            element("p", element("strong", "Here: "), _words(entry.reading), class_="paper"),
            *parts,
            element("p", "All of it again:"),
            _command(again),
            id=f"figure-{i}",
        )
        sections.append((f"figure-{i}", entry, html, factors, verdicts))
    return sections, missing


def _joined(verdicts):
    """Each once, and how often where that is not at once."""
    if len(verdicts) < 2:
        return "".join(verdicts)
    often = {v: verdicts.count(v) for v in verdicts}
    return ", ".join(f"{v} ({n} of {len(verdicts)})" if max(often.values()) > 1 else v
                     for v, n in often.items())


def _summary(sections):
    rows = []
    for identifier, entry, _, factors, verdicts in sections:
        link = element("a", f"{entry.numbers}: {entry.title}", href=f"#{identifier}")
        text = " to ".join(times(f) for f in sorted({min(factors), max(factors)})) if factors else "–"
        rows.append([link, text, element("td", _joined(verdicts) or "–", class_="verdict")])
    head = ["figure", f"time of {PAPER} for the error of {DEFAULT}",
            "least time for equal error, or what was counted"]
    return table(head, rows, "Who is right, by figure")


def write(file, paper_figures, folder, again):
    """folder(part): where a part's results lie. again: the command, but for --only. Returns how many
    figures have no results."""
    sections, missing = _sections(paper_figures, folder, again)
    title = "The paper's figures"
    intro = (
        "Soroka, Peters and Marschner 2025, Quadric-Based Silhouette Sampling for Differentiable"
        f" Rendering (doi 10.1145/3731146). {PAPER}: the paper's forest, complete; {DEFAULT}:"
        " limn's default. Derivatives: red gets brighter, blue darker; methods of one comparison"
        " have the same time, set-up included, and one scale."
    )
    page = document(
        title,
        _style(),
        element("header", element("h1", title), element("p", intro), _summary(sections)),
        element("main", *(html for _, _, html, _, _ in sections)),
    )
    with open(file, "w", encoding="utf-8") as out:
        out.write(page)
    return missing
