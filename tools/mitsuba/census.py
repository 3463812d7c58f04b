#!/usr/bin/env python3
"""Counts the scenes of a folder that limn opens, and says why it refuses the others.

    tools/mitsuba/census.py DIR [--path DIR] [-D name=value] [--at-least N]

A scene is an XML file that has a sensor, its own or by `include`, and that no other file includes.
Each goes through `limn info`. A parameter without a default gets the value of -D, else 16 (path for
an integrator). The table lists reasons by the number of scenes that they keep out; below it stands
every refusal. With --at-least the exit status is 1 where fewer scenes open. For a clone of
mitsuba-data the bar is 110 of 148.
"""

import argparse
import collections
import concurrent.futures
import os
import re
import subprocess
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import common  # noqa: E402

SECONDS = 120  # for one scene
VALUES = {"integrator": "path"}  # of parameters without a default, else 16
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
INCLUDE = re.compile(r'<include\s+filename\s*=\s*"([^"]*)"')
UNDEFINED = re.compile(r'undefined parameter "\$(\w+)"')


def read_text(file):
    with open(file, encoding="utf-8", errors="replace") as stream:
        return COMMENT.sub("", stream.read())


def find_scenes(folder):
    """The scenes below a folder, sorted."""
    files = [os.path.join(here, name) for here, _, names in os.walk(folder) for name in names
             if name.endswith(".xml")]
    texts = {os.path.normpath(file): read_text(file) for file in files}

    def includes(file):
        names = INCLUDE.findall(texts[file])
        paths = [os.path.normpath(os.path.join(os.path.dirname(file), name)) for name in names]
        return [path for path in paths if path in texts]

    def has_sensor(file, depth=0):
        return depth < 15 and ("<sensor" in texts[file]
                               or any(has_sensor(part, depth + 1) for part in includes(file)))

    included = {part for file in texts for part in includes(file)}
    return sorted(file for file in texts if file not in included and has_sensor(file))


def open_scene(limn, scene, defines, paths):
    """The error message of `limn info`, "" where it opens the scene; and the options for that."""
    values = dict(defines)
    while True:
        options = []
        for name, value in values.items():
            options += ["-D", f"{name}={value}"]
        for path in paths:
            options += ["--path", path]
        command = [limn, "info", scene, "--quiet", *options]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
        except subprocess.TimeoutExpired:
            return f"took more than {SECONDS} s", options
        errors = [line for line in done.stderr.splitlines() if "warning:" not in line]
        message = "\n".join(errors).strip()
        missing = UNDEFINED.search(message)
        if missing and missing[1] not in values:
            values[missing[1]] = VALUES.get(missing[1], "16")
            continue
        if done.returncode == 0:
            return "", options
        return message or f"exit status {done.returncode}", options


def reason_of(message):
    """A message without its place and without what is known there."""
    return re.sub(r" \(known: .*", "", re.sub(r"^.*?error: ", "", message.splitlines()[0]))


def read_arguments(parser):
    """Those of a tool that opens all scenes of a folder, with limn found and defines in pairs."""
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument("--path", action="append", default=[], metavar="DIR")
    parser.add_argument("-D", dest="defines", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--at-least", type=int, default=0, metavar="N")
    parser.add_argument("--limn", metavar="PROGRAM", help="use this one (default: build/limn)")
    arguments = parser.parse_args()
    arguments.limn = common.find_limn(arguments.limn)
    arguments.defines = [define.split("=", 1) for define in arguments.defines]
    return arguments


def main():
    arguments = read_arguments(argparse.ArgumentParser(description=__doc__.splitlines()[0]))
    scenes = find_scenes(arguments.folder)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        messages = list(pool.map(lambda scene: open_scene(
            arguments.limn, scene, arguments.defines, arguments.path)[0], scenes))
    refused = [(scene, message) for scene, message in zip(scenes, messages) if message]
    reasons = collections.Counter(reason_of(message) for _, message in refused)
    print(f"{'scenes':>6}  reason")
    print(f"{len(scenes) - len(refused):6}  opened")
    for reason, count in sorted(reasons.items(), key=lambda row: (-row[1], row[0])):
        print(f"{count:6}  {reason}")
    print()
    for scene, message in refused:
        print(f"{os.path.relpath(scene, arguments.folder)}: {message}")
    opened = len(scenes) - len(refused)
    print(f"\n{opened} of {len(scenes)} scenes open")
    return 0 if opened >= arguments.at_least else 1


if __name__ == "__main__":
    sys.exit(main())
