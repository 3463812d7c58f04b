#!/usr/bin/env python3
"""tools/release: published figures that repeated ones contradict are named, others are not; --help
of the scripts does nothing else. tools/history: rows of commits that are not here.
"""

import os
import random
import re
import subprocess
import sys
import tempfile
import unittest
from contextlib import redirect_stdout
from functools import partial
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from io import StringIO
from types import SimpleNamespace
from unittest import mock

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TOOLS = os.path.join(ROOT, "tools")
sys.path[:0] = [os.path.join(ROOT, "tests", "report"), TOOLS, os.path.join(TOOLS, "documentation")]

from needs import need_matplotlib  # noqa: E402

need_matplotlib()

import common  # noqa: E402
import repeated  # noqa: E402
from paper_figures import ablations  # noqa: E402
from report.python import SYSTEM_PYTHON, use_one_with_matplotlib  # noqa: E402
from stability_suite.families import FAMILIES  # noqa: E402
from stability_suite.verdicts import ORDER, of_family  # noqa: E402

TIMES = """
| scene | light sets | + directions | + placement | `adaptive` | `fd` |
|---|---|---|---|---|---|
| alpha 0.05 | 1.1±0.05 | 0.2±0.01 | 0.12±0.005 | 0.095±0.005 (0.1) | 0.49±0.16 (0.5) |
"""
VERDICTS = """
| family | knob | `adaptive` | `forest` |
|---|---|---|---|
| contact | gap: 0.1 … 0 | right | biased at 1e-3, 1e-4; noisy at 0.01 |

Each run takes 0.137 s. Figures: commit `0123abcd`.
"""


class Figures(unittest.TestCase):
    @staticmethod
    def times(**found):
        """What is named where a method's time is another one than the published."""
        same = dict(zip(repeated.METHODS.values(), (
            (1.1, 0.05), (0.2, 0.01), (0.12, 0.005), (0.095, 0.005), (0.49, 0.16))))
        record = SimpleNamespace(title="rough mirror, alpha 0.05", time=(same | found).get)
        return list(repeated.differing_times(TIMES, [record]))

    def test_times(self):
        self.assertEqual(self.times(), [])
        self.assertEqual(self.times(adaptive=(0.12, 0.02), fd=(1.3, 0.5)), [])
        (line,) = self.times(adaptive=(0.19, 0.01))
        self.assertEqual(line, "alpha 0.05, adaptive: 0.095 ± 0.005 is published, 0.19 ± 0.01 "
                               "found (p = 0.0007)")

    def test_probability_is_student_s(self):
        # Tables: t of four degrees of freedom is beyond 2.776 with 5 %, beyond 4.604 with 1 %.
        for t, p in ((2.776, 0.05), (4.604, 0.01)):
            ratio = 2.718281828 ** (t * 0.1)
            self.assertAlmostEqual(repeated.probability((ratio, 0.06 * ratio), (1, 0.08)), p, 4)

    @staticmethod
    def verdicts(words, seconds=0.137):
        family = next(f for f in FAMILIES if f.name == "contact")
        records = [{"settings": {"seconds": seconds}, "methods": {"forest": {"verdict": word}}}
                   for word in words]
        return list(repeated.differing_verdicts(VERDICTS, [(family, records)]))

    def test_verdicts(self):
        same = ["right", "noisy", "biased", "biased", "right", "right"]
        self.assertEqual(self.verdicts(same), [])
        self.assertEqual(self.verdicts(["noisy", "late", "late", "biased", "noisy", "right"]), [])
        self.assertEqual(self.verdicts(["biased", "fails", "right", "biased", "right", "right"]), [
            "contact, forest at 0.1: right is published, biased found",
            "contact, forest at 0.01: noisy is published, fails found",
            "contact, forest at 1e-3: biased is published, right found"])
        self.assertEqual(self.verdicts(["biased"] * 6, 1), [], "after another time")

    def test_cells_are_read_as_they_are_written(self):
        source, values = random.Random(3), [0.1, 1e-2, 1e-3, 1e-4, 1e-6, 0]
        for _ in range(1000):
            words = [source.choice(ORDER) for _ in values]
            self.assertEqual(repeated.verdicts(of_family(words, values), values), words)

    def test_counts_of_fits(self):
        page = ("| | | to 1/100 | to 1/1000 | loss left | error | s |\n|---|---|---|---|---|---|---|\n"
                "| `tree` | `lbfgs`, 5 steps | 3, 2 s | 4, 2 s | 1.4e-13 | 0.000° | 18 |\n"
                "| | `adam`, 45 | 37, 15 s | 43, 17 s | 9.4e-5 | 0.03° | 18 |\n"
                "| `gears` | `lbfgs`, 28 | 16, 6 s | 21, 8 s | 6.6e-8 | 0.003° | 13 |\n")
        history = [{"loss": loss, "evaluations": 1} for loss in (1, 0.1, 0.005, 1e-4, 1e-4)]
        stored = {"tree": history}.get
        self.assertEqual(list(repeated.differing_counts(page, stored)), [])
        history[4]["loss"] = 0.002
        self.assertEqual(list(repeated.differing_counts(page, stored)), [
            "tree, lbfgs to 0.001: 4 evaluations are published, none found"])
        published = repeated.rows(repeated.read(repeated.FITTED))
        self.assertEqual([row[0] for row in published if len(row) == 7 and row[1].startswith("lbfgs")],
                         ["tree", "gears", "displacement"])

    def test_pages_are_read(self):
        self.assertGreater(repeated.published_seconds(), 0)
        list(repeated.differences())
        self.assertLessEqual(set(repeated.METHODS.values()), set(ablations.COLUMNS))
        head = repeated.rows(repeated.read(repeated.COMPARISONS))[0]
        self.assertEqual(head[1:], list(repeated.METHODS))


