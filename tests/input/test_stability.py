"""tools/stability: its scenes, a short run, what is kept, a planted bias, the page and the table.

    test_stability.py LIMN
"""
import concurrent.futures
import html
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
TOOLS = os.path.join(HERE, "..", "..", "tools")
sys.path[:0] = [os.path.join(HERE, "..", "report"), TOOLS]

from needs import need_matplotlib  # noqa: E402

need_matplotlib()

import exr  # noqa: E402
import numpy as np  # noqa: E402
from common import read_json  # noqa: E402
from stability_suite import (  # noqa: E402
    calibration, closed_form, families, statistics, suite, table, verdicts)
from stability_suite.program import DEFAULT_METHODS, Program, Task, method_names  # noqa: E402
from stability_suite.statistics import Estimate  # noqa: E402

STABILITY = os.path.join(TOOLS, "stability")
LIMN = ""  # the program, from the command line


class BySamples(Program):
    """Takes seconds for samples per pixel: the same figures whatever the machine does."""

    def length(self, seconds):
        return ["--spp", str(round(seconds))]


class TestStatedErrors(unittest.TestCase):
    @staticmethod
    def runs(stated, count=4000):
        random = np.random.default_rng(5)
        images = random.normal(3, 0.1, (count, 2, 2))
        return [(image.sum(), stated * 0.2, image, np.full((2, 2), stated * 0.1))
                for image in images]

    def test_ratios(self):
        # Of a standard deviation of that many values the error is 1 / sqrt(2 n).
        for stated in (0.5, 1, 2):
            found = calibration.ratios(self.runs(stated))
            self.assertAlmostEqual(found["sum"], stated, delta=4 * stated / 8000**0.5)
            self.assertAlmostEqual(found["pixel"], stated, delta=4 * stated / 8000**0.5)
        self.assertLess(calibration.ratios(self.runs(1))["beyond"], 0.008)
        self.assertGreater(calibration.ratios(self.runs(0.5))["beyond"], 0.1)

    def test_figures_are_put_into_a_page_and_replaced(self):
        rows = [{"scene": "sun", "method": "fd", "spp": spp, "sum": 0.5, "pixel": 2, "beyond": 0.25}
                for spp in calibration.LEVELS]
        with tempfile.TemporaryDirectory(prefix="limn_stability_") as folder:
            page = os.path.join(folder, "page.md")
            with open(page, "w", encoding="utf-8") as out:
                out.write("# Page\n")
            for _ in range(2):
                calibration.publish(page, rows)
            with open(page, encoding="utf-8") as stream:
                text = stream.read()
        self.assertTrue(text.startswith("# Page\n"))
        figures = " ".join(text.split())  # lines are wrapped
        self.assertEqual(figures.count("`fd` 0.50–0.50 (sums), 2.00–2.00 (pixels)"), 1)

    def test_every_method_and_scene_is_known(self):
        self.assertEqual(set(calibration.gradient_methods(LIMN)) & {"adaptive", "was", "fd"},
                         {"adaptive", "was", "fd"})
        for name, value in calibration.SCENES.items():
            self.assertIn(value, families.find(name).values)


