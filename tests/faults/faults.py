#!/usr/bin/env python3
"""Mutation tests: plants the faults of fault_list.py one at a time; tells which test catches each.

    tests/faults/faults.py [--only NAME ...] [--jobs N] [--write]

Takes the objects and libraries of build/, which must be up to date (tools/build): a fault costs
the time to compile its file, to link its test program and to run the tests of its part. It is
caught if one of them fails; they pass without it. Results are kept as they come in build/faults: a
run that is interrupted goes on where it ended, and repeats what a changed program would do. --write
puts them into tests/faults/caught.csv. Ends with 1 if a fault was not caught.
"""

import argparse
import concurrent.futures
import csv
import glob
import hashlib
import json
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
import threading
import time

from fault_list import FAULTS

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = os.path.join(ROOT, "build")
LIMN = os.path.join(BUILD, "limn")
WORK = os.path.join(BUILD, "faults")
TABLE = os.path.join(ROOT, "tests", "faults", "caught.csv")
HEAD = ["part", "fault", "program", "caught by"]
TIMEOUT = 900  # seconds, of one run of tests


def checksum(files):
    total = hashlib.sha256()
    for name in files:
        with open(name, "rb") as stream:
            total.update(stream.read())
    return total.hexdigest()


def call(command, **settings):
    run = subprocess.run(command, capture_output=True, text=True, check=False, **settings)
    if run.returncode != 0:
        raise RuntimeError(f"{shlex.join(command)}:\n{run.stdout[-3000:]}{run.stderr[-3000:]}")
    return run.stdout


class Build:
    """What build/ holds, and how its files came to be."""

    def __init__(self):
        with open(os.path.join(BUILD, "compile_commands.json"), encoding="utf-8") as stream:
            entries = json.load(stream)
        # Of a file that is compiled twice the first is the library's.
        self.entries = {e["file"]: e for e in reversed(entries)}
        self.launcher = os.environ.get("CMAKE_CXX_COMPILER_LAUNCHER", "").split()

    def module(self):
        found = glob.glob(os.path.join(BUILD, "python", "limn", "_limn*.so"))
        if not found:
            sys.exit("build/ has no Python module: see tools/python/README.md")
        return found[0]

    def output(self, program):
        """Its file, relative to build/."""
        if program == "python":
            return os.path.relpath(self.module(), BUILD)
        return program if program == "limn" else f"tests/{program}"

    def checksum(self, program):
        """Of a program without a fault, and of its tests."""
        names = [os.path.join(BUILD, self.output(program))]
        if program == "python":
            names += sorted(glob.glob(os.path.join(BUILD, "python", "limn", "*.py")))
            names += sorted(glob.glob(os.path.join(ROOT, "tests", "python", "*.py")))
        return checksum(names)

    def compiled(self, name, fault, folder):
        """A file that is the faulty one or includes it: its object in build/, and another."""
        path = os.path.join(ROOT, name)
        entry = self.entries[path]
        words = shlex.split(entry["command"])
        at = words.index("-o") + 1
        planted = os.path.join(folder, name.replace("/", "-") + ".o")
        right, words[at] = words[at], planted
        if name == fault.file:
            words = [os.path.join(folder, name) if word == path else word for word in words]
        # A fault may leave something unused. Compiling takes longer than the tests: -O1.
        words = [words[0], f"-I{folder}", *words[1:], "-w", "-O1"]
        call([*self.launcher, *words], cwd=entry["directory"])
        return right, planted

    def linked(self, program, objects, folder):
        """The program with other objects in place of its own and in front of the libraries."""
        output = self.output(program)
        commands = call(["ninja", "-C", BUILD, "-t", "commands", "-s", output])
        words = shlex.split(commands.strip().splitlines()[-1].split(" && ")[1])
        planted = os.path.join(folder, output)
        os.makedirs(os.path.dirname(planted), exist_ok=True)
        words = [planted if word == output else word for word in words if word not in objects]
        at = words.index(planted) + 1
        call([*words[:at], *objects.values(), *words[at:]], cwd=BUILD)
        return planted


def failed_case(file, tests, environment):
    """Of a program of GoogleTest: the first test that fails; None if all pass."""
    command = [file, f"--gtest_filter={tests}", "--gtest_throw_on_failure"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, env=environment,
                         cwd=os.path.join(BUILD, "tests"), check=False)
    started = re.findall(r"^\[ RUN      \] (\S+)", run.stdout, re.MULTILINE)
    if not started:
        raise RuntimeError(f"{shlex.join(command)} runs no test:\n{run.stdout}{run.stderr[-1000:]}")
    return None if run.returncode == 0 else started[-1]