class Python(unittest.TestCase):
    def test_scripts_that_a_script_starts_choose_theirs_anew(self):
        os.environ["LIMN_REPORT_PYTHON"] = SYSTEM_PYTHON
        use_one_with_matplotlib()
        self.assertNotIn("LIMN_REPORT_PYTHON", os.environ)


class Help(unittest.TestCase):
    def test_only_the_text(self):
        scripts = ["build", "demo", "fuzz", "nasty", "packages", "test", "wheel", "python/venv",
                   "python/check_install"]
        for name in scripts:
            with self.subTest(script=name):
                done = subprocess.run([os.path.join(TOOLS, name), "--help"], capture_output=True,
                                      text=True, cwd="/", timeout=20, check=False)
                with open(os.path.join(TOOLS, name), encoding="utf-8") as stream:
                    first = stream.readlines()[1]
                self.assertEqual((done.returncode, done.stderr), (0, ""))
                self.assertTrue(done.stdout.startswith(first[2:]), done.stdout)

    def test_unknown_arguments_are_refused(self):
        for name, argument in (("packages", "tset"), ("wheel", "--hlep")):
            done = subprocess.run([os.path.join(TOOLS, name), argument], capture_output=True,
                                  text=True, check=False)
            self.assertEqual(done.returncode, 2, name)
            self.assertIn(argument, done.stderr)


def script(name):
    """A file of tools as a module."""
    loader = SourceFileLoader(name, os.path.join(TOOLS, name))
    module = module_from_spec(spec_from_loader(name, loader))
    loader.exec_module(module)
    return module


class History(unittest.TestCase):
    def test_a_commit_that_the_repository_lacks_has_no_subject(self):
        self.assertEqual(script("history").subject_of("123456789abc-dirty"), "")


class Pictures(unittest.TestCase):
    def made(self, *arguments):
        pictures, names = script("pictures"), []
        pictures.PARTS = {name: partial(lambda n, _: names.append(n), name) for name in pictures.PARTS}
        with tempfile.TemporaryDirectory() as pictures.OUT, mock.patch("sys.argv", ["x", *arguments]), \
                redirect_stdout(StringIO()):
            pictures.main()
        return pictures, names

    def test_public_scenes_stay_where_there_is_no_clone(self):
        pictures, names = self.made("--data", "/nowhere")
        self.assertEqual(names, [n for n in pictures.PARTS if n not in pictures.PUBLIC])
        self.assertEqual(self.made("--data", "/nowhere", "--only", "bunny")[1], ["bunny"])
        self.assertEqual(self.made("--data", "/")[1], list(pictures.PARTS))


