#!/usr/bin/env python3
"""Checks derivatives in the scenes of a folder: `limn check`, and the same with --reverse.

    tools/mitsuba/derivatives.py DIR [-o FOLDER] [--only TEXT] [--film N] [--seconds N]
        [--minutes N] [--path DIR] [-D name=value] [--at-least N]

Scenes: those that limn opens (census.py), without smooth lobes (edges seen by way of these are
missing, which `check` says itself). Copies of their XML have films of N by N pixels (16) without a
crop. In each, one parameter of each kind that `limn info` lists is checked twice: against finite
differences, and reverse mode against forward mode. A kind is the last part of a name, with its
owner where that is a sensor or a light.

A check that cannot tell is repeated with the samples that it asks for, cheapest first, as long as
that takes at most --seconds (20) of processor time by what the last run took. Beyond that,
up to three parameters of the kind are tried, and the cheapest continues. An array moves along one field
(vertices by the same vector, texels by the same amount), or by one of its numbers.
A reverse check is conclusive if an error as large as the derivative would show. A forward check is
so if an error of a fifth of each term would; "agree coarsely" says that one as large as the whole
derivative would have shown, which takes less time and is asked for first.

Results are kept in FOLDER/results.json (out/derivatives) and a later call goes on from there; after
a change of limn, remove it. The exit status is 1 where a check disagrees, or fewer than --at-least
agree. A disagreement in mitsuba-data: the opacity of a textured mask. Most texels are 0 or 1,
the ends of their range, beyond which nothing changes, so that central differences hold half of the
slope. With texels inside they agree.
"""

import argparse
import collections
import json
import math
import os
import re
import resource
import subprocess
import sys
import time

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import census  # noqa: E402
import common  # noqa: E402
import exr  # noqa: E402

FIRST_SPP = 64
MOST_GROWTH = 16  # of samples, from run to run
TRIES = 3
# Quantiles of a normal score: the two-sided level of `check`, 1e-4, and 95 % power.
VISIBLE = 3.89 + 1.64
SIZE = re.compile(r'(<integer\s+name\s*=\s*"(?:width|height)"\s+value\s*=\s*)"[^"]*"')
CROP = re.compile(r'<integer\s+name\s*=\s*"crop_\w+"[^>]*>')
SMOOTH = re.compile(r"\b(conductor|dielectric|thindielectric|plastic)\b")
# Of what a check can see, by its samples (integrators/compare/check.cpp).
SAMPLES_POWER = 2.5
COARSELY = "agree coarsely"
FORWARD, REVERSE = "forward", "reverse"


def copy_scenes(source, target, pixels):
    """XML files with small films, all other files as links."""
    for here, inner, names in os.walk(source):
        inner[:] = [name for name in inner if os.path.join(here, name) != os.path.dirname(target)]
        folder = os.path.join(target, os.path.relpath(here, source))
        os.makedirs(folder, exist_ok=True)
        for name in names:
            file, copy = os.path.join(here, name), os.path.join(folder, name)
            if name.endswith(".xml"):
                text = SIZE.sub(rf'\1"{pixels}"', CROP.sub("", census.read_text(file)))
                with open(copy, "w", encoding="utf-8") as stream:
                    stream.write(text)
            elif not os.path.lexists(copy):
                os.symlink(os.path.abspath(file), copy)


def kind_of(name, owners):
    """translate, sensor.fov, reflectance.data: what a parameter is, whatever it is called."""
    owner, _, rest = name.partition(".")
    for whose in ("sensors", "lights"):
        for thing in owners[whose]:
            if name.startswith(thing + "."):
                owner, rest = whose[:-1], name[len(thing) + 1:]
    parts = [part for part in re.sub(r"\.[xyz]$", "", rest).split(".")
             if not re.fullmatch(r"(bsdf|texture)(_\d+)?|emitter|\d+", part)]
    last = parts[-2:] if parts[-1] in ("data", "color0", "color1") else parts[-1:]
    return ".".join([owner] * (owner in ("sensor", "light")) + last)


