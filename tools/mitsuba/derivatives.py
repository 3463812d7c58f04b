#!/usr/bin/env python3
"""Checks derivatives in the scenes of a folder: `limn check`, and the same with --reverse.

    tools/mitsuba/derivatives.py DIR [-o FOLDER] [--only TEXT] [--film N] [--seconds N]
        [--minutes N] [--path DIR] [-D name=value] [--at-least N]

Scenes: those that limn opens (census.py). Copies of their XML have films of N by N pixels (8)
without a crop. In each, one parameter of each kind that `limn info` lists is checked four times. A
kind is the last part of a name, with its owner where that is a sensor or a light.

same paths: `limn check --same-paths`, of kinds that move nothing: the term interior against
differences along the same paths.

paths: `limn gradient` and `limn backward` along the same random paths (term interior), whose dot
products with a random adjoint must be equal but for rounding. Reverse mode has no other term where
nothing moves.
reverse: `limn check --reverse`, all terms, where something moves. All kinds of a scene share a run,
and those that it cannot tell a longer one. A check agrees if an error as large as the derivative
would show.
forward: `limn check`. Samples grow from FIRST_SPP, for --seconds (12) of processor time at most,
where it cannot tell, those that want least first. Where a derivative is zero without noise, up to
three parameters of the kind are tried. Verdicts are those of `check`, which tells where an error of
a tenth of all terms' magnitudes would show; "agree coarsely" says that one as large as the whole
derivative would.

An array moves along one field (vertices by the same vector, texels by the same amount), or by one
of its numbers; in `check --reverse` along a random one. Scenes with smooth lobes have the first
two checks alone: edges seen by way of these are missing, which `check` says itself.

Results are kept in FOLDER/results.json (out/derivatives) and a later call goes on from there; after
a change of limn, remove it. The exit status is 1 where a check disagrees, or fewer than --at-least
agree.
"""

import argparse
import collections
import json
import math
import os
import re
import subprocess
import sys
import time

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import census  # noqa: E402
import common  # noqa: E402
import exr  # noqa: E402

FIRST_SPP = 256
GROWTH = 4  # of the samples, from run to run
REVERSE_SPP = 64
PATHS_SPP = 16
# The pixels of gradients are rounded to floats, as are the numbers of arrays.
ROUNDING = 2.0**-23
CANCELS = 2.0**-44  # of the scene's largest derivative: what rounding leaves of light that cancels
TRIES = 3
# Quantiles of a normal score: the two-sided level of `check`, 1e-4, and 95 % power.
VISIBLE = 3.89 + 1.64
SIZE = re.compile(r'(<integer\s+name\s*=\s*"(?:width|height)"\s+value\s*=\s*)"[^"]*"')
CROP = re.compile(r'<integer\s+name\s*=\s*"crop_\w+"[^>]*>')
SMOOTH = re.compile(r"\b(conductor|dielectric|thindielectric|plastic)\b")
# Of what a check can see, by its time (integrators/compare/check.cpp).
TIME_POWER = 2.5
WANTED = 0.1  # of an error that shows, over all terms' magnitudes
COARSELY, ZERO = "agree coarsely", "agree: zero"
FORWARD, REVERSE, PATHS, SAME = "forward", "reverse", "paths", "same paths"
# Kinds whose derivative has terms of edges or of the filter.
MOVES = re.compile(r"sensor\..*|(light\.)?(translate|rotate|scale|vertex_positions|displacement)")
DECIDED = ("disagree", "agree", "not complete")


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


def forward_result(report):
    verdict, within = report["verdict"], report["within"]
    visible = report["visible"].get("total")
    if verdict == "agree" and not report["gradient_sum_stderr"] and within == 0:
        verdict = ZERO
    if verdict == "cannot tell" and not report["bends"] and visible and visible <= 1:
        verdict = COARSELY
    keys = ("spp", "within", "p", "gradient_sum", "gradient_sum_stderr", "difference_sum",
            "difference_sum_stderr", "smallest_at", "suspects", "bends", "step")
    growth = max(1, within / WANTED)**TIME_POWER if within is not None else math.inf
    return {"growth": math.inf if report["bends"] else growth,
            **{key: report[key] for key in keys if key in report}, "verdict": verdict}


