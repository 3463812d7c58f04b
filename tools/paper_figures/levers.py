"""What each lever is worth: the runs of `tools/paper --levers` and the page in Markdown that they make."""

import json
import math
import os
import shlex
import statistics

from .part import Part

METHODS = ["forest", "silhouettes", "moving-directions", "held-positions", "independent-numbers", "adaptive", "fd"]  # each with those before
DEFAULT, DIFFERENCES, MITSUBA = "adaptive", "fd", "mitsuba-after-setup"
HEADS = {DIFFERENCES: "finite differences"}
# Seconds of limn's runs and beside them; of Mitsuba start, compilation, octree and pilot.
MINUTES, MITSUBA_MINUTES, MITSUBA_SETUP = 19, 8, 45
WORST = 0.001  # share of the pixels that `trimmed_mse` leaves out
BUNNY = "/usr/share/glmark2/models/bunny.obj"  # glmark2-data
GENERATED = "../build/generated"
UP, ASIDE, TURN = "object.translate.y", "object.translate.x", "object.rotate.y"


def _row(name, title, scene, parameter, beside=False, **more):
    """beside: Mitsuba can move this parameter, and is asked for if it is wanted."""
    part = Part(f"levers-{name}", "compare", f"scenes/{scene}.xml", parameter, list(METHODS), **more)
    return title, part, beside


ROWS = [
    _row("mirror-0.01", "rough mirror, alpha 0.01", "rough_mirror", UP, True, defines={"alpha": "0.01"}),
    _row("mirror-0.05", "rough mirror, alpha 0.05", "rough_mirror", UP, True, defines={"alpha": "0.05"}),
    _row("mirror-0.2", "rough mirror, alpha 0.2", "rough_mirror", UP, defines={"alpha": "0.2"}),
    _row("shadow", "soft shadow", "soft_shadow", ASIDE, True),
    _row("concave", "concave", "concave", UP),
    _row("chandelier", "chandelier", "intricate", UP),
    _row("harp", "harp", "intricate", UP, defines={"mesh": f"{GENERATED}/harp.ply"}),
    _row("sun", "strong sun", "sun", ASIDE),
    _row("lights", "several lights", "lights", ASIDE, wide=True),
    _row("in-view", "all in view, moving camera", "in_view", "sensor.translate.x", wide=True),
    _row("in-view-object", "all in view, moving object", "in_view", ASIDE, True, wide=True),
    _row("cad", "CAD part, sharp edges", "cad", TURN, wide=True),
    _row("plant", "plant, open leaves", "plant", TURN),
    _row("demo", "demo (bunny)", "demo", UP, needs=BUNNY),
]


def parts(mitsuba):
    for _, part, beside in ROWS:
        part.methods = METHODS + ([MITSUBA] if mitsuba and beside else [])
    return [part for _, part, _ in ROWS]


class _Record:
    """One compare.json, its longest runs alone."""

    def __init__(self, title, data):
        self.title, self.data = title, data
        self.methods = {m["name"]: m for m in data["methods"] if m["status"] != "missing" and m["summary"]}

    def rung(self, name):
        return self.methods[name]["summary"][-1] if name in self.methods else None

    def products(self, name, error="mse"):
        """Squared error times seconds of the longest runs."""
        method = self.methods.get(name)
        return [r[error] * r["seconds"] for r in method["runs"] if r["time"] == self.data["times"][-1]] if method else []

    def time(self, name, of="forest"):
        """Time for equal error over that of another method, and its standard error, as `limn compare` has it; None
        if there is none."""
        means = [statistics.mean(p) if p else 0 for p in (self.products(name), self.products(of))]
        if name == of or not all(means):
            return None
        errors = [statistics.stdev(p) / math.sqrt(len(p)) if len(p) > 1 else 0
                  for p in (self.products(name), self.products(of))]
        return means[0] / means[1], means[0] / means[1] * math.hypot(*(e / m for e, m in zip(errors, means)))

    def trimmed(self, name, of="forest"):
        return statistics.mean(self.products(name, "trimmed_mse")) / statistics.mean(self.products(of, "trimmed_mse"))

    def worst_share(self, name):
        """Of the squared error, in the worst pixels."""
        rung = self.rung(name)
        return 1 - (1 - WORST) * rung["trimmed_mse"] / rung["mse"] if rung and rung["mse"] else None

    def bias(self, name):
        rung = self.rung(name)
        return rung["bias"]["p"] if rung and rung.get("bias") else None


def _number(x):
    return f"{x:.0f}" if x >= 100 else f"{x:.2g}"


def _cell(record, name, of="forest"):
    time = record.time(name, of)
    return f"{_number(time[0])} ± {_number(time[1])} ({_number(record.trimmed(name, of))})" if time else "–"


def _table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def _first_table(records):
    head = ["part", "relative error of `forest`"] + [HEADS.get(m, f"`{m}`") for m in METHODS[1:]]
    rows = [[r.title, _number(r.rung("forest")["relative_mse"]), *(_cell(r, m) for m in METHODS[1:])]
            for r in records if r.rung("forest")]
    return _table(head, rows)


