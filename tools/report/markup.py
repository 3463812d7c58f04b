"""HTML elements, whole pages, and numbers as text."""

import html
import math
import os

VOID = {"img", "meta", "br", "input"}


class Markup(str):
    """Text that is HTML already; any other text is escaped where it enters an element."""


def escaped(content):
    return content if isinstance(content, Markup) else Markup(html.escape(str(content)))


def join(*contents):
    return Markup("".join(escaped(c) for c in contents if c is not None))


def element(name, /, *contents, **attributes):
    """element("td", "1 < 2", class_="number"): None contents and None attributes are left out."""
    text = "".join(f' {key.rstrip("_").replace("_", "-")}="{html.escape(str(value))}"'
                   for key, value in attributes.items() if value is not None)
    if name in VOID:
        return Markup(f"<{name}{text}>")
    return Markup(f"<{name}{text}>{join(*contents)}</{name}>")


# A page asks for nothing from outside, and could not get it: no scripts, pictures only from within.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


def document(title, palette, style, header, *contents):
    """A whole page. palette: of its charts (colours.py); style: rules beside those of style.css;
    header: elements below the title."""
    with open(os.path.join(os.path.dirname(__file__), "style.css"), encoding="utf-8") as stream:
        rules = stream.read()
    for mode, place in enumerate(("/*light*/", "/*dark*/")):
        rules = rules.replace(place, palette.css(mode) + ";")
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=POLICY),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="color-scheme", content="light dark"),
        element("title", title),
        element("style", Markup(rules + style)))
    body = element("body", element("header", element("h1", title), *header),
                   element("main", *contents))
    return Markup("<!DOCTYPE html>\n") + element("html", head, body, lang="en")


def table(head, rows, label, class_=None):
    """head: texts; rows: lists of cells whose first is the row's header. A cell may be a <td>.
    label: what it is, for those who cannot see what stands above it."""

    def cell(content):
        return content if str(content).startswith("<td") else element("td", content)

    body = [element("tr", element("th", row[0], scope="row"), *map(cell, row[1:])) for row in rows]
    whole = element(
        "table", element("thead", element("tr", *(element("th", h, scope="col") for h in head))),
        element("tbody", *body), class_=class_, aria_label=label)
    # Focusable, so that the keyboard can scroll it.
    return element("div", whole, class_="scroll", tabindex="0", role="region", aria_label=label)


def notice(strong, *text, danger=False):
    return element("div", element("strong", strong), *text,
                   class_="notice danger" if danger else "notice")


def hint(*text):
    return element("p", *text, class_="hint")


def details(summary, *contents):
    return element("details", element("summary", summary), *contents)


def command(text, label="Command"):
    return join(element("p", f"{label} (one click selects it):"),
                element("pre", element("code", text), class_="command"))


def how_to_read(entries):
    """entries: (term, text)."""
    texts = (join(element("dt", term), element("dd", text)) for term, text in entries)
    return element("section", element("h2", "How to read this"), element("dl", *texts),
                   id="reading")


def superscript(number):
    return str(number).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _decimals(value, decimals):
    return f"{value:,.{decimals}f}".replace("-", "−").replace(",", "\u2009")


def figures(value, digits=3):
    """A number in few digits: 0.0123, 1.23×10⁻⁷; an en dash for None."""
    if value is None:
        return "–"
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(value)))
    if -3 <= exponent < 5:
        return _decimals(value, max(0, digits - 1 - exponent))
    return f"{_decimals(value / 10**exponent, digits - 1)}×10{superscript(exponent)}"


def with_error(value, error):
    """1.23 ± 0.04: as many digits as the error leaves, which has two at most."""
    if value is None or error is None or error <= 0 or value == 0:
        return figures(value)
    exponent = math.floor(math.log10(max(abs(value), error)))
    last = max(math.floor(math.log10(error)) - 1, exponent - 2)
    plain = -3 <= exponent < 5
    scale, decimals = (1, max(0, -last)) if plain else (10.0**exponent, max(0, exponent - last))
    text = f"{_decimals(value / scale, decimals)}\u00a0±\u00a0{_decimals(error / scale, decimals)}"
    return text if plain else f"({text})×10{superscript(exponent)}"


def count(value):
    """A large number: 1.23 M; memory takes the same steps of 1000."""
    if value is None:
        return "–"
    for step, suffix in ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= step:
            return f"{value / step:.3g} {suffix}"
    return f"{value:.4g}"


def plural(number, word):
    return f"{number} {word}{'' if number == 1 else 's'}"


def percent(value, error=None):
    if value is None:
        return "–"
    if error:
        decimals = max(0, min(3, 1 - math.floor(math.log10(100 * error))))
        return f"{100 * value:.{decimals}f}\u00a0±\u00a0{100 * error:.{decimals}f} %"
    return f"{100 * value:.3g} %"


def share(part, whole):
    """part / whole as a percentage; a dash of nothing."""
    return percent(part / whole if whole else None)


def times(value, error=None):
    """A factor: ×12.3 ± 0.4."""
    return "–" if value is None else f"×\u202f{with_error(value, error)}"
