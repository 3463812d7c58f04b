"""What tools/mitsuba/mitsuba_gradient.py says and returns where Mitsuba is not installed, or cannot do what
is asked.
"""

import json
import os
import subprocess
import sys
import tempfile
import types
import unittest

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
TOOL = os.path.join(ROOT, "tools", "mitsuba", "mitsuba_gradient.py")
sys.path[:0] = [os.path.dirname(TOOL), os.path.join(ROOT, "tools")]
import mitsuba_gradient  # noqa: E402

SCENE = os.path.join(ROOT, "scenes", "closed_form", "cube_in_sky.xml")


class TestMitsubaGradient(unittest.TestCase):
    def setUp(self):
        # A Python without Mitsuba, whatever is installed here.
        self.folder = tempfile.TemporaryDirectory(prefix="limn_mitsuba_")
        with open(os.path.join(self.folder.name, "mitsuba.py"), "w") as out:
            out.write("raise ImportError(\"No module named 'mitsuba'\")\n")
        self.addCleanup(self.folder.cleanup)

    def run_tool(self, *arguments):
        image = os.path.join(self.folder.name, "image.exr")
        done = subprocess.run(
            [sys.executable, TOOL, SCENE, "-o", image, *arguments],
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONPATH": self.folder.name},
        )
        self.assertFalse(os.path.exists(image))
        return done.returncode, done.stderr

    def test_not_installed(self):
        self.assertEqual(
            self.run_tool("--wrt", "object.translate.y", "--time", "1"),
            (
                3,
                (
                    f"tools/mitsuba/mitsuba_gradient.py: Mitsuba is not installed for {sys.executable} (No"
                    " module named 'mitsuba'): pip install mitsuba==3.9.1\n"
                ),
            ),
        )

    def test_parameters_that_it_cannot_move(self):
        for name in (
            "sensor.fov",
            "object_bsdf.reflectance",
            "object.vertex_positions:FILE",
            "object.translate",
        ):
            self.assertEqual(
                self.run_tool("--wrt", name, "--time", "1"),
                (
                    4,
                    (
                        f"tools/mitsuba/mitsuba_gradient.py: {name}: not supported by this method (known:"
                        " SHAPE.translate.x, .y, .z, SHAPE.rotate.x, .y, .z, SHAPE.scale)\n"
                    ),
                ),
            )

    def test_an_equal_budget_without_it(self):
        """A program in limn's place writes 1 where the reference is 3."""
        import exr
        import numpy as np

        path = lambda name: os.path.join(self.folder.name, name)  # noqa: E731
        for name, value in (("one.exr", 1), ("reference.exr", 3)):
            with open(path(name), "wb") as out:
                out.write(exr.rgb_bytes(np.full((2, 3), value)))
        with open(path("limn"), "w") as out:
            out.write(f'#!/bin/sh\nwhile [ "$1" != -o ]; do shift; done\ncp {path("one.exr")} "$2"\n')
        os.chmod(path("limn"), 0o755)
        tool = os.path.join(os.path.dirname(TOOL), "equal_budget.py")
        subprocess.run([sys.executable, tool, SCENE, "--wrt", "object.scale", "--methods", "quadric", "--limn", path("limn"),
                        "--reference", path("reference.exr"), "-o", self.folder.name],
                       check=True, env={**os.environ, "PYTHONPATH": self.folder.name})
        with open(path("budget.json")) as stream:
            told = json.load(stream)
        self.assertEqual(told["rows"], [{"name": "quadric", "spp": 128, "trials": 0, "leaves": 0, "mse": 4.0}])
        self.assertIn("pip install mitsuba==3.9.1", told["missing"])

    def test_arguments(self):
        for arguments, message in (
            (["--time", "-1"], "argument --time: invalid positive float value: '-1'"),
            (["--time", "1", "-D", "width"], 'argument -D: "width" is not NAME=VALUE'),
            ([], "one of the arguments --time --spp is required"),
        ):
            status, text = self.run_tool("--wrt", "object.scale", *arguments)
            self.assertEqual(
                (status, text.splitlines()[-1]), (2, f"mitsuba_gradient.py: error: {message}")
            )

    def test_time_may_begin_after_the_setup(self):
        """Thirty seconds of set-up and passes of two, by a clock of its own."""
        for after_setup, passes, seconds, setup, left_out in ((False, 1, 32, 30, 0), (True, 5, 10, 0, 30)):
            now = [0]
            term = types.SimpleNamespace(name="interior", passes=0, seconds=0, pass_seconds=2)

            def take(seconds, now=now):
                now[0] += seconds
                return [1]

            def add_a_pass(term):
                take(2)
                term.passes += 1

            renderer = mitsuba_gradient.Renderer.__new__(mitsuba_gradient.Renderer)
            renderer._clock = types.SimpleNamespace(seconds=lambda now=now: now[0], compilation=0)
            renderer._guiding, renderer._spp, renderer._terms = "octree", 128, [term]
            renderer._shares, renderer._counted_pass = lambda take=take: take(30), add_a_pass
            told = renderer.figures(renderer.render_for(10, after_setup), "3", after_setup)
            self.assertEqual(term.passes, passes)
            self.assertEqual((told["seconds"], told["setup_seconds"], told["setup_not_counted_seconds"]),
                             (seconds, setup, left_out))


if __name__ == "__main__":
    unittest.main()
