"""What several folders say together: who wins where and by how much."""

import math

from . import charts
from .comparison import finished, implausible, longest, scene_name, time_ratios
from .markup import element, hint, join, percent, table, times, with_error

BASELINE = "forest"


def relative_times(data):
    """{method: (factor, stderr)} of time for equal error and the method they refer to: the forest
    where it was run, else the first. Errors of the two ratios are taken as independent."""
    ratios, methods = time_ratios(data), data.records("methods")
    first = methods[0].text("name") if methods else ""
    base, base_error = ratios.get(BASELINE, (None, 0.0))
    if base is None or first == BASELINE:
        return ratios, first
    relative = {name: (value / base, value / base * math.hypot(error / value, base_error / base))
                for name, (value, error) in ratios.items()}
    return {**relative, BASELINE: (1.0, 0.0)}, BASELINE


def _bad(text, title=None):
    return element("span", text, class_="bad", title=title)


def _by_name(data, key):
    return {record.text("name"): record for record in data.records(key)}


class Overview:
    """sections: of the page; threshold as in page.py."""

    def __init__(self, sections, palette, threshold):
        self.sections, self.palette, self.threshold = sections, palette, threshold
        self.comparisons = self._of_kind("compare")

    def _of_kind(self, kind):
        return [s for s in self.sections if s.data.text("kind") == kind]

    def html(self):
        parts = [element("h2", "Overview")]
        if self.comparisons:
            parts += [element("h3", "Time for equal error"), self._chart(), self._times(),
                      element("h3", "Slopes"), self._slopes()]
        if self._of_kind("reject"):
            parts += [element("h3", "Acceptance rates"), self._acceptance()]
        return element("section", *parts, id="overview")

    def _matrix(self, kind, key, head, label, cell):
        """A row per section, a column per method; cell(section, method or None)."""
        sections = self._of_kind(kind)
        names = list(dict.fromkeys(n for s in sections for n in _by_name(s.data, key)))
        rows = [[self._link(s), *(cell(s, _by_name(s.data, key).get(n)) for n in names)]
                for s in sections]
        return table([head, *names], rows, label)

    def _link(self, section):
        data, text, note = section.data, section.title, None
        if section in self.comparisons:
            text = f"{scene_name(data)}, {data.text('parameter')}"
            baseline = relative_times(data)[1]
            note = None if baseline == BASELINE else f" (against {baseline})"
        return join(element("a", text, href=f"#{section.group}"), note)

    def _chart(self):
        rows, baselines = [], set()
        for section in self.comparisons:
            data = section.data
            ratios, baseline = relative_times(data)
            if ratios:
                rows.append((f"{scene_name(data)}, {data.text('parameter')}",
                             [(m, *ratio) for m, ratio in ratios.items()]))
                baselines.add(baseline)
        return charts.factors(self.palette, rows, " or ".join(sorted(baselines))) if rows else None

    def _times(self):
        note = hint("× 5 means: needs five times the time for the same mean squared error. Shaded:"
                    " the best of its line. ⚠ biased: differs from the reference by more than"
                    " chance explains, so its error will not go on falling. ✕: no figure, for the"
                    " reason given. –: not run.")
        return join(self._matrix("compare", "methods", "scene, parameter",
                                 f"Time for equal error, {BASELINE} = 1", self._time), note)

    def _time(self, section, method):
        if method is None:
            return element("td", "–", class_="muted")
        ratios, status = relative_times(section.data)[0], method.text("status")
        if not finished(method):
            return element("td", f"✕ {status}", class_="bad", title=method.text("message", ""))
        ratio = ratios.get(method.text("name"))
        marks = [_bad(" ⚠ biased") if implausible(longest(method), self.threshold) else None,
                 _bad(" interrupted", method.text("message", "")) if status == "interrupted"
                 else None]
        if ratio and ratio == min(ratios.values()):
            return element("td", element("strong", times(*ratio)), *marks, class_="best")
        return element("td", times(*ratio) if ratio else "✕ undefined", *marks)

    def _slopes(self):
        note = hint("Of log error over log time, ± one standard error. −1: the error falls as one"
                    " over time, as an unbiased method's does. ⚠ flatter, by more than three"
                    " standard errors: held up by bias, or by rare large errors. Steeper: set-up"
                    " took much of the short times.")
        return join(self._matrix("compare", "methods", "scene, parameter",
                                 "Slopes of error against time", self._slope), note)

    def _slope(self, _, method):
        slope = method.record_or_none("slope") if method is not None else None
        if slope is None or slope.number("value") is None:
            return "–"
        value, error = slope.number("value"), slope.number("stderr")
        return element("td", with_error(value, error),
                       _bad(" ⚠ flatter") if error and value + 1 > 3 * error else None)

    def _acceptance(self):
        return self._matrix(
            "reject", "variants", "mesh", "Descents that end on a silhouette",
            lambda _, v: percent(v.number("hit_rate"), v.number("hit_rate_stderr")) if v else "–")
