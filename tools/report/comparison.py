"""The section of one compare.json: pictures, error against time, figures per method."""

import os

from . import charts
from .markup import count, element, figures, join, percent, table, times, with_error
from .pictures import Pictures, colour_bar, figure, flip_style, missing_notice, size_choice

TERMS = ("interior", "camera", "boundary")
SINGULAR = {"scene units": "scene unit", "radians": "radian", "degrees": "degree"}


def scene_name(data):
    """File and parameter, short enough for a heading."""
    name = os.path.splitext(os.path.basename(data.text("scene")))[0]
    shown = [
        f"{k}={os.path.basename(str(v))}"
        for k, v in data.record("defines").items()
        if k not in ("width", "height", "spp")
    ]
    return f"{name} ({', '.join(shown)})" if shown else name


def finished(method):
    return method.text("status") != "missing" and bool(method.records("summary"))


def last_summary(method):
    """The longest rung that the method has."""
    return method.records("summary")[-1]


def biases(data):
    """[(method, p)] at the longest rung of every method that has one."""
    for method in filter(finished, data.records("methods")):
        bias = last_summary(method).record_or_none("bias")
        if bias is not None and bias.number("p") is not None:
            yield method.text("name"), bias.number("p")


def implausible(summary, threshold):
    """Is the difference to the reference more than chance explains?"""
    bias = summary.record_or_none("bias")
    return bias is not None and bias.number("p") is not None and bias.number("p") < threshold


def errors(summary):
    """Cells of the squared error, of the same relative to the image, and of most pixels."""
    names = ("mse", "relative_mse", "trimmed_mse")
    return [with_error(summary.number(n), summary.number(f"{n}_stderr")) for n in names]


