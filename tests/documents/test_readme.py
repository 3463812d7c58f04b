#!/usr/bin/env python3
"""README.md's shell lines, run in their order with few samples and pixels: PROGRAM GENERATOR."""

import os
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAM, GENERATOR = sys.argv.pop(1), sys.argv.pop(1)
SMALLER = {r"(width|height)=\d+": r"\1=16", r"--spp \d+": "--spp 4", r"--time \d+": "--time 0.1",
           r"--steps \d+": "--steps 2"}
# Debian's mesh and sky, and what stands in where they are not installed.
DATA = {"mesh": ("/usr/share/glmark2/models/bunny.obj", "creature", "creature.obj"),
        "sky": ("/usr/share/blender/datafiles/studiolights/world/sunset.exr", "sky_soft", "sky.exr")}


def shell_lines():
    """The lines after a prompt, those that a backslash continues as one."""
    with open(os.path.join(ROOT, "README.md"), encoding="utf-8") as stream:
        text = stream.read().replace("\\\n", " ")
    return re.findall(r"^    \$ (.*)$", text, re.MULTILINE)


class Readme(unittest.TestCase):
    def test_shell_lines_run(self):
        lines = shell_lines()
        self.assertGreater(len(lines), 5)
        with tempfile.TemporaryDirectory() as folder:
            os.symlink(os.path.join(ROOT, "scenes"), os.path.join(folder, "scenes"))
            os.mkdir(os.path.join(folder, "build"))
            os.symlink(PROGRAM, os.path.join(folder, "build", "limn"))
            replaced = []
            for name, (file, kind, made) in DATA.items():
                if os.path.exists(file):
                    continue
                subprocess.run([GENERATOR, kind, made], cwd=folder, check=True, capture_output=True)
                replaced.append(f"-D {name}={made}")
            for line in lines:
                for long, short in SMALLER.items():
                    line = re.sub(long, short, line)
                if "demo.xml" in line:
                    line = " ".join([line, *replaced])
                with self.subTest(line=line):
                    run = subprocess.run(["bash", "-c", line], cwd=folder, capture_output=True,
                                         text=True)
                    # So few samples need not be enough for a check to tell.
                    done = (0, 4) if line.startswith("build/limn check") else (0,)
                    self.assertIn(run.returncode, done, run.stdout + run.stderr)

    def test_scripts_are_there(self):
        with open(os.path.join(ROOT, "README.md"), encoding="utf-8") as stream:
            scripts = re.findall(r"^    (tools/\S+)", stream.read(), re.MULTILINE)
        self.assertTrue(scripts)
        for script in scripts:
            self.assertTrue(os.access(os.path.join(ROOT, script), os.X_OK), script)


if __name__ == "__main__":
    unittest.main()