def _verdict(time):
    """Of a quotient of two times: beyond two standard errors of its logarithm, or even."""
    ratio, error = time
    distance = math.log(ratio)
    return "even" if abs(distance) <= 2 * error / ratio else "ahead" if distance < 0 else "behind"


def _against(records, other, name):
    words = {"ahead": [], "even": [], "behind": []}
    for record in records:
        time = record.time(DEFAULT, other)
        if time:
            words[_verdict(time)].append((record.title, time[0]))
    count = sum(map(len, words.values()))
    if not count:
        return ""
    text = f"Against {name} `{DEFAULT}` is ahead in {len(words['ahead'])} of {count} parts"
    if words["ahead"]:
        gains = sorted(1 / ratio for _, ratio in words["ahead"])
        text += f" ({' to '.join(dict.fromkeys(map(_number, (gains[0], gains[-1]))))} times)"
    for verdict, phrase in (("even", "even within two standard errors"), ("behind", "behind")):
        shown = [f"{title} ({_number(ratio)})" for title, ratio in words[verdict]]
        if shown:
            text += f"; {phrase}: {', '.join(shown)}"
    return text + ". Numbers are its time over theirs." if len(words["ahead"]) < count else text + "."


def _mitsuba_table(records):
    rows = []
    for record in records:
        if record.time(DEFAULT, MITSUBA):
            method = record.methods[MITSUBA]
            setup = method["settings"].get("setup_not_counted_seconds")
            rung = record.rung(MITSUBA)
            rows.append([record.title, _cell(record, DEFAULT, MITSUBA), f"{rung['seconds']:.2g}",
                         f"{rung['spp']:.0f}", f"{setup:.0f}" if setup is not None else "–"])
    if not rows:
        return ""
    return _table(["part", f"`{DEFAULT}` over Mitsuba", "Mitsuba's seconds", "its samples per pixel",
                   "its set-up, s"], rows)


def _biases(records):
    """The smallest score of the unbiased methods, and all methods that are flagged."""
    unbiased = [(r.bias(m), r.title, m) for r in records for m in METHODS if m != DIFFERENCES and r.bias(m) is not None]
    if not unbiased:
        return ""
    smallest = min(unbiased)
    level = 0.01 / len(unbiased)
    text = (f"Of the bias scores of limn's unbiased methods ({len(unbiased)}) the smallest p is {smallest[0]:.2g}"
            f" (`{smallest[2]}`, {smallest[1]}); a bias would be marked below {level:.1g}.")
    other = [(r.bias(m), r.title, m) for r in records for m in (DIFFERENCES, MITSUBA) if r.bias(m) is not None]
    marked = [f"{HEADS.get(m, 'Mitsuba')} in {title}" for p, title, m in other if p < level]
    return text + (f" Marked are {', '.join(marked)}." if marked else "")


def _tails(records):
    lines = []
    for name in (DEFAULT, "forest"):
        shares = sorted((r.worst_share(name), r.title) for r in records if r.worst_share(name) is not None)
        if shares:
            low, high = shares[0], shares[-1]
            lines.append(f"`{name}` {low[0]:.2g} ({low[1]}) to {high[0]:.2g} ({high[1]})")
    return f"A thousandth of the pixels holds this share of the squared error: {'; '.join(lines)}." if lines else ""


def _intro(records):
    first = records[0].data
    times = first["times"][-1]
    sizes = list(dict.fromkeys(f"{r.data['width']} x {r.data['height']}" for r in records))
    return (
        f"Time for equal error relative to `forest`, for one parameter: mean squared error times time after"
        f" {times:.2g} s with set-up, {first['repeats']} repeats, interleaved, with the standard error over repeats; in"
        f" brackets without the {100 * WORST:g} % of pixels with the largest error. {first['threads']} threads,"
        f" {' or '.join(sizes)} pixels, the reference"
        f" {first['reference']['seconds']:.2g} s of `{first['reference']['method']}`."
    )


def markdown(folder, again):
    """folder(part): where results lie. again: the command. Paragraphs and tables; None without results."""
    records = []
    for title, part, _ in ROWS:
        try:
            with open(os.path.join(folder(part), "compare.json"), encoding="utf-8") as stream:
                records.append(_Record(title, json.load(stream)))
        except (OSError, ValueError):
            continue
    if not records:
        return None
    beside = _mitsuba_table(records)
    pieces = [
        _intro(records), _first_table(records), _against(records, DIFFERENCES, "finite differences"),
        _biases(records), _tails(records),
        "Mitsuba 3 (`prb_projective`, octree) after its set-up, which is not counted; limn's is: time for equal"
        " error, as above." if beside else "",
        beside, _against(records, MITSUBA, "Mitsuba after its set-up") if beside else "",
        "All of it again:\n\n    " + shlex.join(again),
        "One part of it:\n\n    " + records[0].data["command"],
    ]
    return "\n\n".join(piece for piece in pieces if piece) + "\n"
