"""tools/paper with a program in limn's place that notes how it was called.

    test_paper.py [LIMN]    with limn itself: whether it knows the methods
"""
import json
import os
import signal
import stat
import subprocess
import sys
import tempfile
import time
import unittest
from unittest import mock

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
PAPER = os.path.join(ROOT, "tools", "paper")

LIMN = sys.argv.pop() if len(sys.argv) > 1 and os.access(sys.argv[-1], os.X_OK) else ""

# Fails for the parts named in `fail`, waits for an interrupt in those named in `wait`.
STAND_IN = """#!{python}
import json, os, signal, sys, time
here = os.path.dirname(os.path.abspath(__file__))
arguments = sys.argv[1:]
folder = arguments[arguments.index("-o") + 1]
name = os.path.basename(folder)
with open(os.path.join(here, "calls"), "a") as out:
    out.write(json.dumps(arguments) + "\\n")
if arguments[0] == "render":
    open(folder, "w").close()
    sys.exit(0)
def listed(file):
    path = os.path.join(here, file)
    return os.path.exists(path) and name in open(path).read().split()
def write(status):
    errors = os.path.join(here, "errors")
    if arguments[0] == "compare" and os.path.exists(errors):
        with open(os.path.join(folder, "compare.json"), "w") as out:
            json.dump(comparison(json.load(open(errors))), out)
        sys.exit(status)
    kind = "budget" if "budget" in arguments[0] else arguments[0]
    with open(os.path.join(folder, kind + ".json"), "w") as out:
        json.dump({{"rows": [{{"name": "quadric", "mse": 0.125}}], "snapshots": [{{"step": step, "meshes": [{{"chamfer": chamfer}}]}} for step, chamfer in ((0, 0.5), (40, 0.25))],
                    "methods": [{{"name": "forest"}}, {{"name": "fd", "time_ratio": 12.5, "time_ratio_stderr": 0.5}}],
                    "variants": [{{"name": "li2019", "hit_rate": 0.25}}]}}, out)
    sys.exit(status)
def comparison(errors):
    methods = []
    for name in arguments[arguments.index("--methods") + 1].split(","):
        mse, stderr, trimmed, p = errors.get(name, [1, 0, 1, 0.5])
        budget = dict(mse=mse, trimmed_mse=trimmed, relative_mse=mse / 8, seconds=2, spp=16, bias=dict(p=p))
        runs = [dict(time=2.5, seconds=2, mse=mse + k * stderr, trimmed_mse=trimmed) for k in (-3 ** 0.5, 0, 3 ** 0.5)]
        runs.append(dict(time=1.25, seconds=1, mse=100, trimmed_mse=100))
        settings = dict(setup_not_counted_seconds=30.4) if name.startswith("mitsuba") else dict()
        methods.append(dict(name=name, status="done", summary=[budget], runs=runs, settings=settings))
    return dict(methods=methods, times=[2.5], repeats=3, threads=2, width=64, height=64, command="limn compare ...",
                reference=dict(seconds=12, method="adaptive"))
if listed("fail"):
    print("the last words")
    sys.exit(3)
if listed("wait"):
    signal.signal(signal.SIGINT, lambda *_: write(130))
    open(os.path.join(here, "waiting"), "w").close()
    time.sleep(60)
write(0)
"""


