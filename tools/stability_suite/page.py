"""The page: the table of verdicts, then every family with its chart, sentences and figures."""

import os

from report.colours import Palette
from report.markup import (details, document, element, figures, hint, how_to_read, join, notice,
                           percent, table)

from . import chart
from .statistics import LEVEL, called
from .suite import LONGER, REFERENCE, REPEATS, RESOLUTION
from .table import (AHEAD, OURS, against_others_text, beaten, beaten_text, cells, markdown,
                    methods_of, seconds_of, standing, who_breaks)
from .verdicts import LATENESS, MEANING, ORDER, RIGHT, number

READING = [
    ("Error",
     "The root of the mean squared error of one run over that of the derivative, over all pixels"
     f" ({RESOLUTION} × {RESOLUTION}, box filter, one channel): 1 is the error of a black image. A"
     " run takes the same seconds for every method, set-up included, on one thread;"
     f" {REPEATS} repeats, interleaved."),
    ("Reference",
     "A closed form, whose error is estimated by a coarser one; or a run"
     f" {REFERENCE} times as long, with its own seeds, of the same shape made otherwise, or of"
     " finite differences with a small fixed step. References of other kinds are compared with"
     " finite differences. The noise of runs is known, pixel by pixel, from their independent"
     " batches, and is subtracted from the squared error. Where a method's error is below that"
     " noise, it is the spread of the repeats, which needs no reference. The difference of their"
     " mean to the reference is added where it exceeds the reference's noise by three standard"
     " errors."),
    ("Bias",
     "Sums over 6 × 6 blocks of pixels: the mean of the repeats minus the reference, in standard"
     " errors of both. p is the probability of scores as large as these (sum of squares, and the"
     f" largest; doubled). A bias is reported where p is below {LEVEL:g}, and below it again in new"
     f" runs {LONGER} times as long, whose scores must not be weaker than chance allows: what rare"
     " samples pretend fades with time. Too much: the share of the derivative that the method adds"
     " (negative: loses). Visible: the smallest share that would have been reported. Finite"
     " differences are biased by their step, and are reported where it rules their error. A method"
     " that never samples a rare event in all its runs cannot be distinguished from a biased one."),
    ("Tail", "The share of the squared error in the worst 0.1 % of the pixels of all repeats."),
    ("Verdict",
     "; ".join(f"{word}: {MEANING[word]}" for word in reversed(ORDER))
     + f". Late: more than {LATENESS:g} times the seconds. Ahead of {OURS} where it is not right: a"
     " method that is right where it fails or is late; that has less error where it is biased;"
     f" less than 1/{AHEAD} of its error where it is noisy."),
]


def _verdict_table(records):
    methods, text = methods_of(records), cells(records)
    rows = []
    for family, stored in records:
        row = [element("a", family.name, href=f"#{family.name}"),
               f"{family.knob}: {number(family.values[0])} … {number(family.values[-1])}"]
        for method in methods:
            word = text[family.name, method]
            row.append(element("td", word, class_="best" if word == RIGHT else
                               "muted" if word == "–" else "words"))
        rows.append(row)
    return table(["family", "knob", *methods], rows, "Verdicts")


def _summary(records):
    """Where ours is not right, and who is ahead there."""
    items, lost = [], 0
    for family, stored in records:
        word = who_breaks(family, stored, OURS)
        if word is None:
            continue
        places = beaten(family, stored)
        lost += bool(places)
        ahead = f" Ahead of it: {beaten_text(places)}." if places else ""
        items.append(element("li", element("a", family.name, href=f"#{family.name}"),
                             f": {word.split(': ', 1)[1]}.", ahead))
    text = (f"{OURS} is right at every point of {len(records) - len(items)} of {len(records)} "
            f"families, and another method is ahead where it is not in {lost}.")
    whole = notice("", text, element("ul", *items)) if items else element("p", text)
    return join(whole, element("p", against_others_text(records),
                                " Geometric means; the time for equal error is its square."))


def _row(record, method, label):
    f = record["methods"].get(method)
    if f is None:
        return None
    word = element("td", f["verdict"], class_=None if f["verdict"] == RIGHT else "bad")
    if f.get("error") is None:
        return [label, method, word, element("td", f["message"] or "–", colspan=9)]
    bias, longer = f["bias"], f.get("longer")
    return [label, method, word, figures(f["error"]), percent(f["tail"]), figures(bias["p"], 2),
            figures(bias["largest_z"], 2), percent(bias["share"]), percent(bias["visible"]),
            figures(longer["p"], 2) if longer else "–", figures(f["seconds"]),
            figures(f["spp"])]


def _figures(family, records):
    head = [family.knob, "method", "verdict", "error", "tail", "p", "largest z", "too much",
            "visible", "p of longer runs", "s", "spp"]
    known = [(number(value), record) for value, record in zip(family.values, records) if record]
    rows = [_row(record, method, label) for label, record in known
            for method in methods_of([(family, records)])]
    references = [_reference_row(label, record["reference"]) for label, record in known]
    return details("All figures", table(head, filter(None, rows), f"Figures, {family.name}"),
                   table([family.knob, "reference by", "status", "its own error", "spp", "s",
                          "p against differences"], references, f"References, {family.name}"))


def _reference_row(label, about):
    check = about.get("against_differences")
    doubt = called(check)
    return [label, about["method"], about["message"] or about["status"],
            figures(about.get("error")), figures(about["spp"]), figures(about["seconds"]),
            element("td", figures(check["p"], 2) if check else "–",
                    class_="bad" if doubt else None)]


def _warnings(records):
    texts = {w.split("warning:", 1)[1].strip() for r in records if r
             for f in r["methods"].values() for w in f["warnings"]}
    if not texts:
        return None
    return details(f"{len(texts)} warnings of the program",
                   element("ul", *(element("li", t) for t in sorted(texts))))


def _doubt(records):
    """Where the reference itself disagrees with differences."""
    checks = [r["reference"].get("against_differences") for r in records if r]
    if not any(called(c) for c in checks):
        return None
    return notice("The reference disagrees with differences of its own scene. ",
                  "Trust nothing below.", danger=True)


def _section(family, records, palette):
    broken = [t for t in (who_breaks(family, records, m)
                          for m in methods_of([(family, records)])) if t]
    sentence = " ".join(t for t in (
        standing(family, records), "; ".join(broken) + "." if broken else "",
        family.why if who_breaks(family, records, OURS) else "") if t)
    return element(
        "section", element("h2", family.name), element("p", family.what),
        hint("Reference: ", family.truth), _doubt(records),
        chart.draw(palette, family, records), element("p", sentence),
        _figures(family, records), _warnings(records), id=family.name)


def html(records):
    palette = Palette(methods_of(records))
    words = (f"Scenes that get harder by a knob until something breaks. Derivative images after"
             f" {seconds_of(records)} s of one thread. ")
    return document(
        "limn: where methods break", palette, "", [],
        element("p", words, element("a", "How to read this", href="#reading"), "."),
        _summary(records), _verdict_table(records),
        *(_section(f, r, palette) for f, r in records), how_to_read(READING))


def write(output, records):
    """The page and the table; returns the page's file."""
    page = os.path.join(output, "report.html")
    for file, text in ((page, html(records)), (os.path.join(output, "table.md"), markdown(records))):
        with open(file, "w", encoding="utf-8") as out:
            out.write(text)
    return page
