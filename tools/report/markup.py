"""HTML elements and numbers as text."""

import html
import math

VOID = {"img", "meta", "br", "input"}


class Markup(str):
    """Text that is HTML already; any other text is escaped where it enters an element."""


def escaped(content):
    return content if isinstance(content, Markup) else Markup(html.escape(str(content)))


def join(*contents):
    return Markup("".join(escaped(c) for c in contents if c is not None))


def element(name, /, *contents, **attributes):
    """element("td", "1 < 2", class_="number"): None contents and None attributes are left out."""
    text = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{html.escape(str(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in VOID:
        return Markup(f"<{name}{text}>")
    return Markup(f"<{name}{text}>{join(*contents)}</{name}>")


# A page asks for nothing from outside, and could not get it: no scripts, pictures only from within.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


def document(title, style, *contents):
    """A whole page: title and style as texts, contents: of the body."""
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=POLICY),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="color-scheme", content="light dark"),
        element("title", title),
        element("style", style),
    )
    html_element = element("html", head, element("body", *contents), lang="en")
    return Markup("<!DOCTYPE html>\n") + html_element


def table(head, rows, label, class_=None):
    """head: texts; rows: lists of cells whose first is the row's header. A cell may be a <td>.
    label: what it is, for those who cannot see what stands above it.
    """

    def cell(content):
        return content if str(content).startswith("<td") else element("td", content)

    body = [element("tr", element("th", row[0], scope="row"), *map(cell, row[1:])) for row in rows]
    whole = element(
        "table",
        element("thead", element("tr", *(element("th", h, scope="col") for h in head))),
        element("tbody", *body),
        class_=class_,
        aria_label=label,
    )
    # Focusable, so that the keyboard can scroll it.
    return element("div", whole, class_="scroll", tabindex="0", role="region", aria_label=label)


def superscript(number):
    return str(number).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def figures(value, digits=3):
    """A number in few digits: 0.0123, 1.23×10⁻⁷; an en dash for None."""
    if value is None:
        return "–"
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(value)))
    if -3 <= exponent < 5:
        decimals = max(0, digits - 1 - exponent)
        return f"{value:,.{decimals}f}".replace("-", "−").replace(",", "\u2009")
    mantissa = f"{value / 10**exponent:.{digits - 1}f}".replace("-", "−")
    return f"{mantissa}×10{superscript(exponent)}"


def with_error(value, error):
    """1.23 ± 0.04: as many digits as the error leaves, which has two at most."""
    if value is None or error is None or error <= 0 or value == 0:
        return figures(value)
    exponent = math.floor(math.log10(max(abs(value), error)))
    last = max(math.floor(math.log10(error)) - 1, exponent - 2)
    if -3 <= exponent < 5:
        decimals = max(0, -last)
        return f"{value:,.{decimals}f}\u00a0±\u00a0{error:,.{decimals}f}".replace("-", "−").replace(
            ",", "\u2009"
        )
    decimals = max(0, exponent - last)
    scale = 10.0**exponent
    text = f"({value / scale:.{decimals}f}\u00a0±\u00a0{error / scale:.{decimals}f})".replace(
        "-", "−"
    )
    return f"{text}×10{superscript(exponent)}"


def count(value):
    """A large number: 1.23 M; memory takes the same steps of 1000."""
    if value is None:
        return "–"
    for step, suffix in ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= step:
            return f"{value / step:.3g} {suffix}"
    return f"{value:.4g}"


def percent(value, error=None):
    if value is None:
        return "–"
    if error:
        decimals = max(0, min(3, 1 - math.floor(math.log10(100 * error))))
        return f"{100 * value:.{decimals}f}\u00a0±\u00a0{100 * error:.{decimals}f} %"
    return f"{100 * value:.3g} %"


def times(value, error=None):
    """A factor: ×12.3 ± 0.4."""
    return "–" if value is None else f"×\u2009{with_error(value, error)}"
