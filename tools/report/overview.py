"""What several folders say together: who wins where and by how much."""

import math

from . import charts
from .comparison import finished, implausible, last_summary, scene_name
from .markup import element, join, percent, table, times, with_error

BASELINE = "forest"


def relative_times(data):
    """{method: (factor, stderr)} of time for equal error and the method they refer to: the forest
    where it was run, else the first. Errors of the two ratios are taken as independent.
    """
    methods = [m for m in data.records("methods") if finished(m)]
    ratios = {
        m.text("name"): (m.number("time_ratio"), m.number("time_ratio_stderr") or 0.0)
        for m in methods
    }
    ratios = {
        name: ratio for name, ratio in ratios.items() if ratio[0] is not None and ratio[0] > 0
    }
    first = data.records("methods")[0].text("name") if data.records("methods") else ""
    base, base_error = ratios.get(BASELINE, (None, 0.0))
    if base is None or first == BASELINE:
        return ratios, first

    def over_base(name, value, error):
        if name == BASELINE:
            return 1.0, 0.0
        relative = math.hypot(error / value, base_error / base)
        return value / base, value / base * relative

    return {name: over_base(name, *ratio) for name, ratio in ratios.items()}, BASELINE


class Overview:
    """comparisons, rejections: [(result, id of its section, title)]; threshold as in page.py."""

    def __init__(self, comparisons, rejections, palette, threshold):
        self.comparisons, self.rejections = comparisons, rejections
        self.palette, self.threshold = palette, threshold

    def html(self):
        parts = [element("h2", "Overview")]
        if self.comparisons:
            parts += [
                element("h3", "Time for equal error"),
                self._chart(),
                self._times(),
                element("h3", "Slopes"),
                self._slopes(),
            ]
        if self.rejections:
            parts += [element("h3", "Hit rates"), self._hits()]
        return element("section", *parts, id="overview")

    def _link(self, identifier, text):
        return element("a", text, href=f"#{identifier}")

    def _label(self, data):
        return f"{scene_name(data)}, {data.text('parameter')}"

    def _methods(self):
        return list(
            dict.fromkeys(
                m.text("name")
                for result, _, _ in self.comparisons
                for m in result.data.records("methods")
            )
        )

    def _chart(self):
        rows, baselines = [], set()
        for result, _, _ in self.comparisons:
            ratios, baseline = relative_times(result.data)
            if ratios:
                rows.append(
                    (self._label(result.data), [(m, *ratio) for m, ratio in ratios.items()])
                )
                baselines.add(baseline)
        return charts.factors(rows, " or ".join(sorted(baselines)), self.palette) if rows else None

    def _times(self):
        methods = self._methods()
        rows = []
        for result, identifier, _ in self.comparisons:
            ratios, baseline = relative_times(result.data)
            label = join(
                self._link(identifier, self._label(result.data)),
                None if baseline == BASELINE else f" (against {baseline})",
            )
            best = min(ratios, key=lambda m: ratios[m][0]) if ratios else None
            by_name = {m.text("name"): m for m in result.data.records("methods")}
            rows.append(
                [
                    label,
                    *(self._time_cell(by_name.get(m), ratios.get(m), m == best) for m in methods),
                ]
            )
        note = element(
            "p",
            "× 5 means: needs five times the time for the same mean squared error. Shaded: the best"
            " of its line. ⚠ biased: differs from the reference by more than chance explains, so"
            " its error will not go on falling. ✕: no figure, for the reason given. –: not run.",
            class_="hint",
        )
        return join(
            table(["scene, parameter", *methods], rows, f"Time for equal error, {BASELINE} = 1"),
            note,
        )

    def _time_cell(self, method, ratio, best):
        if method is None:
            return element("td", "–", class_="muted")
        status = method.text("status")
        if status == "missing" or not finished(method):
            return element("td", f"✕ {status}", class_="bad", title=method.text("message", ""))
        marks = []
        if implausible(last_summary(method), self.threshold):
            marks.append(element("span", " ⚠ biased", class_="bad"))
        if status == "interrupted":
            marks.append(
                element("span", " interrupted", class_="bad", title=method.text("message", ""))
            )
        text = times(*ratio) if ratio else "✕ undefined"
        if best and ratio:
            return element("td", element("strong", text), *marks, class_="best")
        return element("td", text, *marks)

    def _slopes(self):
        methods = self._methods()
        rows = []
        for result, identifier, _ in self.comparisons:
            by_name = {m.text("name"): m for m in result.data.records("methods")}
            cells = [self._slope_cell(by_name.get(m)) for m in methods]
            rows.append([self._link(identifier, self._label(result.data)), *cells])
        note = element(
            "p",
            "Of log error over log time, ± one standard error. −1: the error falls as one over"
            " time, as an unbiased method's does. ⚠ flatter, by more than three standard errors:"
            " held up by bias, or by rare large errors. Steeper: set-up took much of the short"
            " times.",
            class_="hint",
        )
        return join(
            table(["scene, parameter", *methods], rows, "Slopes of error against time"), note
        )

    def _slope_cell(self, method):
        slope = method.record_or_none("slope") if method is not None else None
        if slope is None or slope.number("value") is None:
            return "–"
        value, error = slope.number("value"), slope.number("stderr")
        flat = error and value + 1 > 3 * error
        return element(
            "td",
            with_error(value, error),
            element("span", " ⚠ flatter", class_="bad") if flat else None,
        )

    def _hits(self):
        variants = list(
            dict.fromkeys(
                v.text("name")
                for result, _, _ in self.rejections
                for v in result.data.records("variants")
            )
        )
        rows = []
        for result, identifier, title in self.rejections:
            by_name = {v.text("name"): v for v in result.data.records("variants")}
            cells = []
            for name in variants:
                v = by_name.get(name)
                cells.append(
                    percent(v.number("hit_rate"), v.number("hit_rate_stderr")) if v else "–"
                )
            rows.append([self._link(identifier, title), *cells])
        return table(["mesh", *variants], rows, "Descents that end on a silhouette")