def failed_script(module, tests, environment):
    """The same of a file of tests of the Python module."""
    environment["PYTHONPATH"] = os.path.dirname(os.path.dirname(module))
    command = [os.path.join(BUILD, "venv", "bin", "python"), "-m", "pytest", "-q", "-x", "-p",
               "no:cacheprovider", os.path.join(ROOT, "tests", "python", tests)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, env=environment,
                         cwd=ROOT, check=False)
    if run.returncode == 0:
        return None
    failed = re.search(r"^FAILED \S+::(\S+)", run.stdout, re.MULTILINE)
    if not failed:
        raise RuntimeError(f"{shlex.join(command)}:\n{run.stdout[-3000:]}")
    return failed[1]


def failed_test(program, tests, file, limn):
    environment = {**os.environ, "LIMN_PROGRAM": limn, "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        return (failed_script if program == "python" else failed_case)(file, tests, environment)
    except subprocess.TimeoutExpired:
        return "no end"


def with_fault(fault, build):
    """The test that catches it, or None."""
    folder = os.path.join(WORK, re.sub(r"\W+", "_", f"{fault.part} {fault.name}"))
    shutil.rmtree(folder, ignore_errors=True)
    with open(os.path.join(ROOT, fault.file), encoding="utf-8") as stream:
        right = stream.read()
    if right.count(fault.old) != 1:
        raise RuntimeError(f"{fault.name}: {right.count(fault.old)} such texts in {fault.file}")
    planted = os.path.join(folder, fault.file)
    os.makedirs(os.path.dirname(planted))
    with open(planted, "w", encoding="utf-8") as stream:
        stream.write(right.replace(fault.old, fault.new))
    try:
        sources = fault.sources or (fault.file,)
        objects = dict(build.compiled(name, fault, folder) for name in sources)
        program = build.linked(fault.program, objects, folder)
        limn = build.linked("limn", objects, folder) if fault.program == "test_program" else LIMN
        if fault.program == "python":
            for name in glob.glob(os.path.join(BUILD, "python", "limn", "*.py")):
                shutil.copy(name, os.path.dirname(program))
        return failed_test(fault.program, fault.tests, program, limn)
    finally:
        shutil.rmtree(folder)


class Results:
    """What is done, in a file that is replaced after every run of tests."""

    def __init__(self):
        self.file, self.lock, self.caught = os.path.join(WORK, "results.json"), threading.Lock(), {}
        if os.path.exists(self.file):
            with open(self.file, encoding="utf-8") as stream:
                self.caught = json.load(stream)

    def keep(self, key, caught):
        with self.lock:
            self.caught[key] = caught
            with open(self.file + ".new", "w", encoding="utf-8") as stream:
                json.dump(self.caught, stream)
            os.replace(self.file + ".new", self.file)


class Job:
    """A run of tests, with a fault or, where it is None, without."""

    def __init__(self, program, tests, fault=None):
        self.program, self.tests, self.fault = program, tests, fault
        self.name = f"{fault.part}: {fault.name}" if fault else f"without a fault: {program} {tests}"

    def run(self, build, results):
        key = repr((build.checksum(self.program), self.program, self.tests, self.fault))
        if key not in results.caught:
            begin = time.time()
            if self.fault:
                found = with_fault(self.fault, build)
            else:
                file = os.path.join(BUILD, build.output(self.program))
                found = failed_test(self.program, self.tests, file, LIMN)
            results.keep(key, found)
            passes = "NOT CAUGHT" if self.fault else "passes"
            print(f"{time.time() - begin:4.0f} s  {self.name}: {found or passes}", flush=True)
        return results.caught[key]


def run(faults, jobs):
    """{fault: the test that caught it, or None}"""
    build, results = Build(), Results()
    runs = [Job(*pair) for pair in dict.fromkeys((f.program, f.tests) for f in faults)]
    runs += [Job(f.program, f.tests, f) for f in faults]
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        found = list(pool.map(lambda job: job.run(build, results), runs))
    for job, caught in zip(runs, found):
        if caught and not job.fault:
            sys.exit(f"{job.name}: {caught} fails")
    return {job.fault: caught for job, caught in zip(runs, found) if job.fault}


def write(caught):
    """Rows of faults that were not run stay."""
    with open(TABLE, encoding="utf-8", newline="") as stream:
        tests = {tuple(row[:3]): row[3] for row in list(csv.reader(stream))[1:]}
    tests.update({(f.part, f.name, f.program): test or "" for f, test in caught.items()})
    with open(TABLE, "w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(HEAD)
        keys = [(f.part, f.name, f.program) for f in FAULTS]
        table.writerows([*key, tests[key]] for key in keys if key in tests)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", help="names of faults or parts")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    os.makedirs(WORK, exist_ok=True)
    caught = run([f for f in FAULTS if not options.only or {f.part, f.name} & set(options.only)],
                 options.jobs)
    if options.write:
        write(caught)
    missed = [f"{fault.part}: {fault.name}" for fault, test in caught.items() if not test]
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{len(caught) - len(missed)} of {len(caught)} faults caught, in "
          f"{(used.ru_utime + used.ru_stime) / 60:.1f} processor minutes", *missed, sep="\n")
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
