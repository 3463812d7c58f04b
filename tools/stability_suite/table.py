"""What is stored, the table of verdicts, and the same as Markdown."""

import math
import os
import re
import textwrap

from common import commit_line, read_json

from .families import FAMILIES
from .program import OURS
from .suite import Point, point_file
from .verdicts import BIASED, MEANING, NOISY, ORDER, RIGHT, UNKNOWN, number, of_family

AHEAD = 2  # so many times smaller an error is ahead; not tuned
BEGIN, END = "<!-- stability: begin -->", "<!-- stability: end -->"


def stored(output):
    """[(family, [record or None for every value])] of the families of which something is there."""
    found = []
    for family in FAMILIES:
        records = [read_json(point_file(output, Point(family, i)))
                   for i in range(len(family.values))]
        records = [r if r and r.get("value") == v else None
                   for r, v in zip(records, family.values)]
        if any(records):
            found.append((family, records))
    return found


def methods_of(stored_records):
    """Ours first, then as they come."""
    names = [m for _, records in stored_records for r in records if r for m in r["methods"]]
    return sorted(dict.fromkeys(names), key=lambda name: name != OURS)


def verdicts(records, method):
    return [r["methods"].get(method, {}).get("verdict") if r else None for r in records]


def cells(stored_records):
    """{(family name, method): text}."""
    return {(f.name, m): of_family(verdicts(records, m), f.values)
            for f, records in stored_records for m in methods_of(stored_records)}


def beats(other, ours):
    """Figures of two methods at a point: whether the other one stands where ours does not. One that
    is noisier than a biased one of ours would not have seen that bias."""
    if ours["verdict"] in (RIGHT, UNKNOWN) or other["verdict"] not in (RIGHT, NOISY):
        return False
    if ours["verdict"] == BIASED:
        return other["error"] < ours["error"]
    if ours["verdict"] == NOISY:
        return AHEAD * other["error"] < ours["error"]
    return other["verdict"] == RIGHT


def beaten(family, records):
    """[(value, methods that stand there)] where ours is not right and others beat it."""
    places = []
    for value, record in zip(family.values, records):
        ours = record and record["methods"].get(OURS)
        if ours:
            better = [m for m, f in record["methods"].items() if beats(f, ours)]
            places += [(value, better)] if better else []
    return places


def standing(family, records):
    """A sentence: is ours the last line standing?"""
    ours = verdicts(records, OURS)
    if not any(ours):
        return ""
    places = beaten(family, records)
    if places:
        return f"{OURS} is not the last one standing: ahead of it are {beaten_text(places)}."
    if all(v in (RIGHT, None) for v in ours):
        return f"{OURS} holds throughout."
    return f"{OURS} does not hold throughout; no other method is ahead where it does not."


def beaten_text(places):
    """Of what beaten() gives: "fd, uniform at 1e-3"."""
    return "; ".join(f"{', '.join(methods)} at {number(value)}" for value, methods in places)


def against_others(stored_records):
    """[(method, geometric mean of our error over its, number of points)] where both are right."""
    logarithms = {}
    for _, records in stored_records:
        for record in filter(None, records):
            ours = record["methods"].get(OURS, {})
            for method, figures in record["methods"].items():
                if method != OURS and figures["verdict"] == ours.get("verdict") == RIGHT:
                    ratio = ours["error"] / figures["error"]
                    logarithms.setdefault(method, []).append(math.log(ratio))
    return [(m, math.exp(sum(v) / len(v)), len(v)) for m, v in logarithms.items()]


def against_others_text(stored_records):
    parts = [f"{ratio:.2g} of {method}'s ({count} points)"
             for method, ratio, count in against_others(stored_records)]
    if not parts:
        return ""
    return f"Where both are right, {OURS} has this share of their error: {', '.join(parts)}."


def who_breaks(family, records, method):
    """ "li2019: noisy from 0.01", or None for one that is right throughout."""
    text = of_family(verdicts(records, method), family.values)
    return None if text in (RIGHT, "–") else f"{method}: {text}"


def seconds_of(stored_records):
    """Of a run."""
    seconds = {r["settings"]["seconds"] for _, rs in stored_records for r in rs if r}
    return ", ".join(f"{s:g}" for s in sorted(seconds))


def markdown(stored_records):
    """The table, as it stands between the markers of scenes/STABILITY.md."""
    methods, text = methods_of(stored_records), cells(stored_records)
    lines = ["| family | knob | " + " | ".join(f"`{m}`" for m in methods) + " |",
             "|---|---|" + "---|" * len(methods)]
    right = []
    for family, _ in stored_records:
        knob = f"{family.knob}: {number(family.values[0])} … {number(family.values[-1])}"
        row = [text[family.name, m] for m in methods]
        if set(row) == {RIGHT}:
            right.append(f"{family.name} ({knob})")
        else:
            lines.append(f"| {family.name} | {knob} | " + " | ".join(row) + " |")
    if right:
        lines += ["", *textwrap.wrap("Every method is right in: " + "; ".join(right) + ".", 100)]
    lines += ["", f"Each run takes {seconds_of(stored_records)} s.\n{commit_line()}"]
    lines += textwrap.wrap(against_others_text(stored_records), 100) + [""]
    used = [w for w in ORDER if any(w in verdicts(rs, m) for _, rs in stored_records
                                    for m in methods)]
    lines += [f"- {word}: {MEANING[word]}" for word in reversed(used)]
    return "\n".join(lines) + "\n"


def publish(file, stored_records):
    """Puts the table between the markers of a page."""
    with open(file, encoding="utf-8") as stream:
        page = stream.read()
    new = f"{BEGIN}\n{markdown(stored_records)}{END}"
    whole, count = re.subn(re.escape(BEGIN) + ".*?" + re.escape(END), lambda _: new, page,
                           flags=re.S)
    if count != 1:
        raise ValueError(f"{file}: not one pair of markers {BEGIN} {END}")
    with open(file, "w", encoding="utf-8") as out:
        out.write(whole)
