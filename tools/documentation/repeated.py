"""Published figures that repeated ones contradict: the first table of scenes/COMPARISONS.md beside
results of `tools/paper --ablations`, the table of scenes/STABILITY.md beside `tools/stability`, and
counts of scenes/fits/README.md, which have no noise, beside `scenes/fits/fits.py`.
"""

import math
import os
import re
import sys

from common import ROOT, read_json
from paper_figures import ablations
from stability_suite import table
from stability_suite.verdicts import BIASED, FAILS, LATE, REFUSES, RIGHT, number

sys.path.append(os.path.join(ROOT, "scenes", "fits"))
import fits  # noqa: E402

COMPARISONS, STABILITY, FITTED = (
    os.path.join("scenes", name)
    for name in ("COMPARISONS.md", "STABILITY.md", os.path.join("fits", "README.md")))
FITS = os.path.join(ROOT, "out", "release", "fits")  # of a rehearsal
# Of the first table.
METHODS = {"light sets": "silhouettes", "+ directions": "silhouettes:directions=moving",
           "+ placement": "adaptive:film=fixed:generator=independent", "adaptive": "adaptive",
           "fd": "fd"}
# By chance one figure in a hundred is named.
LEVEL = 0.01
# Verdicts that the load of the machine does not change.
LASTING = {BIASED, FAILS, REFUSES}


def read(page):
    with open(os.path.join(ROOT, page), encoding="utf-8") as stream:
        return stream.read()


def rows(page):
    """The cells of all lines of tables, without backquotes."""
    lines = [line for line in page.splitlines() if line.startswith("|")]
    return [[cell.strip().replace("`", "") for cell in line.strip("|").split("|")] for line in lines]


def probability(one, other):
    """Of two ratios (value, standard error over three repeats) that differ as much by chance: their
    logarithms, by Student's t with four degrees of freedom."""
    t = math.log(one[0] / other[0]) / math.hypot(one[1] / one[0], other[1] / other[0])
    c = 1 + t * t / 4
    return 1 - abs(t) / math.sqrt(c) * (0.75 - t * t / (16 * c))


def differing_times(page, records):
    """A line for each figure of the first table that a record's differs from."""
    head, _, *found = rows(page)
    for record in records:
        for name, *cells in (row for row in found if record.title.endswith(row[0])):
            for column, cell in zip(head[1:], cells):
                published = re.match(r"([\d.e-]+)±([\d.e-]+)", cell)
                now = record.time(METHODS[column])
                if published and now:
                    then = float(published[1]), float(published[2])
                    p = probability(then, now)
                    if p < LEVEL:
                        yield (f"{name}, {column}: {then[0]:.2g} ± {then[1]:.2g} is published, "
                               f"{now[0]:.2g} ± {now[1]:.2g} found (p = {p:.1g})")


def published_seconds(page=None):
    """Of a run of tools/stability."""
    text = page or read(STABILITY)
    return float(re.search(r"^Each run takes ([\d.]+) s\.", text, re.MULTILINE)[1])


def verdicts(cell, values):
    """The words that table.of_family joined into a cell, one for each value of the knob."""
    words = [RIGHT] * len(values)
    shown = [number(v) for v in values]
    for word, how, places in re.findall(r"(\w+)(?: (at|from) ([^;]*))?(?:; |$)", cell):
        at = [shown.index(v) for v in places.split(", ")] if how else range(len(values))
        for i in range(at[0], len(values)) if how == "from" else at:
            words[i] = word
    return words


def differing_verdicts(page, stored):
    """A line for each verdict that only one of both has, of those that last, after equal time."""
    seconds = published_seconds(page)
    head = next(row for row in rows(page) if row[:2] == ["family", "knob"])
    known = {row[0]: dict(zip(head[2:], row[2:])) for row in rows(page)}
    for family, records in stored:
        for method in head[2:]:
            then = verdicts(known.get(family.name, {}).get(method, RIGHT), family.values)
            records = [r if r and r["settings"]["seconds"] == seconds else None for r in records]
            for value, before, now in zip(family.values, then, table.verdicts(records, method)):
                if now not in (None, before, LATE) and {before, now} & LASTING:
                    yield (f"{family.name}, {method} at {number(value)}: {before} is published, "
                           f"{now} found")


def differing_counts(page, history_of):
    """A line for each count of evaluations to 1/100 and 1/1000 that a stored fit by L-BFGS lacks.
    history_of(name): of the fit, or None."""
    for name, how, *cells in (row for row in rows(page) if len(row) == 7):
        history = history_of(name) if how.startswith("lbfgs, ") else None
        for cell, part in zip(cells, (0.01, 0.001) if history else ()):
            then = int(cell.split(",")[0])
            now = fits.reached({"history": history, "seconds": 0}, part)
            if not now or then != now[0]:
                yield (f"{name}, lbfgs to {part:g}: {then} evaluations are published, "
                       f"{now[0] if now else 'none'} found")


def stored_history(name):
    fit = read_json(os.path.join(FITS, f"{name}_lbfgs", "fit.json"))
    return fit and fit["history"]


def differences():
    """A line for each published figure that what lies in out/ contradicts."""
    out = os.path.join(ROOT, "out")
    times = ablations.stored(lambda part: os.path.join(out, "paper", part.name))
    for page, lines in ((COMPARISONS, differing_times(read(COMPARISONS), times)),
                        (STABILITY, differing_verdicts(read(STABILITY),
                                                       table.stored(os.path.join(out, "stability")))),
                        (FITTED, differing_counts(read(FITTED), stored_history))):
        yield from (f"{page}: {line}" for line in lines)