class Stale(unittest.TestCase):
    def test_figures_of_an_earlier_build_are_made_again(self):
        release = script("release")
        for steps in (release.STEPS, release.SHORT):
            calls = [c for c in steps["figures"].split(" && ") if c.startswith("tools/paper")]
            self.assertTrue(calls)
            self.assertEqual([c for c in calls if "--again" not in c.split()], [])

    def test_pages_say_of_which_commit_their_figures_are(self):
        release = script("release")
        release.FIGURES, release.CODE = {"page.md": ["first", "second", "third"]}, ["code"]
        with tempfile.TemporaryDirectory() as release.ROOT:
            def commit(name, text):
                with open(os.path.join(release.ROOT, name), "w", encoding="utf-8") as stream:
                    stream.write(text)
                release.git("add", name)
                release.git("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-m", name)
                return release.git("rev-parse", "--short=8", "HEAD")

            release.git("init", "--quiet")
            commit("page.md", "| plant | 0.5 |\n")
            self.assertEqual(list(release.stale_figures()),
                             ["page.md: does not say of which commit its figures are"])
            first = commit("code", "fast")
            page = f"Figures: commit `{first}`.\n"
            commit("page.md", page)
            self.assertEqual(list(release.stale_figures()), [])
            second = commit("code", "faster")
            commit("page.md", page + f"Others: commit `{second}`.\nMore: commit `0123456789`.\n")
            self.assertEqual(list(release.stale_figures()), [
                f"page.md: figures of {first}; 1 commits changed code since\n    first",
                "page.md: figures of 0123456789; ? commits changed code since\n    third"])

    def test_pages_name_a_commit_for_each_command(self):
        release = script("release")
        self.assertEqual({page: len(release.commits_of_figures(page)) for page in release.FIGURES},
                         {page: len(commands) for page, commands in release.FIGURES.items()})

    def test_scripts_of_commands_are_there(self):
        for commands in script("release").FIGURES.values():
            for name in re.findall(r"\b(?:tools|scenes)/[\w./]+", " ".join(commands)):
                if not name.startswith("tools/edge_benchmark"):  # of build
                    self.assertTrue(os.path.exists(os.path.join(ROOT, name)), name)

    def test_a_rehearsal_publishes_nothing(self):
        release = script("release")
        for step in ("history", "wheel", "unchanged", "tag"):
            self.assertEqual(release.SHORT[step], "")
        self.assertNotIn("--publish", " ".join(release.SHORT.values()))

    def test_pages_may_be_committed_in_between(self):
        release = script("release")
        unchanged = release.STEPS["unchanged"].format().split(" && ")[1]
        with tempfile.TemporaryDirectory() as release.ROOT:
            release.OUT = release.ROOT
            git = partial(release.git, "-c", "user.name=a", "-c", "user.email=a@b")

            def write(name, text):
                with open(os.path.join(release.ROOT, name), "w", encoding="utf-8") as stream:
                    stream.write(text)

            def changed():
                return subprocess.run(["bash", "-c", unchanged], cwd=release.ROOT, check=False,
                                      capture_output=True).returncode

            git("init", "--quiet")
            write(".gitignore", "*.log\n*.done\n")
            write("page.md", "0.5\nFigures: commit `01234567`.\n")
            write("code.cpp", "fast")
            git("add", ".")
            git("commit", "-m", "all")
            self.assertTrue(release.run("stability", "echo >> ran.log"))
            write("page.md", "0.5\nFigures: commit `12345678`.\n")
            self.assertEqual(changed(), 0)
            write("page.md", "0.6\nFigures: commit `12345678`.\n")
            self.assertEqual(changed(), 1)
            git("commit", "-am", "page")
            self.assertEqual(changed(), 0)
            for code, times in (("fast", 1), ("faster", 2)):
                write("code.cpp", code)
                git("commit", "-am", "code")
                self.assertTrue(release.run("stability", "echo >> ran.log"))
                with open(os.path.join(release.ROOT, "ran.log"), encoding="utf-8") as stream:
                    self.assertEqual(len(stream.readlines()), times)

    def test_what_is_published_names_its_commit(self):
        release = script("release")
        name = release.git("rev-parse", "--short=8", "HEAD") or "unknown"
        self.assertEqual(common.commit_line(), f"Figures: commit `{name}`.")
        self.assertEqual([page for page in release.FIGURES
                          if not re.search(r"\bcommit\s+`[0-9a-f]{8}`", repeated.read(page))], [])


if __name__ == "__main__":
    unittest.main()