class TestScenes(unittest.TestCase):
    def test_every_scene_is_read(self):
        with tempfile.TemporaryDirectory(prefix="limn_stability_") as folder:

            def read(point):
                scene, reference = point.family.point(point.value)
                place = os.path.join(folder, f"{point.family.name}-{point.index}")
                file = scene.write(place, suite.RESOLUTION)
                done = subprocess.run([LIMN, "info", file], capture_output=True, text=True)
                return point.label, scene.parameter, done

            points = suite.all_points(families.FAMILIES)
            with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
                for label, parameter, done in pool.map(read, points):
                    with self.subTest(point=label):
                        self.assertEqual((done.returncode, done.stderr.count("error:")), (0, 0),
                                         done.stderr)
                        self.assertIn(parameter.split(":")[0], done.stdout)

    def test_knobs_change_the_scene_or_its_mesh(self):
        for family in families.FAMILIES:
            identities = {family.point(v)[0].identity(24) for v in family.values}
            with self.subTest(family=family.name):
                self.assertEqual(len(identities), len(family.values))
                self.assertGreaterEqual(len(family.values), 4)

    def test_closed_meshes_are_closed(self):
        """Every edge of the shapes that the clean reference is made of has two faces."""
        for name in ("slivers", "seams"):
            scene, reference = families.find(name).point(families.find(name).values[0])
            for mesh in (scene.shape("object").mesh, reference.scene.shape("object").mesh):
                places, faces = np.unique(mesh[0], axis=0, return_inverse=True)[1].reshape(-1), mesh[1]
                edges = {}
                for a, b, c in places[faces]:
                    for i, j in ((a, b), (b, c), (c, a)):
                        edges[i, j] = edges.get((i, j), 0) + 1
                self.assertTrue(all(edges.get((j, i)) == n == 1 for (i, j), n in edges.items()), name)


class TestImages(unittest.TestCase):
    def test_what_limn_writes_and_reads(self):
        """A map of one radiance, seen by a camera: the same number in limn's image."""
        with tempfile.TemporaryDirectory(prefix="limn_stability_") as folder:
            with open(os.path.join(folder, "sky.exr"), "wb") as out:
                out.write(exr.rgb_bytes(np.full((16, 32), 0.375)))
            scene = families.table(families.meshes.prism())
            scene.shapes = scene.shapes[:1]
            scene.target = (0.5, -10, 2.5)
            scene.extra = '<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>'
            file, image = scene.write(folder, 21), os.path.join(folder, "image.exr")
            subprocess.run([LIMN, "render", file, "--spp", "1", "-o", image], check=True,
                           capture_output=True)
            pixels = exr.grey(image)
            self.assertEqual(pixels.shape, (21, 21))
            np.testing.assert_allclose(pixels, 0.375, rtol=1e-6)


class TestStatistics(unittest.TestCase):
    """Made-up runs: normal noise of known size about a known derivative."""

    def setUp(self):
        self.rng = np.random.default_rng(1)
        self.truth = np.add.outer(np.sin(np.arange(24)), np.cos(np.arange(24) / 3))

    def estimate(self, deviation, factor=1.0):
        noise = self.rng.normal(size=(24, 24)) * deviation
        return Estimate(factor * self.truth + noise, np.full((24, 24), deviation**2))

    def runs(self, factor=1.0):
        return [self.estimate(0.5, factor) for _ in range(3)]

    def test_scores_of_a_right_method(self):
        """p is even on [0, 1], so that of 400 the count below 0.1 is binomial; doubled, it is less."""
        p = [statistics.bias(self.runs(), self.estimate(0.2))["p"] for _ in range(400)]
        self.assertLess(sum(v < 0.1 for v in p), 40 + 5 * 6)
        self.assertFalse(any(v < statistics.LEVEL for v in p))

    def test_a_bias_is_called_with_its_size(self):
        bias = statistics.bias(self.runs(1.2), self.estimate(0.05))
        self.assertTrue(statistics.called(bias))
        self.assertLess(bias["visible"], 0.2)
        self.assertAlmostEqual(bias["share"], 0.2, delta=5 * 0.5 / np.sqrt(3 * (self.truth**2).sum()))

    def test_what_fades_is_no_bias(self):
        first = {"p": 1e-20, "chi_square": 200.0, "blocks": 36}
        self.assertTrue(statistics.confirmed(first, {"p": 1e-40, "chi_square": 400.0}))
        self.assertFalse(statistics.confirmed(first, {"p": 1e-6, "chi_square": 90.0}))
        self.assertFalse(statistics.confirmed({**first, "p": 0.1}, {"p": 1e-40, "chi_square": 400.0}))

    def test_the_reference_s_noise_is_taken_off(self):
        power = np.sqrt((self.truth**2).mean())
        for deviation in (0.0, 0.5):
            error = statistics.errors([self.estimate(0.3) for _ in range(3)], self.estimate(deviation))
            # 1728 squares: their mean has a relative deviation of sqrt(2 / 1728), the root half of it.
            self.assertAlmostEqual(error["error"] * power / 0.3, 1, delta=5 * 0.5 * np.sqrt(2 / 576))

    def test_the_tail_is_the_share_of_the_worst(self):
        runs = [Estimate(self.truth.copy(), np.full((24, 24), 1e-6)) for _ in range(3)]
        runs[1].mean[3, 4] += 100
        tail = statistics.errors(runs, Estimate(self.truth, np.zeros((24, 24))))["tail"]
        self.assertAlmostEqual(tail, 1)


