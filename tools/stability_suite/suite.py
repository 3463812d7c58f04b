"""Points in turn: the reference, then the methods, repeat by repeat; the figures are kept."""

import hashlib
import json
import os
import queue
import shutil
import sys
import threading
import time
from dataclasses import dataclass

import numpy as np
from common import read_json, write_json

from . import closed_form, statistics
from .families import CLOSED_FORM, FAMILIES, STEP
from .program import DIFFERENCES, DONE, Interrupted, Run, Task
from .statistics import Estimate
from .verdicts import verdict

REPEATS = 3
RESOLUTION = 24
REFERENCE = 8  # times the seconds of a run
LONGER = 3  # times the seconds of a run, where a bias is suspected
# What share of all runs is expected to be repeated so, and what starting programs and writing take.
# From whole runs of the suite.
SUSPECTED, OVERHEAD = 0.1, 1.15
DRAWING_SECONDS = 30
FORMULA_SECONDS = 5  # of one closed form
LEAST_SECONDS = 0.02


@dataclass
class Point:
    family: object
    index: int

    @property
    def value(self):
        return self.family.values[self.index]

    @property
    def label(self):
        return f"{self.family.name} {self.value:g}"


def all_points(families):
    """The first knobs of all families first, then the second ones: an interrupted suite has seen
    something of each."""
    points = [Point(f, i) for f in families for i in range(len(f.values))]
    return sorted(points, key=lambda p: p.index)


def run_seconds(minutes, jobs, methods, resolution=RESOLUTION):
    """Of one run, so that the whole suite takes this long."""
    points = sum(len(f.values) for f in FAMILIES)
    own = {reference_identity(f, v, resolution): f.point(v)[1].method
           for f in FAMILIES for v in f.values}
    formulas = sum(method == CLOSED_FORM for method in own.values())
    references = len(own) - formulas + sum(method != DIFFERENCES for method in own.values())
    shares = points * methods * REPEATS * (1 + LONGER * SUSPECTED) + references * REFERENCE
    left = max(60 * minutes - DRAWING_SECONDS - FORMULA_SECONDS * formulas / jobs, 30 * minutes)
    return max(LEAST_SECONDS, float(f"{left * jobs / OVERHEAD / shares:.3g}"))


def reference_identity(family, value, resolution):
    scene, reference = family.point(value)
    truth = reference.scene or scene
    return hashlib.sha256(
        f"{truth.identity(resolution)} {reference.step!r} {reference.method}".encode()
    ).hexdigest()[:24]


class References:
    """Each is made once, even if several points ask at the same time, and kept as a file."""

    def __init__(self, folder, program, settings):
        self.folder, self.program, self.settings = folder, program, settings
        self._locks, self._guard = {}, threading.Lock()

    def get(self, family, value, resolution):
        """The run, and its estimate times the reference's factor."""
        scene, reference = family.point(value)
        key = reference_identity(family, value, resolution)
        with self._guard:
            lock = self._locks.setdefault(key, threading.Lock())
        with lock:
            found = self._read(key) or self._make(key, reference.scene or scene, reference,
                                                  resolution)
        if found["estimate"] is not None:
            found = {**found, "estimate": found["estimate"].times(reference.factor)}
        return found

    def _file(self, key):
        return os.path.join(self.folder, key + ".npz")

    def _read(self, key):
        try:
            with np.load(self._file(key)) as stored:
                about = json.loads(str(stored["about"]))
                if about["settings"] != self.settings:
                    return None
                return {**about, "estimate": Estimate(stored["mean"], stored["variance"])}
        except (OSError, KeyError, ValueError):
            return None

    def _make(self, key, scene, reference, resolution):
        folder = os.path.join(self.folder, key)
        try:
            file = scene.write(folder, resolution)
            run = (self._by_formula(scene, resolution) if reference.closed_form else
                   self._run(scene, file, reference.method, 7919, folder, reference.step))
            about = {"settings": self.settings, "status": run.status, "message": run.message,
                     "spp": run.spp, "seconds": run.seconds, "method": reference.method}
            if run.status == DONE and not reference.step:
                about["against_differences"] = self._check(scene, file, folder, run.estimate)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        if run.status != DONE:
            return {**about, "estimate": None}
        partial = os.path.join(self.folder, f"{key}.partial.npz")
        np.savez(partial, about=json.dumps(about), mean=run.estimate.mean,
                 variance=run.estimate.variance)
        os.replace(partial, self._file(key))
        return {**about, "estimate": run.estimate}

    @staticmethod
    def _by_formula(scene, resolution):
        began = time.monotonic()
        estimate = closed_form.derivative(scene, resolution)
        return Run(DONE, seconds=time.monotonic() - began, estimate=estimate)

    def _run(self, scene, file, method, seed, folder, step):
        seconds = REFERENCE * self.settings["seconds"]
        return self.program.gradient(Task(file, scene.parameter, method, step), seconds,
                                     self.settings["seed"] + seed, os.path.join(folder, "run"))

    def _check(self, scene, file, folder, estimate):
        """The bias of a reference that is not made of differences, against differences; None if
        those cannot be had."""
        differences = self._run(scene, file, DIFFERENCES, 104729, folder, STEP)
        if differences.status != DONE:
            return None
        return statistics.bias([estimate], differences.estimate)


def point_file(output, point):
    return os.path.join(output, "points", f"{point.family.name}-{point.index}.json")


