"""The section of one compare.json: pictures, error against time, figures per method."""

import os

from . import charts
from .colours import SHADES
from .markup import (count, details, element, figures, hint, join, percent, plural, table, times,
                     with_error)
from .pictures import colour_bar
from .section import Section, legend, status_notice, stem, swatch

TERMS = [name for name in SHADES if name != "rest"]
SINGULAR = {"scene units": "scene unit", "radians": "radian", "degrees": "degree"}


def scene_name(data):
    """File and parameters, short enough for a heading."""
    shown = [f"{k}={os.path.basename(str(v))}" for k, v in data.record("defines").items()
             if k not in ("width", "height", "spp")]
    name = stem(data.text("scene"))
    return f"{name} ({', '.join(shown)})" if shown else name


def finished(method):
    return method.text("status") != "missing" and bool(method.records("summary"))


def longest(method):
    """The summary at the longest time budget that the method has."""
    return method.records("summary")[-1]


def bias_of(summary):
    """The bias scores where there are any."""
    bias = summary.record_or_none("bias")
    return bias if bias is not None and bias.number("p") is not None else None


def biases(results):
    """How many tests of bias there are at the longest time budgets."""
    return sum(bias_of(longest(m)) is not None for r in results if r.kind == "compare"
               for m in r.data.records("methods") if finished(m))


def implausible(summary, threshold):
    """Is the difference to the reference more than chance explains?"""
    bias = bias_of(summary)
    return bias is not None and bias.number("p") < threshold


def time_ratios(data):
    """{method: (time for equal error over the first method's, its standard error)}."""
    return {m.text("name"): (m.number("time_ratio"), m.number("time_ratio_stderr") or 0.0)
            for m in data.records("methods") if finished(m) and (m.number("time_ratio") or 0) > 0}


def _error(key):
    """A value above its error, so that all columns fit into 1280 pixels."""

    def cell(self, m, s):
        value, *error = with_error(s.number(key), s.number(f"{key}_stderr")).split("\u00a0±")
        return element("td", value, *([element("br"), f"±{error[0]}"] if error else []))

    return cell


def _number(key, text=figures):
    return lambda self, m, s: text(s.number(key))


# Columns of tables, head: text of (section, method, summary at one time budget).
ERRORS = {"mean squared error": _error("mse"),
          "relative to the mean square": _error("relative_mse"),
          "trimmed mean (0.1 %)": _error("trimmed_mse")}
EQUAL_ERROR = {"time for equal error": lambda self, m, s: times(m.number("time_ratio"),
                                                                m.number("time_ratio_stderr"))}
SECONDS = {"seconds": _number("seconds"), "set-up, s": _number("setup_seconds"),
           "spp": _number("spp", count)}
BIAS = {"bias z": lambda self, m, s: self.bias(s)}
AT_LONGEST = {**EQUAL_ERROR, **SECONDS, "rays": _number("rays", count), **ERRORS, **BIAS,
              "time by term": lambda self, m, s: self.time_by_term(s),
              "memory": lambda self, m, s: f"{count(s.number('peak_memory_bytes'))}B"}
AT_EACH = {"budget, s": _number("time"), "seconds": _number("seconds"),
           "spp": _number("spp", count), **ERRORS}