class TestVerdicts(unittest.TestCase):
    def test_words_of_a_family(self):
        values = [1, 1e-1, 1e-3]
        for words, text in ((["right"] * 3, "right"), (["noisy"] * 3, "noisy"),
                            (["right", "noisy", "noisy"], "noisy from 0.1"),
                            (["right", "biased", "noisy"], "biased at 0.1; noisy at 1e-3"),
                            ([None, "right", None], "right"), ([None] * 3, "–")):
            self.assertEqual(verdicts.of_family(words, values), text)

    def test_failures(self):
        self.assertEqual(verdicts.verdict({"status": "refused"}, 1), "refused")
        for status in ("crash", "time-out", "non-finite"):
            self.assertEqual(verdicts.verdict({"status": status}, 1), "fails")
        self.assertEqual(verdicts.verdict({"status": "done", "seconds": 2}, 1), "late")


class TestTable(unittest.TestCase):
    @staticmethod
    def records(*points):
        """points: {method: (verdict, error)}."""
        return [{"methods": {m: {"verdict": v, "error": e} for m, (v, e) in p.items()}} for p in points]

    def test_who_is_ahead(self):
        family = families.find("crossing")
        for ours, other, ahead in (
            (("right", 0.5), ("right", 0.1), False),  # A line that stands is enough.
            (("noisy", 3.0), ("right", 0.9), True),
            (("noisy", 1.2), ("right", 0.9), False),
            (("noisy", 9.0), ("noisy", 2.0), True),
            (("biased", 0.2), ("right", 0.5), False),  # It would not have seen that bias.
            (("biased", 0.2), ("right", 0.1), True),
            (("late", 2.0), ("noisy", 1.1), False),
            (("fails", None), ("right", 0.9), True),
            (("noisy", 3.0), ("biased", 0.1), False),
        ):
            records = self.records({"adaptive": ours, "fd": other})
            self.assertEqual(table.beaten(family, records), [(1, ["fd"])] if ahead else [], (ours, other))

    def test_errors_where_both_are_right(self):
        stored = [(families.find("crossing"), [*self.records(
            {"adaptive": ("right", 0.1), "fd": ("right", 0.4)},
            {"adaptive": ("right", 0.1), "fd": ("right", 0.1)},
            {"adaptive": ("noisy", 9), "fd": ("right", 0.1)}), None])]
        ((method, ratio, count),) = table.against_others(stored)
        self.assertEqual((method, count), ("fd", 2))
        self.assertAlmostEqual(ratio, 0.5)