class ComparisonSection:
    """group: prefix of ids in the page. threshold: a bias' p below it is implausible, see page.py.
    """

    def __init__(self, result, group, palette, threshold):
        self.data, self.group, self.palette = result.data, group, palette
        self.threshold = threshold
        self.pictures = Pictures(result.folder)
        self.methods = self.data.records("methods")
        self.title = f"{scene_name(self.data)}: {self.data.text('parameter')}"
        self.styles = []

    def html(self):
        parts = [
            element("h2", self.title),
            self._what(),
            self._verdict(),
            *self._statuses(),
            self._gallery(),
            element("h3", "Error against time"),
            self._time_chart(),
            element("h3", "At the longest time"),
            self._table(),
            self._factors(),
            self._all_times(),
            element("h3", "Settings"),
            self._command(),
            self._settings(),
        ]
        parts.insert(3, missing_notice(self.pictures.missing))
        return element("section", *parts, id=self.group)

    def _what(self):
        data, reference = self.data, self.data.record("reference")
        unit = SINGULAR.get(data.text("unit"), data.text("unit"))
        times_text = ", ".join(f"{t:.3g}" for t in data.numbers("times"))
        repeats = data.number("repeats")
        kept = " (kept from an earlier run)" if reference.flag("cached", False) else ""
        return element(
            "p",
            f"The derivative of {os.path.basename(data.text('scene'))} for ",
            element("code", data.text("parameter")),
            f" in radiance per {unit}, {data.number('width')} × {data.number('height')} pixels,"
            f" computed by {len(self.methods)} methods in {times_text} s each on"
            f" {data.number('threads')} threads, {repeats}"
            f" {'repeat' if repeats == 1 else 'repeats'}. Reference: {reference.text('method')},"
            f" {count(reference.number('spp'))} samples per pixel,"
            f" {figures(reference.number('seconds'))} s{kept}; its own mean squared error is"
            f" {figures(reference.number('mean_squared_error'))}.",
        )

    def _verdict(self):
        """Who needs the least time for equal error, and how much more the others need."""
        ratios = {
            m.text("name"): (m.number("time_ratio"), m.number("time_ratio_stderr"))
            for m in self.methods
            if finished(m) and (m.number("time_ratio") or 0) > 0
        }
        if len(ratios) < 2:
            return None
        order = sorted(ratios, key=lambda name: ratios[name][0])
        first = self.methods[0].text("name")
        others = ", ".join(f"{name} {times(*ratios[name])}" for name in order if name != first)
        return element(
            "p",
            element("strong", f"Least time for equal error: {order[0]}. "),
            f"Time that the others need, {first} = 1: {others}.",
        )

    def _statuses(self):
        for method in self.methods:
            status = method.text("status")
            if status != "done":
                text = method.text("message", "") or "no reason given"
                yield element(
                    "div",
                    element("strong", f"{method.text('name')}: {status}. "),
                    text,
                    class_="notice",
                )

    def _gallery(self):
        """The reference's card first, then one per method, the same two rows in each."""
        data, reference = self.data, self.data.record("reference")
        behind = f"{self.group}-reference"
        self.styles.append(flip_style(behind, self.pictures.uri(reference.text("picture"))))
        unit = f"radiance per {SINGULAR.get(data.text('unit'), data.text('unit'))}"
        plain = (
            figure(
                self.pictures.picture(data.text("image"), f"plain rendering of {self.title}"),
                "the picture itself",
            )
            if data.text("image")
            else None
        )
        cards = [
            element(
                "div",
                element("h4", "reference"),
                figure(
                    self.pictures.picture(
                        reference.text("picture"), f"reference derivative of {self.title}"
                    ),
                    f"{reference.text('method')}, {count(reference.number('spp'))} spp",
                ),
                plain,
                class_="card",
            )
        ]
        cards += [self._card(m, behind) for m in self.methods if m.text("picture")]
        bars = element(
            "div",
            colour_bar(data.number("scale"), unit, "Derivative"),
            colour_bar(data.number("error_scale"), unit, "Error: method − reference"),
            class_="bars",
        )
        hint = element(
            "p",
            "Upper row: the derivative; lower row: its difference to the reference, longest "
            "time, first repeat. Point at a derivative to see the reference in its place.",
            class_="hint",
        )
        return element(
            "div",
            size_choice(self.group),
            bars,
            hint,
            element("div", *cards, class_="cards"),
            class_="gallery",
        )

    def _card(self, method, behind):
        name = method.text("name")
        rung = last_summary(method) if finished(method) else None
        spent = (
            f"{figures(rung.number('seconds'))} s, {count(rung.number('spp'))} spp"
            if rung
            else "no run finished"
        )
        error = f"mse {figures(rung.number('mse'))}" if rung else ""
        return element(
            "div",
            self._name(method, "h4"),
            figure(
                self.pictures.picture(method.text("picture"), f"derivative by {name}", behind),
                spent,
            ),
            figure(self.pictures.picture(method.text("error_picture"), f"error of {name}"), error),
            class_="card",
        )

    def _name(self, method, tag="span"):
        name = method.text("name")
        swatch = element("span", class_="swatch", style=f"background:{self.palette.variable(name)}")
        return element(tag, swatch, name, title=method.text("description", ""))

    def _time_chart(self):
        note = element(
            "p",
            "Bars: ± one standard error over repeats. Unbiased methods fall along slope −1. A"
            " marker at the very foot lies below the reference's own error: it cannot be told from"
            " zero.",
            class_="hint",
        )
        return join(charts.error_against_time(self.data, self.palette), note)

    def _table(self):
        """One line per method at the longest of its times."""
        head = [
            "method",
            "time for equal error",
            "seconds",
            "set-up, s",
            "spp",
            "rays",
            "mean squared error",
            "relative",
            "trimmed",
            "bias z",
            "time by term",
            "memory",
        ]
        rows = []
        for method in self.methods:
            if not finished(method):
                message = (
                    f"{method.text('status')}: {method.text('message', '') or 'no run finished'}"
                )
                rows.append([self._name(method), element("td", message, colspan=len(head) - 1)])
                continue
            s = last_summary(method)
            rows.append(
                [
                    self._name(method),
                    times(method.number("time_ratio"), method.number("time_ratio_stderr")),
                    figures(s.number("seconds")),
                    figures(s.number("setup_seconds")),
                    count(s.number("spp")),
                    count(s.number("rays")),
                    *errors(s),
                    self._bias(s),
                    self._terms(s),
                    f"{count(s.number('peak_memory_bytes'))}B",
                ]
            )
        legend = element(
            "p",
            *(
                element("span", element("span", class_=f"swatch term-{t}"), f" {t}  ")
                for t in (*TERMS, "rest")
            ),
            class_="hint legend",
        )
        return join(table(head, rows, f"Methods at the longest time, {self.title}"), legend)

    def _bias(self, summary):
        bias = summary.record_or_none("bias")
        if bias is None or bias.number("p") is None:
            return "–"
        details = element(
            "span",
            f"mean {figures(bias.number('mean'), 2)}, sd {figures(bias.number('deviation'), 2)}, "
            f"max {figures(bias.number('largest'), 2)} of {bias.number('blocks')}",
            class_="small",
        )
        text = join(f"p {figures(bias.number('p'), 2)}", element("br"), details)
        if not implausible(summary, self.threshold):
            return element("td", text)
        return element("td", element("strong", "⚠ implausible: ", class_="bad"), text)

    def _terms(self, summary):
        """Time by term as a bar; what no term accounts for is the rest (set-up, writing)."""
        terms = summary.record_or_none("terms")
        seconds = summary.number("seconds")
        if terms is None or not seconds:
            return "–"
        shares = [(t, (terms.number(t) or 0) / seconds) for t in TERMS if terms.has(t)]
        shares.append(("rest", max(0.0, 1 - sum(share for _, share in shares))))
        whole = max(1.0, sum(share for _, share in shares))
        text = ", ".join(f"{term} {percent(share, None)}" for term, share in shares)
        pieces = [
            element("span", class_=f"term-{term}", style=f"width:{100 * share / whole:.2f}%")
            for term, share in shares
        ]
        return element(
            "td", element("span", *pieces, class_="stack", role="img", aria_label=text, title=text)
        )

    def _factors(self):
        marks = [
            (m.text("name"), m.number("time_ratio"), m.number("time_ratio_stderr"))
            for m in self.methods
            if finished(m) and (m.number("time_ratio") or 0) > 0
        ]
        if len(marks) < 2:
            return None
        return charts.factors([("", marks)], self.methods[0].text("name"), self.palette)

    def _all_times(self):
        head = ["method", "rung, s", "seconds", "spp", "mean squared error", "relative", "trimmed"]
        rows = [
            [
                self._name(m),
                figures(s.number("time")),
                figures(s.number("seconds")),
                count(s.number("spp")),
                *errors(s),
            ]
            for m in self.methods
            if finished(m)
            for s in m.records("summary")
        ]
        return element(
            "details",
            element("summary", "All times"),
            table(head, rows, f"All times, {self.title}"),
        )

    def _command(self):
        return join(
            element("p", "To repeat it (one click selects it all):"),
            element("pre", element("code", self.data.text("command")), class_="command"),
        )

    def _settings(self):
        data, reference = self.data, self.data.record("reference")
        rows = [["seed", data.number("seed")]]
        rows += [[f"-D {key}", value] for key, value in data.record("defines").items()]
        rows.append(["reference", f"{reference.text('file')}, seed {reference.number('seed')}"])
        for method in self.methods:
            settings = ", ".join(
                f"{key.replace('_', ' ')} {figures(value) if isinstance(value, float) else value}"
                for key, value in method.record("settings").items()
            )
            about = "; ".join(t for t in (method.text("description", ""), settings) if t)
            rows.append([self._name(method), about or "–"])
        return table(["setting", "value"], rows, f"Settings, {self.title}", class_="settings")
