"""One word for a method at a point, and a few for a family."""

from . import statistics
from .program import DONE, REFUSED

RIGHT, NOISY, BIASED, LATE, FAILS, REFUSES, UNKNOWN = (
    "right", "noisy", "biased", "late", "fails", "refused", "unknown")
# From the worst.
ORDER = [FAILS, BIASED, LATE, REFUSES, NOISY, UNKNOWN, RIGHT]
MEANING = {
    RIGHT: "no bias found, relative error below 1",
    NOISY: "no bias found, relative error above 1",
    BIASED: "differs from the reference (p < 1e-5), again in longer runs",
    LATE: "two samples per pixel took more than one and a half times the seconds of a run",
    FAILS: "a crash, no end, or a result that is not finite",
    REFUSES: "an error that says why",
    UNKNOWN: "the reference is too noisy to tell",
}
# Relative error at which an image is as far from the truth as a black one.
BLACK = 1.0
# Times the seconds of a run: what a pass over the image may be longer. Not tuned.
LATENESS = 1.5


def verdict(figures, seconds):
    """figures: of a method at a point (suite.py); seconds: that a run should take."""
    if figures["status"] == REFUSED:
        return REFUSES
    if figures["status"] != DONE:
        return FAILS
    if figures["seconds"] > LATENESS * seconds:
        return LATE
    if figures.get("error") is None:
        return UNKNOWN
    if statistics.confirmed(figures["bias"], figures.get("longer")):
        return BIASED
    return NOISY if figures["error"] > BLACK else RIGHT


def number(value):
    """A knob's value: 0.1, 1e-6, 131072."""
    if value != 0 and (abs(value) < 1e-2 or abs(value) >= 1e6):
        mantissa, exponent = f"{value:e}".split("e")
        return f"{float(mantissa):g}e{int(exponent)}"
    return f"{value:g}"


def of_family(words, values):
    """ "right", or where it is not: "noisy from 1e-3", "biased at 1e-6". words: the verdicts at the
    values; None where there is none yet."""
    known = [(w, v) for w, v in zip(words, values) if w is not None]
    if not known:
        return "–"
    parts = []
    for word in ORDER[:-1]:
        places = [i for i, (w, _) in enumerate(known) if w == word]
        if not places:
            continue
        suffix = list(range(places[0], len(known)))
        if len(places) == len(known):
            parts.append(word)
        elif places == suffix and len(places) > 1:
            parts.append(f"{word} from {number(known[places[0]][1])}")
        else:
            parts.append(f"{word} at {', '.join(number(known[i][1]) for i in places)}")
    return "; ".join(parts) or RIGHT
