"""What is stored, the table of verdicts, and the same as Markdown."""

import os
import re

from .families import FAMILIES
from .suite import point_file, Point, read_json
from .verdicts import BIASED, FAILS, LATE, MEANING, ORDER, RIGHT, number, of_family

OURS = "adaptive"
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


def breaks_first(family, records):
    """[(value, methods that are right there)] where ours is not right and another one is."""
    beaten = []
    for value, record in zip(family.values, records):
        if not record or record["methods"].get(OURS, {}).get("verdict", RIGHT) == RIGHT:
            continue
        better = [m for m, figures in record["methods"].items() if figures["verdict"] == RIGHT]
        if better:
            beaten.append((value, better))
    return beaten


def standing(family, records):
    """A sentence: is ours the last line standing?"""
    ours = verdicts(records, OURS)
    if not any(ours):
        return ""
    beaten = breaks_first(family, records)
    if beaten:
        places = "; ".join(f"at {number(v)} {' and '.join(m)} {'is' if len(m) == 1 else 'are'}"
                           for v, m in beaten)
        return f"{OURS} is not the last one standing: {places} right where it is not."
    if all(v in (RIGHT, None) for v in ours):
        return f"{OURS} holds throughout."
    return f"{OURS} is the last one standing."


def who_breaks(family, records, method):
    """ "li2019: noisy from 0.01", or None for one that is right throughout."""
    text = of_family(verdicts(records, method), family.values)
    return None if text in (RIGHT, "–") else f"{method}: {text}"


def markdown(stored_records):
    """The table, as it stands between the markers of scenes/STABILITY.md."""
    methods, text = methods_of(stored_records), cells(stored_records)
    lines = ["| family | knob | " + " | ".join(f"`{m}`" for m in methods) + " |",
             "|---|---|" + "---|" * len(methods)]
    for family, records in stored_records:
        knob = f"{family.knob}: {number(family.values[0])} … {number(family.values[-1])}"
        lines.append(f"| {family.name} | {knob} | " +
                     " | ".join(text[family.name, m] for m in methods) + " |")
    seconds = sorted({r["settings"]["seconds"] for _, rs in stored_records for r in rs if r})
    lines += ["", "Seconds of a run: " + ", ".join(f"{s:g}" for s in seconds) + "."]
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


def chart_file(output, family):
    return os.path.join(output, "charts", f"{family.name}.png")


BROKEN = (BIASED, FAILS, LATE)  # what a chart marks
