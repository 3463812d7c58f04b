"""Runs of limn, one process each, so that a crash is a figure as others are."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import time
from collections import namedtuple
from dataclasses import dataclass, field

import exr
import numpy as np

from .statistics import Estimate

DONE, REFUSED, NON_FINITE, CRASHED, TIMED_OUT = "done", "refused", "non-finite", "crash", "time-out"
# Limn's methods in the suite: the one that the page is about, and those that run by default.
OURS, DIFFERENCES, MITSUBA = "adaptive", "fd", "mitsuba"
DEFAULT_METHODS = [OURS, "forest", "li2019", "uniform", DIFFERENCES]
BAD_INPUT, NOT_FINITE = 2, 3  # limn's exit status


class Interrupted(Exception):
    """The user wants to stop; what is finished is kept."""


def digest(file):
    """Of a program's file."""
    whole = hashlib.sha256()
    with open(file, "rb") as stream:
        for part in iter(lambda: stream.read(1 << 20), b""):
            whole.update(part)
    return whole.hexdigest()


def method_names(limn):
    """All but ablations, as the program lists them."""
    text = subprocess.run([limn, "compare", "--help"], capture_output=True, text=True).stdout
    lines = text.split("ratios are relative to the first: ")[1].splitlines()[0]
    names = lines.split(" (")[0].split(", ")
    return [name for name in names if not name.startswith(MITSUBA)]


@dataclass
class Run:
    status: str
    message: str = ""
    seconds: float = 0
    setup_seconds: float = 0
    spp: int = 0
    estimate: Estimate = None
    warnings: list = field(default_factory=list)


# What a run computes. step: of finite differences; 0: the program's own.
Task = namedtuple("Task", "scene_file parameter method step", defaults=(0,))


class Program:
    """limn, and the processes of it that are running."""

    def __init__(self, file, threads):
        self.file, self.threads = file, threads
        self.stopped = False
        self._running = set()

    def stop(self):
        self.stopped = True
        for process in list(self._running):
            process.send_signal(signal.SIGKILL)

    def length(self, seconds):
        """The options that say how long a run is."""
        return ["--time", f"{seconds:.6g}"]

    def gradient(self, task, seconds, seed, folder):
        """One run. folder: of its own, removed afterwards."""
        if self.stopped:
            raise Interrupted
        os.makedirs(folder, exist_ok=True)
        image, figures = os.path.join(folder, "d.exr"), os.path.join(folder, "d.json")
        command = [self.file, "gradient", task.scene_file, "--wrt", task.parameter, "--method",
                   task.method, *self.length(seconds), "--seed", str(seed), "--threads",
                   str(self.threads), "-o", image, "--json", figures]
        if task.step:
            command += ["--step", f"{task.step:.9g}"]
        try:
            return self._run(command, os.path.dirname(task.scene_file), 20 + 10 * seconds, image,
                             figures)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _run(self, command, folder, limit, image, figures):
        began = time.monotonic()
        # Deaf to the terminal's Ctrl-C: stop() ends it.
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True, errors="replace",
                                   start_new_session=True)
        self._running.add(process)
        try:
            text, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            return Run(TIMED_OUT, f"no end after {limit:.0f} s", time.monotonic() - began)
        finally:
            self._running.discard(process)
        if self.stopped:
            raise Interrupted
        return self._result(process.returncode, text, image, figures)

    def _result(self, status, text, image, figures):
        lines = [line.strip() for line in text.replace("\r", "\n").splitlines() if line.strip()]
        errors = [line for line in lines if "error:" in line]
        if status == BAD_INPUT and errors:
            return Run(REFUSED, errors[0])
        if status not in (0, NOT_FINITE):
            name = signal.Signals(-status).name if status < 0 else f"exit status {status}"
            return Run(CRASHED, f"{name}: {(errors or lines or ['no output'])[-1]}")
        with open(figures, encoding="utf-8") as stream:
            record = json.load(stream)
        run = Run(DONE, "", record["seconds"], record["setup_seconds"], record["spp"],
                  warnings=[line for line in lines if "warning:" in line])
        mean = exr.grey(image)
        error_file = image.replace(".exr", "_stderr.exr")
        error = exr.grey(error_file) if os.path.exists(error_file) else np.full_like(mean, np.inf)
        run.estimate = Estimate(mean, error**2)
        if status == NOT_FINITE or not np.isfinite(mean).all():
            run.status, run.message = NON_FINITE, (errors or ["an image that is not finite"])[0]
        return run