class TestPaper(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="limn_paper_")
        self.addCleanup(temporary.cleanup)
        self.folder = temporary.name
        self.limn = self.write("limn", STAND_IN.format(python=sys.executable))
        os.chmod(self.limn, os.stat(self.limn).st_mode | stat.S_IXUSR)

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def write(self, name, text):
        with open(self.path(name), "w") as out:
            out.write(text)
        return self.path(name)

    def command(self, *arguments):
        return [sys.executable, PAPER, "--limn", self.limn, "-o", self.path("out"), "--no-report", *arguments]

    def paper(self, *arguments):
        return subprocess.run(self.command(*arguments), capture_output=True, text=True)

    def calls(self):
        if not os.path.exists(self.path("calls")):
            return []
        with open(self.path("calls")) as stream:
            return [json.loads(line) for line in stream]

    def names(self):
        return [os.path.basename(call[call.index("-o") + 1]) for call in self.calls()]

    def value(self, call, option):
        return call[call.index(option) + 1]

    def test_calls(self):
        done = self.paper("--only", "mirror-0.2,shadow,reject-pebble", "--seed", "7", "--threads", "1")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(self.names(), ["mirror-0.2", "shadow", "reject-pebble"])
        mirror, shadow, reject = self.calls()
        self.assertEqual(mirror[:2], ["compare", "scenes/rough_mirror.xml"])
        self.assertIn("alpha=0.2", mirror)
        self.assertEqual(self.value(shadow, "--methods"), "forest,silhouettes,silhouettes:directions=moving,adaptive:film=fixed:generator=independent,adaptive:generator=independent,adaptive,forest:lights=off,li2019,uniform,fd")
        self.assertEqual(self.value(shadow, "--time"), self.value(mirror, "--time"))
        self.assertEqual(self.value(shadow, "--seed"), "7")
        self.assertEqual(reject[:2], ["reject", "build/generated/pebble.ply"])
        self.assertIn("fd 12.5 +- 0.5", done.stdout)
        self.assertIn("li2019 25 %", done.stdout)

    def test_figures(self):
        cube = "".join(f"v {k & 1} {k >> 1 & 1} {k >> 2}\n" for k in range(8))
        mesh = self.write("cube.obj", cube + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n")
        only = "fig7-torus,fig9-given-cube,fig10-32-rays-alpha-0.05,fig15,table2-given-cube"
        done = self.paper("--figures", "--mesh", mesh, "--only", only)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(self.names(), only.split(",")[:4])
        torus, given, warped, chandelier = self.calls()
        self.assertAlmostEqual(float(self.value(chandelier, "--time")), 3 * float(self.value(given, "--time")), places=4)
        self.assertEqual((torus[0], self.value(torus, "--node-edges")), ("reject", "128"))
        self.assertTrue(os.path.exists(torus[1]))
        self.assertIn("li2019:sphere=solid", self.value(torus, "--methods").split(","))
        self.assertIn(f"mesh={mesh}", given)
        self.assertIn("format=obj", given)
        self.assertEqual((self.value(warped, "--aux"), self.value(warped, "--kappa")), ("32", "1e5"))
        self.assertIn("12 edges, 12 of them not concave", done.stdout)
        self.paper("--figures", "--mesh", mesh, "--only", only)
        self.assertEqual(len(self.calls()), 4)

    def test_the_equal_budget_of_figure_11(self):
        os.makedirs(self.path("out", "meshes"))
        self.write(os.path.join("out", "meshes", "creature_8000.ply"), "")
        with mock.patch.dict(os.environ, LIMN_MITSUBA_PYTHON=self.limn):
            done = self.paper("--figures", "--only", "fig11,fig11-budget")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        timed, budget = self.calls()
        self.assertEqual(budget[:2], ["tools/mitsuba/equal_budget.py", "scenes/rough_mirror.xml"])
        self.assertEqual(self.value(budget, "--methods"), "quadric,adaptive")
        self.assertEqual(self.value(budget, "--reference"), os.path.join(self.value(timed, "-o"), "reference.exr"))
        defined = [[w for w in call if "=" in w] for call in (timed, budget)]
        self.assertEqual(*defined)
        self.assertIn("squared errors: quadric 0.125", done.stdout)

    def test_the_fit_of_figure_14(self):
        done = self.paper("--figures", "--only", "fig14-quadric")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        target, fit, *elsewhere = self.calls()
        self.assertEqual(target[:2], ["render", "scenes/fits/two_mirrors.xml"])
        self.assertEqual(fit[:2], ["fit", "scenes/fits/two_mirrors_start.xml"])
        self.assertEqual(self.value(fit, "--target"), self.value(target, "-o"))
        self.assertEqual(self.value(fit, "--method"), "quadric")
        truth = "mesh=" + os.path.join(os.path.realpath(ROOT), self.value(fit, "--truth"))
        self.assertIn(truth, target)
        self.assertEqual([self.value(call, "-o") for call in elsewhere],
                         [self.path("out", "fig14-quadric", f"elsewhere_{name}.exr") for name in ("00000", "00040", "target")])
        self.assertIn("mesh=" + self.path("out", "fig14-quadric", "step_00040_object.ply"), elsewhere[1])
        self.assertIn(truth, elsewhere[2])
        self.assertIn("chamfer 0.25 of the diagonal", done.stdout)

    def ablations(self, *arguments):
        command = [word for word in self.command("--ablations", *arguments) if word != "--no-report"]
        return subprocess.run(command, capture_output=True, text=True)

    def test_ablations(self):
        """Method: squared error, its standard error, that without the worst pixels, p of the bias; 2 s each."""
        self.write("errors", json.dumps({"forest": [4, 0, 4, 0.5], "adaptive": [1, 0.1, 0.6, 0.25],
                                         "fd": [1.1, 0.11, 1.2, 1e-6], "mitsuba-after-setup": [20, 1, 12, 0.5]}))
        done = self.ablations("--only", "ablations-shadow,ablations-sun", "--mitsuba")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        shadow, sun = self.calls()
        self.assertEqual(self.value(shadow, "--methods"),
                         "forest,silhouettes,silhouettes:directions=moving,adaptive:film=fixed:generator=independent,adaptive:generator=independent,adaptive,fd,mitsuba-after-setup")
        self.assertEqual(self.value(sun, "--methods"), "forest,silhouettes,silhouettes:directions=moving,adaptive:film=fixed:generator=independent,adaptive:generator=independent,adaptive,fd")
        self.assertAlmostEqual(float(self.value(sun, "--time")), 2.6, delta=0.1)
        with open(self.path("out", "ablations.md")) as stream:
            text = stream.read()
        self.assertIn(text, done.stdout)
        cells = "0.5 | 0.25 ± 0 (0.25) | 0.25 ± 0 (0.25) | 0.25 ± 0 (0.25) | 0.25 ± 0 (0.25) | 0.25 ± 0.025 (0.15) | 0.28 ± 0.028 (0.3) |"
        for title in ("soft shadow", "strong sun"):
            self.assertIn(f"\n| {title} | {cells}\n", text)
        self.assertIn("ahead in 0 of 2 parts; even within two standard errors: soft shadow (0.91), strong sun (0.91)", text)
        self.assertIn("\n| soft shadow | 0.05 ± 0.0056 (0.05) | 2 | 16 | 30 |\n", text)
        self.assertIn("Against Mitsuba after its set-up `adaptive` is ahead in 1 of 1 parts (20 times).", text)
        self.assertIn("(12) the smallest p is 0.25 (`adaptive`, soft shadow)", text)
        self.assertIn("Marked are finite differences in soft shadow, finite differences in strong sun.", text)
        # 1 - 0.999 * 0.6 and 1 - 0.999: trimmed means are over the other pixels.
        self.assertIn("`adaptive` 0.4 (soft shadow) to 0.4 (strong sun); `forest` 0.001", text)
        again = self.ablations("--only", "ablations-shadow,ablations-sun", "--mitsuba")
        self.assertIn("ablations-sun: finished before", again.stdout)
        self.assertIn(text, again.stdout)
        self.assertEqual(len(self.calls()), 2)

    def test_ablations_in_the_order_that_a_default_has_them(self):
        self.paper("--only", "shadow")
        self.paper("--ablations", "--only", "ablations-shadow")
        swept, table = self.calls()
        shown = self.value(swept, "--methods").split(",")
        self.assertEqual([m for m in shown if m in self.value(table, "--methods").split(",")],
                         self.value(table, "--methods").split(","))
        self.assertEqual((self.value(swept, "--sweep"), self.value(table, "--sweep")), ("3", "1"))

    @unittest.skipUnless(LIMN, "needs limn")
    def test_the_methods_have_their_names_of_today(self):
        sys.path.insert(0, os.path.join(ROOT, "tools"))
        from paper_figures import ablations, figures
        names = {m for figure in figures.FIGURES for part in figure.runs if part.kind == "compare" for m in part.methods}
        names.update(m for part in ablations.parts(True) for m in part.methods)
        self.paper()
        for call in self.calls():
            if call[0] == "compare":
                names.update(self.value(call, "--methods").split(","))
        done = subprocess.run([LIMN, "compare", self.path("none.xml"), "--wrt", "x", "--time", "1", "-o", self.path("none"),
                               "--methods", ",".join(sorted(names))], capture_output=True, text=True)
        self.assertIn("none.xml: error: cannot read", done.stderr)  # names come first

    def test_mitsuba(self):
        self.paper("--only", "sun", "--mitsuba")
        self.assertTrue(self.value(self.calls()[0], "--methods").endswith(",mitsuba"))

    def test_a_longer_budget_is_for_longer_runs(self):
        self.paper("--only", "sun", "--minutes", "30")
        self.paper("--only", "sun", "--minutes", "60")
        short, long = (float(self.value(call, "--time")) for call in self.calls())
        self.assertGreater(long, 2 * short)
        self.assertLess(long, 3 * short)

    def test_finished_parts_are_skipped(self):
        self.paper("--only", "sun")
        done = self.paper("--only", "sun,cad")
        self.assertIn("sun: finished before", done.stdout)
        self.assertEqual(self.names(), ["sun", "cad"])
        self.paper("--only", "sun,cad", "--again")
        self.assertEqual(self.names(), ["sun", "cad", "sun", "cad"])

    def test_other_settings_are_not_finished(self):
        self.paper("--only", "sun", "--seed", "1")
        self.paper("--only", "sun", "--seed", "2")
        self.assertEqual(self.names(), ["sun", "sun"])

    def test_a_part_that_fails(self):
        self.write("fail", "sun")
        done = self.paper("--only", "sun,cad")
        self.assertEqual(done.returncode, 1)
        self.assertEqual(self.names(), ["sun", "cad"])
        self.assertIn("FAILED: sun: exit status 3: the last words", done.stderr)
        os.remove(self.path("fail"))
        self.assertEqual(self.paper("--only", "sun,cad").returncode, 0)
        self.assertEqual(self.names(), ["sun", "cad", "sun"])

    def test_a_mesh_that_cannot_be_made(self):
        done = self.paper("--only", "mirror-small,cad")
        self.assertEqual(done.returncode, 1)
        self.assertIn("FAILED: mirror-small:", done.stderr)
        self.assertEqual(self.names(), ["cad"])

    def test_an_interrupt_keeps_what_is_finished(self):
        self.write("wait", "cad")
        process = subprocess.Popen(self.command("--only", "sun,cad,plant"), stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        while process.poll() is None and not os.path.exists(self.path("waiting")):
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
        self.assertEqual(process.returncode, 130)
        self.assertIn("the same command goes on where it stopped", errors)
        self.assertEqual(self.names(), ["sun", "cad"])
        os.remove(self.path("wait"))
        self.assertEqual(self.paper("--only", "sun,cad,plant").returncode, 0)
        self.assertEqual(self.names(), ["sun", "cad", "cad", "plant"])

    def test_bad_arguments(self):
        for arguments, message in ((["--only", "moon"], "--only: no part is called \"moon\""),
                                   (["--minutes", "-1"], "not a positive number: -1"),
                                   (["--mesh", "x.obj"], "--mesh: is for --figures"),
                                   (["--figures", "--mesh", "/no/such"], "--mesh: /no/such: no such file"),
                                   (["--ablations", "--figures"], "not allowed with argument"),
                                   (["--ablations", "--only", "cad"], "--only: no part is called \"cad\""),
                                   (["--figures", "--only", "cad"], "--only: no part is called \"cad\""),
                                   (["--limn", "/no/such"], "/no/such: no such program")):
            done = self.paper(*arguments)
            self.assertEqual(done.returncode, 2)
            self.assertIn(message, done.stderr)
        self.assertEqual(self.calls(), [])


if __name__ == "__main__":
    unittest.main()