class TestRuns(unittest.TestCase):
    @classmethod
    def setUpClass(cls):  # One folder: they share a reference.
        temporary = tempfile.TemporaryDirectory(prefix="limn_stability_")
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = temporary.name

    def suite(self, methods, planted=1.0):
        """scale at 1, held against its reference times `planted`."""
        found = families.find("scale")

        def make(value):
            scene, reference = found.point(value)
            reference.factor *= planted
            return scene, reference

        planted_family = families.Family("scale", "", [1], make, "", "")
        settings = {"program": "", "seconds": 16, "seed": 1, "resolution": suite.RESOLUTION}
        whole = suite.Suite(BySamples(LIMN, 1), self.folder, methods, settings, 1, lambda _: None)
        point = suite.Point(planted_family, 0)
        self.assertTrue(whole.run([point]))
        self.assertEqual(whole.errors, [])
        return read_json(suite.point_file(self.folder, point))["methods"]

    def test_a_planted_bias_is_called(self):
        figures = self.suite(["adaptive"], 1.2)["adaptive"]
        self.assertEqual(figures["verdict"], "biased")
        self.assertLess(figures["bias"]["visible"], 1 - 1 / 1.2)

    def test_none_is_called_where_none_is(self):
        self.assertEqual(self.suite(["adaptive"])["adaptive"]["verdict"], "right")
        # A method that is new joins those that are there.
        self.assertEqual(list(self.suite(["fd"])), ["adaptive", "fd"])

    def test_a_method_that_ends_badly(self):
        script = os.path.join(self.folder, "limn")
        with open(script, "w") as out:
            out.write(f"""#!{sys.executable}
import os, sys
method = sys.argv[sys.argv.index("--method") + 1]
if method == "li2019": os.abort()
if method == "uniform": sys.exit(2)
if method == "forest":
    print("scene.xml: error: too much")
    sys.exit(2)
os.execv({LIMN!r}, [{LIMN!r}] + sys.argv[1:])
""")
        os.chmod(script, 0o755)
        whole = Program(script, 1)
        statuses = {}
        scene, _ = families.find("scale").point(1)
        file = scene.write(os.path.join(self.folder, "scene"), 24)
        for method in ("adaptive", "li2019", "uniform", "forest"):
            run = whole.gradient(Task(file, scene.parameter, method), 0.02, 1,
                                 os.path.join(self.folder, "r"))
            statuses[method] = (run.status, run.message)
        self.assertEqual(statuses["adaptive"], ("done", ""))
        self.assertEqual(statuses["li2019"], ("crash", "SIGABRT: no output"))
        self.assertEqual(statuses["uniform"], ("crash", "exit status 2: no output"))
        self.assertEqual(statuses["forest"], ("refused", "scene.xml: error: too much"))


class TestClosedForm(unittest.TestCase):
    def test_runs_agree_with_it_and_would_not_if_it_were_wrong(self):
        prism = families.meshes.prism
        for parameter, bottom in (("object.translate.x", 0.25), ("object.translate.y", 0.0),
                                  ("sensor.translate.x", 0.25)):
            scene = families.table(prism(bottom, 1), depth=2, parameter=parameter)
            truth = closed_form.derivative(scene, 12)
            with tempfile.TemporaryDirectory(prefix="limn_stability_") as folder:
                task = Task(scene.write(folder, 12), parameter, "adaptive")
                run = BySamples(LIMN, 1).gradient(task, 64, 5, os.path.join(folder, "run"))
            with self.subTest(parameter=parameter):
                self.assertGreater(statistics.bias([run.estimate], truth)["p"], 1e-4)
                wrong = statistics.bias([run.estimate], truth.times(1.1))
                self.assertLess(wrong["p"], 1e-4)


