#!/usr/bin/env python3
"""Plants the faults of fault_list.py one at a time and tells which test of its own part catches each.

    tests/faults/faults.py [--only NAME ...] [--work FOLDER] [--jobs N] [--write]

Works in a copy of the tree in FOLDER (build/faults), built there. A fault is caught if its build of
the test program fails one of the tests of its part; the same tests pass without it. Results are kept
as they come: a run that is interrupted goes on where it ended, unless a source file has changed.
--write puts the table into tests/README.md. Ends with 1 if a fault was not caught.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import time

from fault_list import FAULTS

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TIMEOUT = 900  # seconds, of one run of tests
BEGIN, END = "<!-- faults -->\n", "<!-- end of faults -->\n"


def tracked_files():
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [n for n in names.split("\0") if n and os.path.isfile(os.path.join(ROOT, n))]


def contents(path):
    try:
        with open(path, "rb") as stream:
            return stream.read()
    except FileNotFoundError:
        return None


def copy_tree(work):
    """Copies what differs; returns a checksum of all that is compiled."""
    total = hashlib.sha256()
    names = tracked_files()
    for name in sorted(names):
        data = contents(os.path.join(ROOT, name))
        if name.endswith((".cpp", ".h", ".inc", ".txt")):
            total.update(name.encode() + data)
        to = os.path.join(work, name)
        if contents(to) == data:
            continue
        os.makedirs(os.path.dirname(to), exist_ok=True)
        shutil.copy(os.path.join(ROOT, name), to)
    return total.hexdigest()


class Tree:
    """A copy of the tree, with its build."""

    def __init__(self, work, jobs):
        self.source = os.path.join(work, "tree")
        self.build = os.path.join(work, "build")
        self.jobs = jobs
        self.checksum = copy_tree(self.source)
        if not os.path.exists(os.path.join(self.build, "build.ninja")):
            options = ["-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DLIMN_PYTHON=OFF"]
            self.call(["cmake", "-S", self.source, "-B", self.build, *options])

    def call(self, command):
        environment = {**os.environ, "CCACHE_BASEDIR": self.source}
        run = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        if run.returncode != 0:
            sys.exit(f"{' '.join(command)}:\n{run.stdout[-3000:]}{run.stderr[-2000:]}")

    def failed_test(self, program, tests):
        """The first test that fails; None if all pass."""
        self.call(["ninja", "-C", self.build, f"-j{self.jobs}", program])
        command = [os.path.join(self.build, "tests", program), f"--gtest_filter={tests}",
                   "--gtest_fail_fast"]
        try:
            run = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=False)
        except subprocess.TimeoutExpired:
            return "no end"
        if re.search(r"^Note|0 tests from 0", run.stdout) and "[ RUN" not in run.stdout:
            sys.exit(f"{program}: no tests are called {tests}")
        failed = re.search(r"^\[  FAILED  \] ([\w./]+)", run.stdout, re.MULTILINE)
        if failed:
            return failed[1]
        if run.returncode == 0:
            return None
        started = re.findall(r"^\[ RUN      \] (\S+)", run.stdout, re.MULTILINE)
        return started[-1] if started else sys.exit(f"{program}: {run.stderr[-1000:]}")

    def with_fault(self, fault):
        path = os.path.join(self.source, fault.file)
        with open(path, encoding="utf-8") as stream:
            right = stream.read()
        if right.count(fault.old) != 1:
            sys.exit(f"{fault.name}: its text occurs {right.count(fault.old)} times in {fault.file}")
        try:
            with open(path, "w", encoding="utf-8") as stream:
                stream.write(right.replace(fault.old, fault.new))
            return self.failed_test(fault.program, fault.tests)
        finally:
            with open(path, "w", encoding="utf-8") as stream:
                stream.write(right)


class Results:
    """What is done, in a file that is replaced after every fault."""

    def __init__(self, file, checksum):
        self.file, self.checksum = file, checksum
        self.caught = {}
        if os.path.exists(file):
            with open(file, encoding="utf-8") as stream:
                self.caught = json.load(stream)

    def key(self, *parts):
        return hashlib.sha256("\0".join([self.checksum, *parts]).encode()).hexdigest()

    def keep(self, key, caught):
        self.caught[key] = caught
        with open(self.file + ".new", "w", encoding="utf-8") as stream:
            json.dump(self.caught, stream)
        os.replace(self.file + ".new", self.file)


def jobs_of(faults):
    """Every set of tests without a fault, then the faults: (what, program, tests, fault or None)."""
    jobs = [("without a fault", *pair, None) for pair in dict.fromkeys((f.program, f.tests) for f in faults)]
    return jobs + [(f"{f.part}: {f.name}", f.program, f.tests, f) for f in faults]


def run(faults, tree, results):
    """{fault: the test that caught it, or None}"""
    jobs = jobs_of(faults)
    keys = [results.key(w, p, t, *((f.file, f.old, f.new) if f else ())) for w, p, t, f in jobs]
    left = sum(key not in results.caught for key in keys)
    begin, done, caught = time.time(), 0, {}
    for key, (what, program, tests, fault) in zip(keys, jobs):
        if key not in results.caught:
            found = tree.with_fault(fault) if fault else tree.failed_test(program, tests)
            results.keep(key, found)
            done += 1
            seconds = (time.time() - begin) / done * (left - done)
            print(f"{done}/{left} {what}: {found or ('NOT CAUGHT' if fault else 'passes')} ({program})"
                  f", {seconds / 60:.0f} min left", flush=True)
        if fault:
            caught[fault] = results.caught[key]
        elif results.caught[key]:
            sys.exit(f"{program} fails without a fault: {results.caught[key]}")
    return caught


def listed(faults, caught):
    """Each fault with the test that caught it."""
    return "".join(f"{f.part}: {f.name}: {caught[f] or 'NOT CAUGHT'}\n" for f in faults)


def table(faults, caught):
    """Of every part, how many of its faults its tests caught, and their programs."""
    lines = ["| part | caught | by |", "|---|---|---|"]
    for part in dict.fromkeys(f.part for f in faults):
        own = [f for f in faults if f.part == part]
        programs = dict.fromkeys(f"`{f.program}`" for f in own if caught[f])
        found = sum(bool(caught[f]) for f in own)
        lines.append(f"| {part} | {found} of {len(own)} | {', '.join(programs)} |")
    return "\n".join(lines) + "\n"


def write(text):
    page = os.path.join(ROOT, "tests", "README.md")
    with open(page, encoding="utf-8") as stream:
        before, rest = stream.read().split(BEGIN)
    with open(page, "w", encoding="utf-8") as stream:
        stream.write(before + BEGIN + text + END + rest.split(END)[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", help="names of faults or parts")
    parser.add_argument("--work", default=os.path.join(ROOT, "build", "faults"))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    faults = [f for f in FAULTS if not options.only or {f.part, f.name} & set(options.only)]
    os.makedirs(options.work, exist_ok=True)
    tree = Tree(options.work, options.jobs)
    results = Results(os.path.join(options.work, "results.json"), tree.checksum)
    try:
        caught = run(faults, tree, results)
    except KeyboardInterrupt:
        sys.exit("interrupted; what is done is kept")
    print(listed(faults, caught), end="")
    if options.write:
        if options.only:
            sys.exit("--write takes all faults, not --only some")
        write(table(faults, caught))
    missed = [fault for fault, test in caught.items() if not test]
    print(f"{len(caught) - len(missed)} of {len(caught)} faults caught")
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