class ComparisonSection(Section):
    """threshold: a bias' p below it is implausible, see page.py."""

    def __init__(self, result, group, palette, threshold, roles=None):
        data = result.data
        super().__init__(result, group, palette, f"{scene_name(data)}: {data.text('parameter')}",
                         roles)
        self.threshold, self.reference = threshold, data.record("reference")
        self.methods = data.records("methods")
        self.unit = SINGULAR.get(data.text("unit"), data.text("unit"))

    def parts(self):
        note = hint("Bars: ± one standard error over repeats. Unbiased methods fall along slope −1."
                    " A marker at the very foot lies below the reference's own error: it is not"
                    " resolved.")
        budgets = [(m, s) for m in self.methods if finished(m) for s in m.records("summary")]
        return [
            self._what(), self._verdict(),
            *(status_notice(m, f"{m.text('name')}: ", m.text("message", "") or "no reason given")
              for m in self.methods),
            self.pictures_of_methods(),
            element("h3", "Error against time"),
            charts.error_against_time(self.palette, self.data), note,
            element("h3", "At the longest time budget"),
            self.method_table(AT_LONGEST, "Methods at the longest time budget"),
            legend((swatch(f"var(--term-{t})"), t) for t in SHADES),
            self._factors(),
            details("All time budgets", self.method_table(AT_EACH, "All time budgets", budgets)),
            element("h3", "Settings"), self.command(), self._settings()]

    def _what(self):
        data, reference = self.data, self.reference
        budgets = ", ".join(f"{t:.3g}" for t in data.numbers("times"))
        kept = " (kept from an earlier run)" if reference.flag("cached", False) else ""
        return element(
            "p", f"The derivative of {os.path.basename(data.text('scene'))} for ",
            element("code", data.text("parameter")),
            f" in radiance per {self.unit}, {data.number('width')} × {data.number('height')}"
            f" pixels, by {plural(len(self.methods), 'method')} in {budgets} s each on"
            f" {plural(data.number('threads'), 'thread')},"
            f" {plural(data.number('repeats'), 'repeat')}. Reference: {reference.text('method')},"
            f" {count(reference.number('spp'))} samples per pixel,"
            f" {figures(reference.number('seconds'))} s{kept}; its own mean squared error is"
            f" {figures(reference.number('mean_squared_error'))}.")

    def _verdict(self):
        """Who needs the least time for equal error, and how much more the others need."""
        ratios = time_ratios(self.data)
        if len(ratios) < 2:
            return None
        order = sorted(ratios, key=lambda name: ratios[name][0])
        first = self.methods[0].text("name")
        others = ", ".join(f"{name} {times(*ratios[name])}" for name in order if name != first)
        return element("p", element("strong", f"Least time for equal error: {order[0]}. "),
                       f"Time that the others need, {first} = 1: {others}.")

    def pictures_of_methods(self):
        """The reference's card first, then one per method, the same two rows in each."""
        data, reference = self.data, self.reference
        behind = f"{self.group}-reference"
        self.style = self.pictures.flip_style(behind, reference.text("picture"))
        unit = f"radiance per {self.unit}"
        plain = (self.figure(data.text("image"), f"rendering of {self.title}", "the image")
                 if data.text("image") else None)
        cards = [self.card("reference", self.figure(
            reference.text("picture"), f"reference derivative of {self.title}",
            f"{reference.text('method')}, {count(reference.number('spp'))} spp"), plain)]
        cards += [self._card(m, behind) for m in self.methods if m.text("picture")]
        bars = element("div", colour_bar(data.number("scale"), unit, "Derivative"),
                       colour_bar(data.number("error_scale"), unit, "Error: method − reference"),
                       class_="bars")
        note = hint("Upper row: the derivative; lower row: its difference to the reference, longest"
                    " time budget, first repeat. Point at a derivative to see the reference in its"
                    " place.")
        return self.gallery(cards, bars, note)

    def _card(self, method, behind):
        name, last = method.text("name"), longest(method) if finished(method) else None
        spent = (f"{figures(last.number('seconds'))} s, {count(last.number('spp'))} spp"
                 if last else "no run finished")
        return self.card(
            self.name(method, "h4"),
            self.figure(method.text("picture"), f"derivative by {name}", spent, behind),
            self.figure(method.text("error_picture"), f"error of {name}",
                        f"mean squared error {figures(last.number('mse'))}" if last else ""))

    def method_table(self, columns, label, lines=None):
        """columns: see ERRORS. lines: (method, summary); the longest budget of each by default."""
        lines = lines or [(m, longest(m) if finished(m) else None) for m in self.methods]
        rows = []
        for m, s in lines:
            cells = [cell(self, m, s) for cell in columns.values()] if s else [element(
                "td", f"{m.text('status')}: {m.text('message', '') or 'no run finished'}",
                colspan=len(columns))]
            rows.append([self.name(m), *cells])
        return table(["method", *columns], rows, f"{label}, {self.title}")

    def bias(self, summary):
        bias = bias_of(summary)
        if bias is None:
            return "–"
        numbers = element(
            "span", f"mean {figures(bias.number('mean'), 2)}, sd"
            f" {figures(bias.number('deviation'), 2)}, max {figures(bias.number('largest'), 2)} of"
            f" {bias.number('blocks')}", class_="small")
        mark = (element("strong", "⚠ implausible: ", class_="bad")
                if implausible(summary, self.threshold) else None)
        return element("td", mark, f"p {figures(bias.number('p'), 2)}", element("br"), numbers)

    def time_by_term(self, summary):
        """A bar; what no term accounts for is the rest (set-up, writing)."""
        terms, seconds = summary.record_or_none("terms"), summary.number("seconds")
        if terms is None or not seconds:
            return "–"
        shares = {t: (terms.number(t) or 0) / seconds for t in TERMS if terms.has(t)}
        shares["rest"] = max(0.0, 1 - sum(shares.values()))
        whole = max(1.0, sum(shares.values()))
        text = ", ".join(f"{term} {percent(part)}" for term, part in shares.items())
        widths = {t: f"width:{100 * part / whole:.2f}%" for t, part in shares.items()}
        pieces = [element("span", style=f"{width};background:var(--term-{t})")
                  for t, width in widths.items()]
        return element("td", element("span", *pieces, class_="stack", role="img", aria_label=text,
                                     title=text))

    def _factors(self):
        marks = [(name, *ratio) for name, ratio in time_ratios(self.data).items()]
        if len(marks) < 2:
            return None
        return charts.factors(self.palette, [("", marks)], self.methods[0].text("name"))

    def _settings(self):
        data, reference = self.data, self.reference
        rows = [["seed", data.number("seed")]]
        rows += [[f"-D {key}", value] for key, value in data.record("defines").items()]
        rows.append(["reference", f"{reference.text('file')}, seed {reference.number('seed')}"])
        for method in self.methods:
            settings = ", ".join(
                f"{key.replace('_', ' ')} {figures(value) if isinstance(value, float) else value}"
                for key, value in method.record("settings").items())
            about = "; ".join(t for t in (method.text("description", ""), settings) if t)
            rows.append([self.name(method), about or "–"])
        return table(["setting", "value"], rows, f"Settings, {self.title}", class_="settings")