def reverse_result(report):
    errors = report["forward_stderr"] or 0, report["reverse_stderr"] or 0
    largest = max(abs(report["forward"]), abs(report["reverse"]))
    verdict = report["verdict"]
    if verdict == "agree" and VISIBLE * math.hypot(*errors) > largest:
        verdict = "cannot tell"
    elif verdict == "agree" and largest == 0:
        verdict = ZERO
    return {"verdict": verdict, **{key: report[key] for key in ("p", "z", "forward", "reverse")}}


def first_of(runs, *verdicts):
    for verdict in verdicts:
        for run in runs:
            if run["verdict"] == verdict:
                return run
    return None


class Check:
    """One mode of one kind in one scene: what was run and what may be next."""

    def __init__(self, scene, kind, mode, candidates, kept):
        self.scene, self.kind, self.mode, self.candidates = scene, kind, mode, candidates
        self.runs = kept  # {parameter: the last result}
        self.rank = 0  # of those without a run: the first of every kind come first

    def result(self):
        """The one that decides, or has come nearest to that."""
        runs = sorted(self.runs.values(), key=lambda run: run.get("growth", math.inf))
        return first_of(runs, *DECIDED, COARSELY, "cannot tell", ZERO, "refused") or {
            "verdict": "not run"}

    def next(self, most_seconds):
        """(order, parameter, samples) of a forward run, or None where nothing is left."""
        if first_of(self.runs.values(), *DECIDED):
            return None
        open_runs = [(p, r) for p, r in self.runs.items()
                     if r["verdict"] in (COARSELY, "cannot tell")]
        for parameter, run in open_runs:
            if GROWTH * run["seconds"] <= most_seconds and math.isfinite(run["growth"]):
                return run["growth"] * run["seconds"], parameter, GROWTH * run["spp"]
        untried = [name for name, _ in self.candidates if name not in self.runs]
        if open_runs or not untried:
            return None
        return self.rank - 1e6, untried[0], FIRST_SPP


class Scene:
    def __init__(self, file, name, options):
        self.file, self.name, self.options = file, name, options

    def read(self, limn, folder):
        file = os.path.join(folder, "info.json")
        command = [limn, "info", self.file, *self.options]
        self.description = subprocess.run(command + ["--json", file], capture_output=True,
                                          text=True, check=True).stdout
        self.info = common.read_json(file)
        bsdfs = " ".join(re.sub(r"bitmap \S+", "", s["bsdf"]) for s in self.info["shapes"])
        self.smooth = bool(SMOOTH.search(bsdfs))