def kinds_of(info):
    """Kind: parameters to try, those of few numbers first, then spread over the scene."""
    owners = {"sensors": [name or "sensor" for name in info["sensors"]],
              "lights": [light["name"] if isinstance(light, dict) else light
                         for light in info["lights"]]}
    kinds = collections.defaultdict(list)
    for parameter in info["parameters"]:
        kinds[kind_of(parameter["name"], owners)].append(parameter)
    for kind, all_of in kinds.items():
        all_of.sort(key=lambda parameter: parameter["size"])
        step = max(1, len(all_of) // TRIES)
        kinds[kind] = [(p["name"], p["size"]) for p in all_of[::step][:TRIES]]
    return kinds


def write_field(folder, size, description):
    """A file of equal vectors, or an equal change of all texels; None if neither has this size."""
    for width, height in re.findall(r"\((\d+) x (\d+)\)", description):
        width, height = int(width), int(height)
        if size == 3 * width * height:
            file = os.path.join(folder, f"ones_{width}_{height}.exr")
            with open(file, "wb") as stream:
                stream.write(exr.rgb_bytes(np.ones((height, width))))
            return file
    return None


def direction_of(folder, name, size, description):
    """The name that --wrt takes for an array, and for a number itself."""
    if size == 1:
        return name
    if name.endswith(".vertex_positions"):
        file = os.path.join(folder, f"x_{size // 3}.txt")
        with open(file, "w", encoding="utf-8") as stream:
            stream.write("1 0 0\n" * (size // 3))
        return f"{name}:{file}"
    file = write_field(folder, size, description)
    if file:
        return f"{name}:{file}"
    return name + (".0.0.r" if name.endswith(".data") else
                   ".0" if name.endswith(".displacement") else ".0.r")


def timed(command):
    """What a command did, and its processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done, sum(getattr(after, key) - getattr(before, key) for key in ("ru_utime", "ru_stime"))


def forward_result(report):
    needed = report["needed_spp"]
    verdict, visible = report["verdict"], report["visible"].get("total")
    coarse = report["spp"] * max(1, visible if visible is not None else math.inf)**SAMPLES_POWER
    if verdict == "cannot tell" and coarse <= report["spp"] and not report["bends"]:
        verdict = COARSELY
    keys = ("verdict", "p", "gradient_sum", "gradient_sum_stderr", "difference_sum",
            "difference_sum_stderr", "smallest_at", "suspect", "bends")
    return {"needed": math.inf if report["bends"] or not needed else needed,
            **{key: report[key] for key in keys if key in report},
            "verdict": verdict, "coarse": coarse, "visible": visible}


def reverse_result(report, spp):
    error = math.hypot(report["forward_stderr"] or math.inf, report["reverse_stderr"] or math.inf)
    ratio = VISIBLE * error / max(abs(report["forward"]), abs(report["reverse"]), 1e-300)
    verdict = report["verdict"]
    if verdict == "agree" and ratio > 1 and error > 0:
        verdict = "cannot tell"
    return {"verdict": verdict, "needed": min(1e12, spp * ratio**2),
            **{key: report[key] for key in ("p", "z", "forward", "reverse")}}


class Check:
    """One mode of one kind in one scene: what was run and what may be next."""

    def __init__(self, scene, kind, mode, candidates, kept):
        self.scene, self.kind, self.mode, self.candidates = scene, kind, mode, candidates
        self.runs = kept  # {parameter: the last result}
        self.rank = 0  # in place of seconds that are not known: the first of every kind come first

    def result(self):
        """The one that decides, or has come nearest to that."""
        runs = list(self.runs.values())
        for verdict in ("disagree", "agree", "not complete", COARSELY):
            for run in runs:
                if run["verdict"] == verdict:
                    return run
        runs.sort(key=lambda run: run.get("needed", math.inf))
        return runs[0] if runs else {"verdict": "not run"}

    def next(self, most_seconds):
        """(predicted seconds, parameter, samples per pixel), or None where nothing is left."""
        if self.result()["verdict"] in ("disagree", "agree", "not complete"):
            return None
        steps = []
        for parameter, run in self.runs.items():
            if run["verdict"] not in ("cannot tell", COARSELY):
                continue
            per_sample = run.get("per_sample", run["seconds"] / run["spp"])
            for needed in (run["needed"], run.get("coarse", math.inf)):
                wanted = max(2 * run["spp"], 1.2 * needed)
                if needed <= run["spp"] or not math.isfinite(needed):
                    continue
                if wanted * per_sample <= most_seconds * (4 if run["spp"] == FIRST_SPP else 1):
                    spp = int(min(wanted, MOST_GROWTH * run["spp"]))
                    steps.append((spp * per_sample, parameter, spp))
        untried = [name for name, _ in self.candidates if name not in self.runs]
        if not steps and untried:
            steps = [(self.rank + len(self.runs), untried[0], FIRST_SPP)]
        return min(steps) if steps else None


class Scene:
    def __init__(self, file, name, options):
        self.file, self.name, self.options = file, name, options

    def read(self, limn, folder):
        """False where the scene has smooth lobes."""
        file = os.path.join(folder, "info.json")
        command = [limn, "info", self.file, *self.options]
        self.description = subprocess.run(command + ["--json", file], capture_output=True,
                                          text=True, check=True).stdout
        self.info = common.read_json(file)
        bsdfs = " ".join(re.sub(r"bitmap \S+", "", s["bsdf"]) for s in self.info["shapes"])
        return not SMOOTH.search(bsdfs)


def run_check(limn, folder, check, parameter, spp):
    scene = check.scene
    size = dict(check.candidates)[parameter]
    wrt = parameter
    if check.mode == FORWARD:
        wrt = direction_of(folder, parameter, size, scene.description)
    file = os.path.join(folder, "check.json")
    if os.path.exists(file):
        os.remove(file)
    command = [limn, "check", scene.file, "--wrt", wrt, "--spp", str(spp), "--threads", "1",
               "--quiet", "--json", file, *scene.options]
    done, seconds = timed(command + ["--reverse"] * (check.mode == REVERSE))
    report = common.read_json(file)
    if not report:
        errors = [line for line in done.stderr.splitlines() if "warning:" not in line]
        result = {"verdict": "refused", "message": "\n".join(errors)[:300]}
    elif check.mode == FORWARD:
        result = forward_result(report[0])
    else:
        result = reverse_result(report[0], spp)
    return {"wrt": wrt, "spp": spp, "seconds": seconds, **result}


def checks_of(scenes, results):
    checks = [Check(scene, kind, mode, candidates,
                    results.setdefault(f"{scene.name} {kind} {mode}", {}))
              for scene in scenes for kind, candidates in kinds_of(scene.info).items()
              for mode in (FORWARD, REVERSE)]
    before = collections.Counter()
    for check in checks:
        before[check.kind, check.mode] += 1
        check.rank = 0.1 * before[check.kind, check.mode]
    return checks


def work_off(arguments, checks, results):
    """Runs the cheapest step of all, until none is left or the time is over."""
    end = time.monotonic() + 60 * arguments.minutes
    steps = {i: check.next(arguments.seconds) for i, check in enumerate(checks)}
    steps = {i: step for i, step in steps.items() if step}
    while steps and time.monotonic() < end:
        i = min(steps, key=lambda i: steps[i][0])
        check, (_, parameter, spp) = checks[i], steps.pop(i)
        result = run_check(arguments.limn, arguments.output, check, parameter, spp)
        last = check.runs.get(parameter)
        if last and last["spp"] < spp:  # without what pilots and files take
            slope = (result["seconds"] - last["seconds"]) / (spp - last["spp"])
            result["per_sample"] = max(slope, 0.2 * result["seconds"] / spp)
        check.runs[parameter] = result
        common.write_json(os.path.join(arguments.output, "results.json"), results)
        print(f"{check.scene.name:58} {check.mode} {parameter} {spp}: {result['verdict']}",
              flush=True)
        step = check.next(arguments.seconds)
        if step:
            steps[i] = step
    return len(steps)


def print_table(checks):
    verdicts = ("agree", COARSELY, "cannot tell", "not complete", "refused", "not run", "disagree")
    table = collections.defaultdict(collections.Counter)
    for check in checks:
        for row in (check.kind, "all " + check.mode):
            table[row][check.result()["verdict"]] += 1
    print(f"\n{'kind':36}" + "".join(f"{verdict:>15}" for verdict in verdicts))
    for row in sorted(table, key=lambda row: (row.startswith("all "), row)):
        print(f"{row:36}" + "".join(f"{table[row][verdict]:15}" for verdict in verdicts))
    for check in checks:
        result = check.result()
        if result["verdict"] in ("disagree", "refused"):
            print(f"{check.scene.name}: {check.mode} {json.dumps(result)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", metavar="FOLDER",
                        default=os.path.join(common.ROOT, "out", "derivatives"))
    parser.add_argument("--only", default="", metavar="TEXT",
                        help="scenes whose path contains this")
    parser.add_argument("--film", type=int, default=16, metavar="N", help="pixels of a side")
    parser.add_argument("--seconds", type=common.positive, default=20, metavar="N",
                        help="of one check (processor time)")
    parser.add_argument("--minutes", type=common.positive, default=60, metavar="N",
                        help="of this call")
    arguments = census.read_arguments(parser)
    copies = os.path.join(arguments.output, "scenes")
    copy_scenes(arguments.folder, copies, arguments.film)
    scenes, smooth = [], 0
    for file in census.find_scenes(copies):
        name = os.path.relpath(file, copies)
        if arguments.only not in name:
            continue
        message, options = census.open_scene(arguments.limn, file, arguments.defines,
                                             arguments.path)
        if message:
            continue
        scene = Scene(file, name, options)
        if scene.read(arguments.limn, arguments.output):
            scenes.append(scene)
        else:
            smooth += 1
    results = common.read_json(os.path.join(arguments.output, "results.json")) or {}
    checks = checks_of(scenes, results)
    left = work_off(arguments, checks, results)
    print_table(checks)
    counts = collections.Counter(check.result()["verdict"] for check in checks)
    told = [s.name for s in scenes
            if {c.result()["verdict"] for c in checks if c.scene is s} == {"agree"}]
    print(f"{counts['agree']} of {len(checks)} checks agree, {counts[COARSELY]} more coarsely, "
          f"{counts['disagree']} disagree, in "
          f"{len(scenes)} scenes ({smooth} more have smooth lobes); in {len(told)} all agree; "
          f"{left} checks can go on")
    return 1 if counts["disagree"] or counts["agree"] < arguments.at_least else 0


if __name__ == "__main__":
    sys.exit(main())