class TestTool(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="limn_stability_")
        self.addCleanup(temporary.cleanup)
        self.folder = temporary.name

    def command(self, *arguments):
        return [sys.executable, STABILITY, "--limn", LIMN, "-o", self.folder, *arguments]

    def tool(self, *arguments):
        return subprocess.run(self.command(*arguments), capture_output=True, text=True)

    def page(self):
        with open(os.path.join(self.folder, "report.html"), encoding="utf-8") as stream:
            return stream.read()

    def test_a_run_and_its_page(self):
        some = ["--family", "contact,slivers", "--knobs", "0,1", "--time", "0.02"]
        done = self.tool(*some, "--methods", "adaptive,uniform")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("4 points", done.stdout)
        page = self.page()
        for name in ("contact", "slivers"):
            self.assertIn(f'<section id="{name}">', page)
        self.assertNotIn("seams", page.split('id="reading"')[0])
        self.assertEqual(page.count("<svg"), 2)
        self.compare_table(page)
        again = self.tool(*some, "--methods", "adaptive,uniform")
        self.assertIn("4 of 4 points: finished before", again.stdout)
        self.assertNotIn("[1/", again.stdout)
        before = self.page()
        os.remove(os.path.join(self.folder, "report.html"))
        drawn = subprocess.run([sys.executable, STABILITY, "--draw", "-o", self.folder],
                               capture_output=True, text=True)
        self.assertEqual((drawn.returncode, drawn.stderr), (0, ""))
        self.assertEqual(self.page(), before)

    def compare_table(self, page):
        """The same words in the page's table of verdicts and in the Markdown."""
        body = re.search(r'<table aria-label="Verdicts">.*?<tbody>(.*?)</tbody>', page, re.S)[1]
        rows = [[html.unescape(re.sub("<[^>]*>", "", cell)) for cell in
                 re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)] for row in body.split("</tr>") if row]
        with open(os.path.join(self.folder, "table.md"), encoding="utf-8") as stream:
            text = stream.read()
        lines = [line for line in text.splitlines() if line.startswith("|")][2:]
        # Markdown names the families in which every method is right in a sentence of its own. The
        # runs end by time, so either may happen.
        right = [row for row in rows if set(row[2:]) == {"right"}]
        self.assertEqual([row for row in rows if row not in right],
                         [[c.strip() for c in line.strip("|").split("|")] for line in lines])
        for family, knob, *_ in right:
            self.assertIn(f"{family} ({knob})", " ".join(text.split()))
        self.assertEqual(len(rows), 2)

    def test_an_interrupt_keeps_what_is_finished(self):
        process = subprocess.Popen(self.command("--family", "scale", "--time", "0.1", "--methods", "adaptive",
                                                "--jobs", "1"),
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        first = os.path.join(self.folder, "points", "scale-0.json")
        while process.poll() is None and not os.path.exists(first):
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
        self.assertEqual(process.returncode, 130)
        self.assertIn("the same command goes on where it stopped", errors)
        with open(first) as stream:
            self.assertIn("adaptive", json.load(stream)["methods"])
        self.assertIn('<section id="scale">', self.page())
        self.assertFalse(os.listdir(os.path.join(self.folder, "work")))

    def test_publishing(self):
        page = os.path.join(self.folder, "PAGE.md")
        with open(page, "w") as out:
            out.write(f"before\n{table.BEGIN}\nold\n{table.END}\nafter\n")
        records = [(families.find(name), [None] * 5 + [
            {"settings": {"seconds": 0.25}, "methods": {"adaptive": {"verdict": verdict}}}])
            for name, verdict in (("seams", "noisy"), ("scale", "right"))]
        table.publish(page, records)
        with open(page) as stream:
            text = stream.read()
        self.assertTrue(text.startswith("before\n") and text.endswith("\nafter\n"))
        self.assertNotIn("old", text)
        self.assertIn("| seams | distance of the copies, in radii: 0 … 1e-6 | noisy |", text)
        self.assertIn("Every method is right in: scale (size of the scene: 1e-10 … 1e10).", text)

    def test_bad_arguments(self):
        for arguments, message in ((["--family", "moon"], 'no family is called "moon"'),
                                   (["--methods", "magic"], 'no method is called "magic"'),
                                   (["--minutes", "-1"], "not a positive number: -1"),
                                   (["--knobs", "a"], "--knobs: not counts: a"),
                                   (["--limn", "/no/such"], "/no/such: no such program"),
                                   (["--draw"], "nothing is stored here")):
            done = self.tool(*arguments)
            self.assertEqual(done.returncode, 2)
            self.assertIn(message, done.stderr)

    def test_names_of_methods_are_the_program_s(self):
        names = method_names(LIMN)
        self.assertTrue(set(DEFAULT_METHODS) <= set(names))
        self.assertNotIn("mitsuba", names)

    def test_the_budget(self):
        """Twice the minutes, at least twice the seconds of a run; twice the methods, fewer."""
        ten, twenty = (suite.run_seconds(minutes, 2, 5) for minutes in (10, 20))
        self.assertGreater(twenty, 1.9 * ten)
        self.assertLess(suite.run_seconds(10, 2, 8), ten)


if __name__ == "__main__":
    LIMN = os.path.abspath(sys.argv.pop(1))
    unittest.main()