def run_check(arguments, scene, options):
    """The reports of `limn check`, or None; and its message."""
    file = os.path.join(arguments.output, "check.json")
    if os.path.exists(file):
        os.remove(file)
    command = [arguments.limn, "check", scene.file, "--threads", "1", "--quiet", "--json", file,
               *scene.options, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    errors = [line for line in done.stderr.splitlines() if "warning:" not in line]
    return common.read_json(file), "\n".join(errors)[:300] or f"exit status {done.returncode}"


def user_seconds():
    return os.times().children_user


def run_forward(arguments, check, parameter, spp):
    scene = check.scene
    wrt = direction_of(arguments.output, parameter, dict(check.candidates)[parameter],
                       scene.description)
    before = user_seconds()
    reports, message = run_check(arguments, scene, ["--wrt", wrt, "--spp", str(spp)])
    result = forward_result(reports[0]) if reports else {"verdict": "refused", "message": message}
    check.runs[parameter] = {**result, "wrt": wrt, "spp": spp, "seconds": user_seconds() - before}


def run_same(arguments, scene, checks):
    """All kinds of a scene in one run; or each in its own, where one is refused."""
    wrts = [direction_of(arguments.output, *check.candidates[0], scene.description)
            for check in checks]
    reports, message = run_check(arguments, scene, [
        "--same-paths", "--seed", "1", "--spp", str(PATHS_SPP),
        *[option for wrt in wrts for option in ("--wrt", wrt)]])
    if not reports and len(checks) > 1:
        for check in checks:
            run_same(arguments, scene, [check])
        return
    for check, wrt, report in zip(checks, wrts, reports or [{"verdict": "refused"}]):
        if report["verdict"] == "refused":
            report["message"] = message
        elif report["gradient_sum"] == report["error"] == 0:
            report["verdict"] = ZERO
        check.runs[check.candidates[0][0]] = {"wrt": wrt, **report}


def run_limn(arguments, scene, command, options):
    """The error message, "" where it ran."""
    done = subprocess.run([arguments.limn, command, scene.file, "--threads", "1", "--quiet",
                           "--method", "forest", "--terms", "interior", "--seed", "1", "--spp",
                           str(PATHS_SPP), *scene.options, *options],
                          capture_output=True, text=True, check=False)
    return done.stderr[-300:] or "failed" if done.returncode else ""


def reverse_numbers(entry, wrt):
    """Of a parameter of `limn backward`, those that a direction of forward mode moves, at 1."""
    if "array" not in entry:
        return np.atleast_1d(entry["value"])
    numbers = np.load(entry["array"]).astype(float)
    if ".displacement." in wrt:  # copies of the first vertex share its derivative
        return numbers[numbers == numbers[0]]
    if ":" not in wrt:
        return numbers.ravel()[:1]
    return numbers[:, 0] if entry["name"].endswith(".vertex_positions") else numbers


def run_paths(arguments, scene, checks):
    """Compares both modes along the same paths; where one parameter is refused, each alone."""
    names = [check.candidates[0][0] for check in checks]
    wrts = [direction_of(arguments.output, *check.candidates[0], scene.description)
            for check in checks]
    stem, folder, adjoint_file = (os.path.join(arguments.output, name)
                                  for name in ("paths", "paths_reverse", "adjoint.exr"))
    message = run_limn(arguments, scene, "gradient", [
        "--samples", "1", "-o", stem + ".exr", *[x for wrt in wrts for x in ("--wrt", wrt)]])
    if not message:
        files = [stem + "".join(["_" + re.sub("[^A-Za-z0-9.-]", "_", wrt)] * (len(wrts) > 1)) + ".exr"
                 for wrt in wrts]
        images = [np.stack([exr.read(file)[c] for c in "RGB"]) for file in files]
        adjoint = np.random.default_rng(1).random(images[0].shape[1:], dtype=np.float32)
        with open(adjoint_file, "wb") as stream:
            stream.write(exr.rgb_bytes(adjoint))
        adjoint = exr.read(adjoint_file)["R"].astype(float)  # rounded to halves
        message = run_limn(arguments, scene, "backward", [
            "--pixels", "uniform", "--adjoint", adjoint_file, "-o", folder,
            *[x for name in names for x in ("--wrt", name)]])
    if message and len(checks) > 1:
        for check in checks:
            run_paths(arguments, scene, [check])
        return
    if message:
        checks[0].runs[names[0]] = {"wrt": wrts[0], "verdict": "refused", "message": message}
        return
    entries = common.read_json(os.path.join(folder, "gradient.json"))["parameters"]
    both = [(adjoint * image, reverse_numbers(entry, wrt))
            for image, entry, wrt in zip(images, entries, wrts)]
    sizes = [np.abs(products).sum() + np.abs(numbers).sum() for products, numbers in both]
    for i, (products, numbers) in enumerate(both):
        forward, reverse = products.sum(), numbers.sum()
        most = ROUNDING * sizes[i] + CANCELS * max(sizes)
        verdict = "disagree" if abs(forward - reverse) > most else "agree" if sizes[i] else ZERO
        checks[i].runs[names[i]] = {"wrt": wrts[i], "verdict": verdict, "forward": forward,
                                    "reverse": reverse, "rounding": most}


def run_reverse(arguments, scene, checks, spp=REVERSE_SPP):
    """The first parameters of the checks in one run, and once more with samples for --seconds of
    processor time; or each in its own, where one is refused."""
    names = [check.candidates[0][0] for check in checks]
    options = [option for name in names for option in ("--wrt", name)]
    before = user_seconds()
    reports, message = run_check(arguments, scene, ["--reverse", "--spp", str(spp), *options])
    seconds = user_seconds() - before
    if not reports and len(checks) > 1:
        for check in checks:
            run_reverse(arguments, scene, [check])
        return
    for check, name in zip(checks, names):
        # A colour has a report for each channel.
        runs = [reverse_result(report) for report in reports or []
                if report["parameter"] in (name, *(f"{name}.{c}" for c in "rgb"))]
        result = first_of(runs, "disagree", "cannot tell", "agree", ZERO)
        check.runs[name] = {"wrt": name, "spp": spp,
                            **(result or {"verdict": "refused", "message": message})}
    more = int(spp * arguments.seconds / seconds)
    unclear = [check for check in checks if check.result()["verdict"] == "cannot tell"]
    if unclear and spp == REVERSE_SPP and more > spp:
        run_reverse(arguments, scene, unclear, more)


def modes_of(scene, moves):
    edges = [] if scene.smooth else [REVERSE, FORWARD] if moves else [FORWARD]
    return [*([] if moves else [SAME]), PATHS, *edges]


def checks_of(scenes, results):
    checks = [Check(scene, kind, mode, candidates,
                    results.setdefault(f"{scene.name} {kind} {mode}", {}))
              for scene in scenes for kind, candidates in kinds_of(scene.info).items()
              for mode in modes_of(scene, MOVES.fullmatch(kind))]
    before = collections.Counter()
    for check in checks:
        before[check.kind, check.mode] += 1
        check.rank = before[check.kind, check.mode]
    return checks


def work_off(arguments, checks, results):
    """Runs along equal paths, reverse runs, then the forward run that comes first, until the
    time is over."""
    end = time.monotonic() + 60 * arguments.minutes

    def keep(done):
        common.write_json(os.path.join(arguments.output, "results.json"), results)
        for check in done:
            run = list(check.runs.values())[-1]
            print(f"{check.scene.name:58} {check.mode} {run['wrt']}: {run['verdict']}", flush=True)

    for mode, run_mode in ((SAME, run_same), (PATHS, run_paths), (REVERSE, run_reverse)):
        left = collections.defaultdict(list)
        for check in checks:
            if check.mode == mode and not check.runs:
                left[check.scene].append(check)
        for scene, some in left.items():
            if time.monotonic() < end:
                run_mode(arguments, scene, some)
                keep(some)
    forward = [check for check in checks if check.mode == FORWARD]
    steps = {i: check.next(arguments.seconds) for i, check in enumerate(forward)}
    steps = {i: step for i, step in steps.items() if step}
    while steps and time.monotonic() < end:
        i = min(steps, key=lambda i: steps[i][0])
        _, parameter, spp = steps.pop(i)
        run_forward(arguments, forward[i], parameter, spp)
        keep([forward[i]])
        step = forward[i].next(arguments.seconds)
        if step:
            steps[i] = step
    return len(steps)


def print_table(checks):
    verdicts = ("agree", COARSELY, ZERO, "cannot tell", "not complete", "refused", "not run",
                "disagree")
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


def print_scenes(mode, checks):
    verdicts = collections.defaultdict(set)
    for check in checks:
        verdicts[check.scene.name].add(check.result()["verdict"])
    agree = {"agree", COARSELY, ZERO}
    told = sum(bool(v & agree) and "disagree" not in v for v in verdicts.values())
    print(f"{mode}: all kinds agree in {sum(v <= agree for v in verdicts.values())} of "
          f"{len(verdicts)} scenes, all that could be told in {told}, "
          f"{sum('disagree' in v for v in verdicts.values())} disagree")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", metavar="FOLDER",
                        default=os.path.join(common.ROOT, "out", "derivatives"))
    parser.add_argument("--only", default="", metavar="TEXT",
                        help="scenes whose path contains this")
    parser.add_argument("--film", type=int, default=8, metavar="N", help="pixels of a side")
    parser.add_argument("--seconds", type=common.positive, default=12, metavar="N",
                        help="of processor time for one forward check, at most")
    parser.add_argument("--minutes", type=common.positive, default=60, metavar="N",
                        help="of this call")
    arguments = census.read_arguments(parser)
    copies = os.path.join(arguments.output, "scenes")
    copy_scenes(arguments.folder, copies, arguments.film)
    scenes = []
    for file in census.find_scenes(copies):
        name = os.path.relpath(file, copies)
        if arguments.only not in name:
            continue
        message, options = census.open_scene(arguments.limn, file, arguments.defines,
                                             arguments.path)
        if message:
            continue
        scene = Scene(file, name, options)
        scene.read(arguments.limn, arguments.output)
        scenes.append(scene)
    results = common.read_json(os.path.join(arguments.output, "results.json")) or {}
    checks = checks_of(scenes, results)
    left = work_off(arguments, checks, results)
    print_table(checks)
    counts = collections.Counter(check.result()["verdict"] for check in checks)
    print(f"{counts['agree']} of {len(checks)} checks agree, {counts[COARSELY]} more coarsely, "
          f"{counts[ZERO]} are zero, {counts['disagree']} disagree, in {len(scenes)} scenes "
          f"({sum(scene.smooth for scene in scenes)} with smooth lobes); {left} can go on")
    for mode in (SAME, PATHS, REVERSE, FORWARD):
        print_scenes(mode, [check for check in checks if check.mode == mode])
    return 1 if counts["disagree"] or counts["agree"] < arguments.at_least else 0


if __name__ == "__main__":
    sys.exit(main())
