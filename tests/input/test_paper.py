"""tools/paper with a program in limn's place that notes how it was called."""
import json
import os
import signal
import stat
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
PAPER = os.path.join(ROOT, "tools", "paper")

# Fails for the parts named in `fail`, waits for an interrupt in those named in `wait`.
STAND_IN = """#!{python}
import json, os, signal, sys, time
here = os.path.dirname(os.path.abspath(__file__))
arguments = sys.argv[1:]
folder = arguments[arguments.index("-o") + 1]
name = os.path.basename(folder)
with open(os.path.join(here, "calls"), "a") as out:
    out.write(json.dumps(arguments) + "\\n")
def listed(file):
    path = os.path.join(here, file)
    return os.path.exists(path) and name in open(path).read().split()
def write(status):
    with open(os.path.join(folder, arguments[0] + ".json"), "w") as out:
        json.dump({{"methods": [{{"name": "forest"}}, {{"name": "fd", "time_ratio": 12.5, "time_ratio_stderr": 0.5}}],
                    "variants": [{{"name": "li2019", "hit_rate": 0.25}}]}}, out)
    sys.exit(status)
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
        self.assertEqual(self.value(shadow, "--methods"), "forest,silhouettes,moving-directions,adaptive,forest-no-lights,li2019,uniform,fd")
        self.assertEqual(self.value(shadow, "--time"), self.value(mirror, "--time"))
        self.assertEqual(self.value(shadow, "--seed"), "7")
        self.assertEqual(reject[:2], ["reject", "build/generated/pebble.ply"])
        self.assertIn("fd 12.5 +- 0.5", done.stdout)
        self.assertIn("li2019 25 %", done.stdout)

    def test_figures(self):
        cube = "".join(f"v {k & 1} {k >> 1 & 1} {k >> 2}\n" for k in range(8))
        mesh = self.write("cube.obj", cube + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n")
        only = "fig7-torus,fig9-given-cube,fig10-32-rays-alpha-0.05,table2-given-cube"
        done = self.paper("--figures", "--mesh", mesh, "--only", only)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(self.names(), only.split(",")[:3])
        torus, given, warped = self.calls()
        self.assertEqual((torus[0], self.value(torus, "--node-edges")), ("reject", "128"))
        self.assertTrue(os.path.exists(torus[1]))
        self.assertIn("li2019-solid", self.value(torus, "--methods").split(","))
        self.assertIn(f"mesh={mesh}", given)
        self.assertIn("format=obj", given)
        self.assertEqual((self.value(warped, "--aux"), self.value(warped, "--kappa")), ("32", "1e5"))
        self.assertIn("12 edges, 12 of them not concave", done.stdout)
        self.paper("--figures", "--mesh", mesh, "--only", only)
        self.assertEqual(len(self.calls()), 3)

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
                                   (["--figures", "--only", "cad"], "--only: no part is called \"cad\""),
                                   (["--limn", "/no/such"], "/no/such: no such program")):
            done = self.paper(*arguments)
            self.assertEqual(done.returncode, 2)
            self.assertIn(message, done.stderr)
        self.assertEqual(self.calls(), [])


if __name__ == "__main__":
    unittest.main()
