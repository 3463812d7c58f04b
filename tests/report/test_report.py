"""tools/report.py on sample folders: what the page says, and what is said of faulty input."""

import json
import math
import os
import re
import subprocess
import sys
import tempfile
import unittest

from needs import need_matplotlib
from sample_folders import fitting, rejection, write_png, write_samples

need_matplotlib()
import numpy as np  # noqa: E402

TOOLS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tools")
REPORT = os.path.join(TOOLS, "report.py")
sys.path.insert(0, TOOLS)

from paper_figures import meshes  # noqa: E402
from paper_figures import page as figure_page  # noqa: E402
from paper_figures.figures import Figure  # noqa: E402
from paper_figures.parts import Part  # noqa: E402
from report.markup import count, element, figures, percent, with_error  # noqa: E402
from report.overview import relative_times  # noqa: E402
from report.records import read_folder  # noqa: E402


def run(*arguments, **environment):
    return subprocess.run(
        [sys.executable, REPORT, *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
    )


def section(page, title):
    """What lies under a heading, up to the next of its rank."""
    return re.search(rf"<h(\d)>{re.escape(title)}</h\1>(.*?)(?=<h\1>|</section>)", page, re.S)[2]


class TestMarkup(unittest.TestCase):
    def test_numbers(self):
        self.assertEqual(
            [figures(v) for v in (None, 0, 1.234567, 12345, -0.01234, 1.234e-7, 2e9)],
            ["–", "0", "1.23", "12\u2009345", "−0.0123", "1.23×10⁻⁷", "2.00×10⁹"],
        )

    def test_errors_have_two_figures_at_most(self):
        pm = "\u00a0±\u00a0"
        self.assertEqual(
            [
                with_error(*v)
                for v in ((1.2345, 0.0412), (123.4, 56.7), (2e-6, 3e-7), (0.5, None), (1, 0))
            ],
            [f"1.23{pm}0.04", f"123{pm}57", f"(2.00{pm}0.30)×10⁻⁶", "0.500", "1.00"],
        )

    def test_counts_and_shares(self):
        self.assertEqual(
            [count(v) for v in (12, 12345, 2.5e6, 3e9)], ["12", "12.3 k", "2.5 M", "3 G"]
        )
        self.assertEqual([percent(v) for v in (0.5, 0, None)], ["50 %", "0 %", "–"])

    def test_text_is_escaped(self):
        self.assertEqual(
            element("td", '<b> & "', title='"<'),
            '<td title="&quot;&lt;">&lt;b&gt; &amp; &quot;</td>',
        )


class TestReport(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory(prefix="limn_report_")
        cls.mirror, cls.shadow, cls.bunny = write_samples(os.path.join(cls.temporary.name, "runs"))
        cls.file = os.path.join(cls.temporary.name, "report.html")
        done = run(cls.mirror, cls.shadow, cls.bunny, "-o", cls.file)
        assert done.returncode == 0, done.stderr
        with open(cls.file, encoding="utf-8") as stream:
            cls.page = stream.read()

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def broken(self, change, name="broken"):
        """A folder whose compare.json went through `change`, a function of its text."""
        folder = os.path.join(self.temporary.name, name)
        os.makedirs(folder, exist_ok=True)
        with open(os.path.join(self.mirror, "compare.json")) as stream:
            text = stream.read()
        with open(os.path.join(folder, "compare.json"), "w") as stream:
            stream.write(change(text))
        return folder

    def test_nothing_points_outside(self):
        self.assertEqual(re.findall(r"(?:https?|file):[^\s\"<]*", self.page), [])
        sources = re.findall(r"(?:src=\"|url\()([^\")]{0,22})", self.page)
        self.assertEqual(
            [s for s in sources if not s.startswith(("data:image/png;base64,", "#"))], []
        )
        self.assertNotIn("<script", self.page)

    def test_only_the_biased_method_is_marked(self):
        times = section(self.page, "Time for equal error")
        self.assertEqual(times.count("⚠ biased</span>"), 1)
        row = section(self.page, "At the longest time budget")
        marked = re.findall(
            r"<tr><th[^>]*><span.*?</span>([^<]*)</span>(?:(?!</tr>).)*implausible", row, re.S
        )
        self.assertEqual(marked, ["fd"])

    def test_time_is_told_by_term(self):
        """Of 8.08 s at a budget of 8 s; the rest is set-up and writing."""
        label = "interior 29.7 %, camera 19.8 %, boundary 39.6 %, direct 4.95 %, rest 5.94 %"
        self.assertEqual(self.page.count(f'aria-label="{label}"'), 8)

    def test_missing_and_interrupted_methods_say_why(self):
        self.assertIn(
            "<strong>mitsuba: missing. </strong>Mitsuba is not installed: pip install"
            " mitsuba==3.9.1",
            self.page,
        )
        self.assertIn("<strong>brute: interrupted. </strong>Ctrl-C after one repeat", self.page)

    def test_times_are_relative_to_the_forest(self):
        ratios, baseline = relative_times(read_folder(self.shadow)[0].data)
        # li2019 came first: forest 0.25 +- 0.025, brute 7.5 +- 0.75, li2019 1 +- 0.1.
        self.assertEqual(baseline, "forest")
        self.assertEqual(ratios["forest"], (1.0, 0.0))
        self.assertAlmostEqual(ratios["li2019"][0], 4)
        self.assertAlmostEqual(ratios["brute"][0], 30)
        self.assertAlmostEqual(ratios["brute"][1], 30 * 2**0.5 * 0.1)

    def test_a_flat_slope_is_marked(self):
        self.assertEqual(section(self.page, "Slopes").count("⚠ flatter</span>"), 1)

    def test_the_command_is_there(self):
        self.assertIn(
            "limn compare scenes/mirror.xml --wrt object.translate.y --methods forest,fd --time 8"
            " --sweep",
            self.page,
        )

    def test_the_same_input_gives_the_same_page(self):
        again = os.path.join(self.temporary.name, "again.html")
        self.assertEqual(run(self.mirror, self.shadow, self.bunny, "-o", again).returncode, 0)
        with open(again, encoding="utf-8") as stream:
            self.assertEqual(stream.read(), self.page)

    def test_a_missed_silhouette_is_loud(self):
        folder = os.path.join(self.temporary.name, "missed")
        rejection(folder, "meshes/bunny.ply", missed=3)
        self.assertEqual(run(folder).returncode, 0)
        with open(os.path.join(folder, "report.html"), encoding="utf-8") as stream:
            self.assertIn(
                "Silhouettes were missed. </strong>This is a bug, and gradients are biased by it: "
                "li2019: 6 times.",
                stream.read(),
            )
        self.assertNotIn("Silhouettes were missed", self.page)

    def test_missing_pictures_are_named(self):
        folder = self.broken(lambda text: text, "no_pictures")
        with open(os.path.join(self.mirror, "forest.png"), "rb") as whole:
            start = whole.read()[:500]
        with open(os.path.join(folder, "forest.png"), "wb") as part:
            part.write(start)
        done = run(folder)
        self.assertEqual(done.returncode, 0)
        self.assertIn(f"picture missing: {folder}/forest.png: the file is cut off", done.stderr)
        self.assertIn(
            f"picture missing: {folder}/fd_error.png: no such file or directory", done.stderr
        )
        with open(os.path.join(folder, "report.html"), encoding="utf-8") as stream:
            self.assertIn(
                f"<li><code>{folder}/reference.png: no such file or directory</code></li>",
                stream.read(),
            )

    def fails(self, status, message, *arguments, **environment):
        done = run(*arguments, **environment)
        self.assertEqual((done.returncode, done.stderr), (status, f"tools/report.py: {message}\n"))

    def test_a_fit_has_curves_and_a_strip(self):
        folder = fitting(os.path.join(self.temporary.name, "fit"))
        self.assertEqual(run(folder).returncode, 0)
        with open(os.path.join(folder, "report.html"), encoding="utf-8") as stream:
            page = stream.read()
        # Seven of ten snapshots and the target, two views each; the first and the last are there.
        self.assertEqual(page.count("<img"), 2 * 8)
        for step in ("step 0", "step 45", "target"):
            self.assertIn(f"<h4>{step}</h4>", page)
        self.assertIn("clay.reflectance: 0.6123", page)
        self.assertIn("1 steps were halved", page)
        # The loss to its last step, where it is below zero; the scalar; distances.
        self.assertEqual(page.count("<svg"), 4)
        self.assertIn("Blur: sigma", page)
        self.assertIn("loss over 45 steps, with its standard error; an unbiased estimate, below zero"
                      " at the 6 steps with a mark", page)
        self.assertIn("<td>0.59750</td>", page)  # after 40 steps
        self.assertIn("15.0°", page)
        self.assertNotIn("goes on", page)
        stopped = fitting(os.path.join(self.temporary.name, "stopped"), "interrupted")
        both = os.path.join(self.temporary.name, "both.html")
        self.assertEqual(run(folder, stopped, "-o", both).returncode, 0)
        with open(both, encoding="utf-8") as stream:
            page = stream.read()
        self.assertIn("interrupted. ", page)
        self.assertIn("<title>limn: 2 fits</title>", page)
        self.assertNotIn('id="overview"', page)

    def test_faulty_input(self):
        nowhere = os.path.join(self.temporary.name, "nowhere")
        self.fails(2, f"{nowhere}: no such folder", nowhere)
        empty = os.path.join(self.temporary.name, "empty")
        os.makedirs(empty)
        self.fails(
            2,
            f"{empty}: neither compare.json nor reject.json nor fit.json is here; make one with"
            f" `limn compare ... -o {empty}`, `limn reject ... -o {empty}` or"
            f" `limn fit ... -o {empty}`",
            empty,
        )
        folder = self.broken(lambda text: text[:40])
        self.assertRegex(
            run(folder).stderr,
            r"broken/compare\.json:\d+:\d+: not JSON: .*; run the command that wrote it again",
        )
        folder = self.broken(lambda text: "[1]")
        self.fails(2, f"{folder}/compare.json: not a JSON object", folder)
        folder = self.broken(lambda text: text.replace('"kind": "compare"', '"kind": "bake"'))
        self.fails(2, f'{folder}/compare.json: "kind" is "bake" (known: compare, reject, fit)', folder)

    def test_faulty_values_are_named_with_their_place(self):
        advice = "was the file written by another version of limn? Run its command again."

        def change(text, edit):
            data = json.loads(text)
            edit(data)
            return json.dumps(data)

        folder = self.broken(
            lambda text: change(text, lambda d: d["methods"][1]["summary"][3].pop("mse"))
        )
        self.fails(
            2, f'{folder}/compare.json: methods[1]: summary[3]: "mse" is missing; {advice}', folder
        )
        folder = self.broken(lambda text: change(text, lambda d: d["reference"].update(spp="many")))
        self.fails(2, f'{folder}/compare.json: reference: "spp" is not a number; {advice}', folder)

    def test_undefined_numbers_are_dashes(self):
        def undefined(text):
            data = json.loads(text)
            for budget in data["methods"][0]["summary"]:
                budget.update(mse=None, mse_stderr=None, bias=None, rays=float("nan"))
            data["methods"][1]["summary"][2]["mse"] = -1e-4
            return json.dumps(data)

        folder = self.broken(undefined, "undefined")
        self.assertEqual(run(folder).returncode, 0)
        with open(os.path.join(folder, "report.html"), encoding="utf-8") as stream:
            page = stream.read()
        self.assertIn("<td>–</td>", page)
        self.assertNotRegex(page, r"(?i)>\s*(nan|none|inf)\b")

    def test_without_matplotlib(self):
        stub = os.path.join(self.temporary.name, "stub")
        os.makedirs(os.path.join(stub, "matplotlib"))
        with open(os.path.join(stub, "matplotlib", "__init__.py"), "w") as out:
            out.write("raise ImportError(\"No module named 'matplotlib'\")\n")
        self.fails(
            3,
            "the charts need matplotlib and numpy (No module named 'matplotlib'): on Debian"
            " `apt-get install python3-matplotlib python3-numpy` and run this with"
            " /usr/bin/python3, elsewhere `pip install matplotlib numpy`",
            self.mirror,
            PYTHONPATH=stub,
        )


class TestFigures(unittest.TestCase):
    """The page of tools/paper --figures."""

    def test_a_fit_is_shown_in_two_scenes(self):
        with tempfile.TemporaryDirectory(prefix="limn_figures_") as folder:
            fitting(folder)
            for name in [*(f"{step:05}" for step in range(0, 50, 5)), "target"]:
                write_png(os.path.join(folder, f"elsewhere_{name}.png"), np.full((4, 4, 3), 0.5))
            figures = [Figure("Fig. 6", "A fit", "a", "b", [Part("fit", "fit", "room.xml")])]
            file = os.path.join(folder, "figures.html")
            missing = figure_page.write(file, figures, lambda part: folder, ["tools/paper", "--figures"])
            with open(file, encoding="utf-8") as stream:
                page = stream.read()
        self.assertEqual(missing, 0)
        self.assertNotIn("Picture missing", page)
        self.assertEqual(page.count("data:image/png;base64,"), 2 * 11)
        self.assertIn("<h3>adaptive: limn&#x27;s default</h3>", page)
        self.assertIn("45</td><td>0.00217</td>", page)

    def test_a_budget_has_a_row_for_every_share(self):
        with tempfile.TemporaryDirectory(prefix="limn_figures_") as folder:
            rows = [{"name": "quadric", "spp": 128, "trials": 0, "leaves": 0, "mse": 0.5}]
            rows += [{"name": "mitsuba", "spp": n, "trials": 6, "leaves": 84000, "mse": 25 / n} for n in (32, 64)]
            with open(os.path.join(folder, "budget.json"), "w") as stream:
                json.dump({"spp": 128, "rows": rows, "missing": ""}, stream)
            file = os.path.join(folder, "figures.html")
            figures = [Figure("Fig. 6", "A budget", "a", "b", [Part("x", "budget", "room.xml")])]
            self.assertEqual(figure_page.write(file, figures, lambda part: folder, ["tools/paper"]), 0)
            with open(file, encoding="utf-8") as stream:
                page = stream.read()
        self.assertIn("<td>32</td><td>84 k</td><td>6</td><td>0.781</td>", page)
        self.assertEqual(page.count('class="best"'), 1)
        self.assertIn("squared error by an equal budget: quadric 0.500, mitsuba 0.391", page)

    def test_a_figure_has_its_words_pictures_and_commands(self):
        with tempfile.TemporaryDirectory(prefix="limn_figures_") as temporary:
            mirror, _, bunny = write_samples(os.path.join(temporary, "runs"))
            counted = os.path.join(temporary, "runs", "table")
            os.makedirs(counted)
            with open(os.path.join(counted, "edges.json"), "w") as stream:
                json.dump({"mesh": "a/cube.obj", "edges": 12, "without_concave": 9}, stream)
            with open(os.path.join(counted, "draws.json"), "w") as stream:
                row = {"name": "quadric", "draw_ns": 800, "hit_rate": 0.7, "efficiency": 0.25, "build_ms": 50,
                       "bytes_per_edge": 70}
                json.dump({"edges": 9000, "ray_ns": 160, "rows": [row], "command": "edge_benchmark x"}, stream)
            for name, method, rays, total, error in (("b0", "forest", None, 2, 0.0), ("b1", "was", 8, 3, 0.1),
                                                     ("b2", "was", 32, 2.2, 0.1)):
                os.makedirs(os.path.join(temporary, "runs", name))
                with open(os.path.join(temporary, "runs", name, "gradient.json"), "w") as stream:
                    json.dump({"method": method, "settings": {"auxiliary rays": rays} if rays else {},
                               "parameters": [{"sum": total, "sum_stderr": error}]}, stream)
            figures = [
                Figure("Fig. 1", "A title", "what it <shows>", "what to see",
                       [Part("mirror", "compare", "mirror.xml", methods=["forest"])], "samples"),
                Figure("Fig. 2", "Patches", "b", "c", [Part("bunny", "reject", "bunny.ply")]),
                Figure("Table 3", "Edges", "d", "e", [Part("table", "edges", "cube.obj")]),
                Figure("Its code", "draws", "d", "e", [Part("table", "draws", "cube.obj")]),
                Figure("Fig. 5", "Bias", "d", "e", [Part(f"b{i}", "gradient", "x.xml") for i in range(3)]),
                Figure("Fig. 4", "Not run", "f", "g", [Part("none", "compare", "no.xml")]),
            ]
            file = os.path.join(temporary, "figures.html")
            runs = os.path.join(temporary, "runs")
            missing = figure_page.write(file, figures, lambda part: os.path.join(runs, part.name),
                                        ["tools/paper", "--figures"])
            with open(file, encoding="utf-8") as stream:
                page = stream.read()
        self.assertEqual(missing, 1)
        for figure in figures:
            self.assertEqual(page.count(f"{figure.numbers}: {figure.title}</h2>"), 1)
            self.assertIn("tools/paper --figures --only " + ",".join(r.name for r in figure.runs), page)
        self.assertIn("what it &lt;shows&gt;", page)
        self.assertIn("limn compare scenes/mirror.xml", page)
        self.assertIn("limn reject meshes/bunny.ply", page)
        self.assertNotIn("Picture missing", page)
        # Scene, reference and two of each method that ran, and the reference behind them; two of
        # each variant.
        self.assertEqual(page.count("data:image/png;base64,"), 3 + 2 * 5 + 2 * 3)
        self.assertIn("Mitsuba is not installed", page)
        self.assertEqual(page.count('class="bad"'), 1)  # the method that is made biased
        self.assertIn("<td>800</td><td>5.00</td><td>70 %</td><td>0.250</td><td>0.0500</td><td>70.0</td>", page)
        self.assertIn("<td>8</td><td>3.00</td><td>50 ± 5 %</td><td>10.0</td>", page)
        self.assertIn("<td>32</td><td>2.20</td><td>10 ± 5 %</td><td>2.00</td>", page)
        (chart,) = re.findall(r'<svg role="img" aria-label="Bias over rays.*?</svg>', page, re.S)
        self.assertEqual(re.findall(r"<text[^>]*>(\d+)</text>", chart)[:2], ["8", "32"])
        places = {}
        for mark, y in re.findall(r'<use href="#([^"]*)" [^>]*y="([\d.]+)" style="fill: currentColor; stroke: c', chart):
            places.setdefault(mark, []).append(float(y))
        marks, ends = sorted(places.values(), key=len)
        # 50 % and 10 %; their bars are from 40 % to 60 % and from 0.5 % to 20 %.
        self.assertEqual((len(marks), len(ends)), (2, 4))
        self.assertAlmostEqual((marks[1] - marks[0]) / (max(ends) - min(ends)), math.log(5) / math.log(120), places=3)
        self.assertIn("rays a draw, 9 k edges: quadric 5.00", page)
        self.assertIn("cube.obj</th><td>12</td><td>9</td><td>75 %", page)

    def test_edges_are_counted(self):
        cube = [(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]
        quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
        self.assertEqual(meshes.count_edges(cube, faces), (12, 0))
        inside_out = [(a, c, b) for a, b, c in faces]
        self.assertEqual(meshes.count_edges(cube, inside_out), (12, 12))
        points, triangles = meshes.sphere(2000)
        self.assertEqual(meshes.count_edges(points, triangles), (3 * len(triangles) // 2, 0))
        # Quadrilaterals of a torus are plane, and a quarter of its edges are concave: those along
        # the inner half of the tube.
        points, triangles = meshes.torus(2000)
        edges = len(triangles)
        self.assertEqual(meshes.count_edges(points, triangles), (edges, edges // 4))


if __name__ == "__main__":
    unittest.main()
