"""What each ablation of the default is worth: the page in Markdown of `tools/paper --ablations`."""

import math
import os
import shlex
import statistics

from common import read_json

from .parts import ABLATED, ABLATIONS, DEFAULT, DIFFERENCES, FOREST, MITSUBA_AFTER_SETUP

# Minutes of limn's runs and of Mitsuba's; of the latter start, compilation, octree and pilot [s].
MINUTES, MITSUBA_MINUTES, MITSUBA_SETUP = 19, 8, 45
TRIMMED = 0.001  # share of the pixels, those with the largest error, that `trimmed_mse` leaves out
HEADS = {DIFFERENCES: "finite differences", MITSUBA_AFTER_SETUP: "Mitsuba"}
COLUMNS = [*ABLATIONS, DIFFERENCES]


def parts(mitsuba):
    return [comparison.ablated(mitsuba) for comparison in ABLATED]


class _Record:
    """One compare.json, its longest runs alone."""

    def __init__(self, title, data):
        self.title, self.data = title, data
        self.methods = {m["name"]: m for m in data["methods"]
                        if m["status"] != "missing" and m["summary"]}

    def longest(self, name):
        """The summary of a method's longest runs; {} without any."""
        return self.methods[name]["summary"][-1] if name in self.methods else {}

    def _product(self, name, error="mse"):
        """Squared error times seconds of the longest runs: mean and its relative standard error."""
        runs = self.methods.get(name, {"runs": []})["runs"]
        products = [r[error] * r["seconds"] for r in runs if r["time"] == self.data["times"][-1]]
        mean = statistics.mean(products) if products else 0
        if not mean:
            return 0, 0
        spread = statistics.stdev(products) / math.sqrt(len(products)) if len(products) > 1 else 0
        return mean, spread / mean

    def time(self, name, of=FOREST):
        """Time for equal error over that of another method, and its standard error, as `limn
        compare` has it; None if there is none."""
        (mine, spread), (other, other_spread) = self._product(name), self._product(of)
        if name == of or not mine or not other:
            return None
        return mine / other, mine / other * math.hypot(spread, other_spread)

    def trimmed(self, name, of=FOREST):
        return self._product(name, "trimmed_mse")[0] / self._product(of, "trimmed_mse")[0]

    def cell(self, name, of=FOREST):
        time = self.time(name, of)
        return (f"{_number(time[0])} ± {_number(time[1])} ({_number(self.trimmed(name, of))})"
                if time else "–")

    def tail(self, name):
        """Share of the squared error in the pixels that the trimmed mean leaves out."""
        last = self.longest(name)
        return 1 - (1 - TRIMMED) * last["trimmed_mse"] / last["mse"] if last.get("mse") else None

    def p(self, name):
        """Of the bias scores."""
        return (self.longest(name).get("bias") or {}).get("p")


def _number(x):
    return f"{x:.0f}" if x >= 100 else f"{x:.2g}"


def _table(head, rows):
    lines = ["| " + " | ".join(row) + " |" for row in (head, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]]) if rows else ""


def _ablations(records):
    head = ["part", f"relative error of `{FOREST}`", *(HEADS.get(m, f"`{m}`") for m in COLUMNS)]
    return _table(head, [[r.title, _number(r.longest(FOREST)["relative_mse"]),
                          *map(r.cell, COLUMNS)] for r in records if r.longest(FOREST)])


def _beside_mitsuba(records):
    rows = []
    for record in records:
        if record.time(DEFAULT, MITSUBA_AFTER_SETUP):
            settings = record.methods[MITSUBA_AFTER_SETUP]["settings"]
            setup = settings.get("setup_not_counted_seconds")
            last = record.longest(MITSUBA_AFTER_SETUP)
            rows.append([record.title, record.cell(DEFAULT, MITSUBA_AFTER_SETUP),
                         f"{last['seconds']:.2g}", f"{last['spp']:.0f}",
                         "–" if setup is None else f"{setup:.0f}"])
    return _table(["part", f"`{DEFAULT}` over Mitsuba", "Mitsuba's seconds",
                   "its samples per pixel", "its set-up, s"], rows)


