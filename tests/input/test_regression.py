#!/usr/bin/env python3
"""tools/mitsuba/regression.py and derivatives.py on folders that are made here, and, where
MITSUBA_DATA names a clone of mitsuba-data, the first on its tests.

    test_regression.py LIMN
"""

import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SCENE = """<scene version="3.0.0"><integrator type="path"/><sensor type="perspective">
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/>
<string name="component_format" value="float32"/></film></sensor>
<emitter type="constant"><rgb name="radiance" value="{}"/></emitter>{}</scene>"""
LIMN = sys.argv.pop() if len(sys.argv) > 1 else None


def run(tool, folder, *options):
    tool = os.path.join(ROOT, "tools", "mitsuba", tool)
    return subprocess.run([sys.executable, tool, folder, "--limn", LIMN, *options],
                          capture_output=True, text=True, check=False)


def regression(folder, *options):
    return run("regression.py", folder, *options)


def skip_without_numpy(test):
    try:
        import numpy  # noqa: F401
    except ImportError:
        test.skipTest("numpy is not installed")


class Derivatives(unittest.TestCase):
    def test_checks_kinds_and_goes_on(self):
        skip_without_numpy(self)
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as out:
            for name, bsdf in (("matt", "diffuse"), ("mirror", "conductor")):
                with open(os.path.join(folder, name + ".xml"), "w", encoding="utf-8") as stream:
                    stream.write(SCENE.format(0.5, '<shape type="rectangle" id="wall"><transform '
                                              'name="to_world"><translate z="4"/></transform>'
                                              f'<bsdf type="{bsdf}"/></shape>'))
            # Nothing takes as little as this, so only the first runs are made.
            options = ["-o", out, "--film", "8", "--seconds", "1e-6"]
            done = run("derivatives.py", folder, *options)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            self.assertRegex(done.stdout, r"matt.xml +forward wall.bsdf.reflectance: agree")
            self.assertRegex(done.stdout, r"matt.xml +paths wall.bsdf.reflectance: agree")
            self.assertRegex(done.stdout, r"\nsensor.fov +[0-4] ")
            self.assertIn("in 2 scenes (1 with smooth lobes)", done.stdout)
            self.assertIn("paths: all kinds agree in 2 of 2 scenes", done.stdout)
            self.assertRegex(done.stdout, "forward: all kinds agree in [01] of 1 scenes")
            again = run("derivatives.py", folder, *options)
            self.assertNotIn("matt.xml", again.stdout)
            file = os.path.join(out, "results.json")
            with open(file, encoding="utf-8") as stream:
                text = stream.read()
            with open(file, "w", encoding="utf-8") as stream:
                stream.write(text.replace('"verdict": "agree"', '"verdict": "disagree"', 1))
            wrong = run("derivatives.py", folder, *options)
            self.assertEqual(wrong.returncode, 1, wrong.stdout)
            self.assertRegex(wrong.stdout,
                             r" checks agree, \d+ more coarsely, \d+ are zero, 1 disagree")


class Regression(unittest.TestCase):
    def setUp(self):
        skip_without_numpy(self)

    def write(self, folder, name, radiance, reference, more=""):
        """A scene, and references of another radiance and of a variance of 0.01."""
        os.makedirs(os.path.join(folder, "refs"), exist_ok=True)
        scene = os.path.join(folder, name + ".xml")
        for value, file in ((reference, "_ref_rgb"), (0.01, "_ref_rgb_var")):
            with open(scene, "w", encoding="utf-8") as stream:
                stream.write(SCENE.format(value, ""))
            # Each sample for its own pixel: constant at borders, too.
            subprocess.run([LIMN, "render", scene, "--quiet", "--spp", "1", "--generator",
                            "independent", "-o",
                            os.path.join(folder, "refs", name + file + ".exr")], check=True)
        with open(scene, "w", encoding="utf-8") as stream:
            stream.write(SCENE.format(radiance, more))

    def test_tells_right_from_wrong(self):
        with tempfile.TemporaryDirectory() as folder:
            self.write(folder, "right", 0.5, 0.5)
            self.write(folder, "wrong", 0.5, 0.51)
            os.rename(os.path.join(folder, "wrong.xml"), os.path.join(folder, "wrong_path.xml"))
            # Off by less than Mitsuba's test sees.
            self.write(folder, "outdated", 0.5, 0.502)
            self.write(folder, "unread", 0.5, 0.5, '<volume type="homogeneous"/>')
            done = regression(folder, "--at-least", "1")
            self.assertEqual(done.returncode, 0, done.stderr)
            lines = {line.split()[0]: line for line in done.stdout.splitlines()}
            self.assertTrue(lines["right.xml"].endswith("passes passes"), done.stdout)
            self.assertTrue(lines["wrong_path.xml"].endswith("FAILS FAILS"), done.stdout)
            if importlib.util.find_spec("mitsuba"):
                self.assertTrue(lines["outdated.xml"].endswith("passes passes"), done.stdout)
                self.assertIn("Mitsuba's own image: ", done.stdout)
            else:
                self.assertTrue(lines["outdated.xml"].endswith("passes FAILS"), done.stdout)
                self.assertIn("Mitsuba is not installed", done.stdout)
            self.assertIn("unknown element <volume>", lines["unread.xml"])
            self.assertRegex(done.stdout, "[12] pass both of 3 that open, of 4 with references")
            self.assertEqual(regression(folder, "--at-least", "3").returncode, 1)

    def test_mitsuba_data(self):
        folder = os.environ.get("MITSUBA_DATA")
        if not folder:
            self.skipTest("MITSUBA_DATA names no clone of mitsuba-data")
        done = regression(os.path.join(folder, "tests", "scenes"), "--only", "floating_sphere",
                          "--at-least", "1")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