class Suite:
    """settings: what a result must have been made with to be kept: the program's digest, seconds of
    a run, seed, resolution, threads."""

    def __init__(self, program, output, methods, settings, jobs, say=print):
        self.program, self.output, self.methods = program, output, methods
        self.settings, self.jobs, self.say = settings, jobs, say
        os.makedirs(os.path.join(output, "references"), exist_ok=True)
        self.references = References(os.path.join(output, "references"), program, settings)
        self.errors = []
        self._queue, self._lock = queue.Queue(), threading.Lock()

    def missing(self, point):
        """The methods that this point has no result of, made with these settings."""
        record = read_json(point_file(self.output, point))
        if record is None or record.get("settings") != self._settings_of(point):
            return list(self.methods)
        return [m for m in self.methods if m not in record["methods"]]

    def _settings_of(self, point):
        scene, reference = point.family.point(point.value)
        resolution = self.settings["resolution"]
        return {**self.settings, "scene": scene.identity(resolution),
                "reference": reference_identity(point.family, point.value, resolution),
                "factor": reference.factor}

    def run(self, points):
        """False if it was interrupted."""
        for point in points:
            self._queue.put(point)
        self.total, self.done, self.began = len(points), 0, time.monotonic()
        ends = queue.Queue()  # An interrupted join() takes a running thread for finished.
        workers = [threading.Thread(target=self._work_to_end, args=(ends,), daemon=True)
                   for _ in range(self.jobs)]
        for worker in workers:
            worker.start()
        left = len(workers)
        try:
            while left:
                ends.get()
                left -= 1
        except KeyboardInterrupt:
            self.program.stop()
            for worker in workers:
                worker.join(5)
            return False
        return not self.program.stopped

    def _work_to_end(self, ends):
        try:
            self._work()
        finally:
            ends.put(None)

    def _work(self):
        while not self.program.stopped:
            try:
                point = self._queue.get_nowait()
            except queue.Empty:
                return
            try:
                record = self._point(point)
            except Interrupted:
                return
            except Exception as error:  # One point's trouble is not the suite's.
                with self._lock:
                    self.errors.append(f"{point.label}: {type(error).__name__}: {error}")
                continue
            with self._lock:
                self.done += 1
                self._report(point, record)

    def _report(self, point, record):
        spent = time.monotonic() - self.began
        left = spent / self.done * (self.total - self.done)
        words = ", ".join(f"{m} {record['methods'][m]['verdict']}" for m in self.methods
                          if m in record["methods"])
        self.say(f"[{self.done}/{self.total}] {point.label}: {words}; "
                 f"{int(left) // 60}:{int(left) % 60:02} left")
        sys.stdout.flush()

    def _point(self, point):
        """Runs what is missing, and keeps the record after it."""
        file, settings = point_file(self.output, point), self._settings_of(point)
        record = read_json(file)
        if record is None or record.get("settings") != settings:
            record = {"family": point.family.name, "index": point.index, "value": point.value,
                      "settings": settings, "methods": {}}
        todo = [m for m in self.methods if m not in record["methods"]]
        resolution = self.settings["resolution"]
        reference = self.references.get(point.family, point.value, resolution)
        record["reference"] = {k: v for k, v in reference.items()
                               if k not in ("estimate", "settings")}
        if reference["estimate"] is not None:
            record["reference"]["error"] = statistics.own_error(reference["estimate"])
        scene, _ = point.family.point(point.value)
        folder = os.path.join(self.output, "work", f"{point.family.name}-{point.index}")
        try:
            runner = PointRunner(self.program, scene, scene.write(folder, resolution), folder,
                                 self.settings)
            first = runner.all(todo, 0, self.settings["seconds"])
            for method in todo:
                record["methods"][method] = runner.figures(method, first[method],
                                                           reference["estimate"])
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        write_json(file, record)
        return record


class PointRunner:
    """The runs at one point."""

    def __init__(self, program, scene, file, folder, settings):
        self.program, self.scene, self.file = program, scene, file
        self.folder, self.settings = folder, settings

    def all(self, methods, batch, seconds):
        """{method: runs}, interleaved so that what else the machine does hits all alike. A method
        that fails is not run again."""
        runs = {m: [] for m in methods}
        for repeat in range(REPEATS):
            for method in methods:
                if all(r.status == DONE for r in runs[method]):
                    runs[method].append(self._one(method, batch, repeat, seconds))
        return runs

    def _one(self, method, batch, repeat, seconds):
        seed = self.settings["seed"] + 1 + repeat + REPEATS * batch
        return self.program.gradient(Task(self.file, self.scene.parameter, method), seconds, seed,
                                     os.path.join(self.folder, f"{method}-{repeat}"))

    def figures(self, method, runs, reference):
        """What is kept of a method at a point."""
        last = runs[-1]
        figures = {"status": last.status, "message": last.message,
                   "warnings": sorted({w for r in runs for w in r.warnings})[:5]}
        if last.status == DONE:
            figures["seconds"] = float(np.mean([r.seconds for r in runs]))
            figures["setup_seconds"] = float(np.mean([r.setup_seconds for r in runs]))
            figures["spp"] = float(np.mean([r.spp for r in runs]))
            if reference is not None:
                figures.update(self._judged(method, runs, reference))
        figures["verdict"] = verdict(figures, self.settings["seconds"])
        return figures

    def _judged(self, method, runs, reference):
        estimates = [r.estimate for r in runs]
        figures = statistics.errors(estimates, reference)
        figures["bias"] = statistics.bias(estimates, reference)
        if statistics.called(figures["bias"]):
            again = self.all([method], 1, LONGER * self.settings["seconds"])[method]
            if again[-1].status == DONE:
                figures["longer"] = statistics.bias([r.estimate for r in again], reference)
        return figures