def _verdict(ratio, error):
    """Of a quotient of two times: beyond two standard errors of its logarithm, or even."""
    distance = math.log(ratio)
    return "even" if abs(distance) <= 2 * error / ratio else "ahead" if distance < 0 else "behind"


def _against(records, other, name):
    found = {"ahead": [], "even": [], "behind": []}
    for record in records:
        time = record.time(DEFAULT, other)
        if time:
            found[_verdict(*time)].append((record.title, time[0]))
    count, ahead = sum(map(len, found.values())), found["ahead"]
    if not count:
        return ""
    text = f"Against {name} `{DEFAULT}` is ahead in {len(ahead)} of {count} parts"
    if ahead:
        gains = sorted(1 / ratio for _, ratio in ahead)
        text += f" ({' to '.join(dict.fromkeys(map(_number, (gains[0], gains[-1]))))} times)"
    for verdict, phrase in (("even", "even within two standard errors"), ("behind", "behind")):
        shown = [f"{title} ({_number(ratio)})" for title, ratio in found[verdict]]
        text += f"; {phrase}: {', '.join(shown)}" if shown else ""
    return text + (". Numbers are its time over theirs." if len(ahead) < count else ".")


def _biases(records):
    """The smallest score of the unbiased methods, and all methods that are marked."""
    scores = [(r.p(m), r.title, m) for r in records
              for m in (FOREST, *COLUMNS, MITSUBA_AFTER_SETUP) if r.p(m) is not None]
    unbiased = [score for score in scores if score[2] not in HEADS]
    if not unbiased:
        return ""
    p, title, method = min(unbiased)
    level = 0.01 / len(unbiased)
    marked = [f"{HEADS[m]} in {at}" for value, at, m in scores if m in HEADS and value < level]
    return (f"Of the bias scores of limn's unbiased methods ({len(unbiased)}) the smallest p is"
            f" {p:.2g} (`{method}`, {title}); a bias would be marked below {level:.1g}."
            + (f" Marked are {', '.join(marked)}." if marked else ""))


def _tails(records):
    lines = []
    for name in (DEFAULT, FOREST):
        shares = sorted((r.tail(name), r.title) for r in records if r.tail(name) is not None)
        lines += [f"`{name}` " + " to ".join(f"{s:.2g} ({t})" for s, t in (shares[0], shares[-1]))
                  ] if shares else []
    return (f"The {100 * TRIMMED:g} % of the pixels with the largest error hold this share of the"
            f" squared error: {'; '.join(lines)}." if lines else "")


def _intro(records):
    first = records[0].data
    sizes = dict.fromkeys(f"{r.data['width']} x {r.data['height']}" for r in records)
    return (
        f"Time for equal error relative to `{FOREST}`, for one parameter: mean squared error times"
        f" seconds after {first['times'][-1]:.2g} s with set-up, {first['repeats']} repeats,"
        " interleaved, with the standard error over repeats; in brackets the same of the trimmed"
        f" mean (without the {100 * TRIMMED:g} % of pixels with the largest error)."
        f" {first['threads']} threads, {' or '.join(sizes)} pixels, the reference"
        f" {first['reference']['seconds']:.2g} s of `{first['reference']['method']}`.")


def stored(folder):
    """Of the parts that have results. folder(part): where they lie."""
    found = [(c.title, read_json(os.path.join(folder(c.ablated(False)), "compare.json")))
             for c in ABLATED]
    return [_Record(title, data) for title, data in found if data]


def markdown(folder, again):
    """folder(part): where results lie. again: the command. None without results."""
    records = stored(folder)
    if not records:
        return None
    beside = _beside_mitsuba(records)
    pieces = [
        _intro(records), _ablations(records), _against(records, DIFFERENCES, HEADS[DIFFERENCES]),
        _biases(records), _tails(records),
        "Mitsuba 3 (`prb_projective`, octree) after its set-up, which is not counted; limn's is:"
        " time for equal error, as above." if beside else "",
        beside, _against(records, MITSUBA_AFTER_SETUP, "Mitsuba after its set-up"),
        "All of it again:\n\n    " + shlex.join(again),
        "One part of it:\n\n    " + records[0].data["command"]]
    return "\n\n".join(piece for piece in pieces if piece) + "\n"
