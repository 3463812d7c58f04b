"""scenes/fits/fits.py: the fits of functions load, step and go down, and their table says so.

    test_fits.py LIMN
"""
import json
import os
import pty
import shutil
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
FITS = os.path.join(ROOT, "scenes", "fits", "fits.py")
LIMN = ""  # the program, from the command line


class FitsOfFunctions(unittest.TestCase):
    def rows(self, name, folder, steps, only):
        run = subprocess.run(
            [sys.executable, FITS, name, "-o", folder, "--limn", LIMN, "--size", "8", "--steps",
             str(steps), "--only", only, "--threads", "2"],
            capture_output=True, text=True, check=False)  # fmt: skip
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)
        rows = [line.split("  ") for line in run.stdout.splitlines()]
        return [[cell.strip() for cell in row if cell.strip()] for row in rows if len(row) > 7]

    def test_load_and_step_downwards(self):
        for name, views, scalars in (("tree", 1, 1), ("gears", 1, 15), ("displacement", 8, 0)):
            with self.subTest(fit=name), tempfile.TemporaryDirectory() as folder:
                rows = self.rows(name, folder, 2, "lbfgs")
                self.assertEqual(rows[-2][:3], ["fit", "steps", "last / first loss"])
                self.assertEqual(rows[-1][:2], ["lbfgs", "2"])
                with open(os.path.join(folder, f"{name}_lbfgs", "fit.json")) as file:
                    fit = json.load(file)
                losses = [h["loss"] for h in fit["history"]]
                self.assertEqual(len(losses), 2)
                self.assertLess(losses[1], losses[0])
                self.assertEqual(len(fit["history"][0]["views"]), views)
                self.assertEqual(len(fit["scalars"]), scalars)

    # The target is an image of the same function: at the truth nothing is left.
    def test_truth_is_where_the_loss_is_zero(self):
        with tempfile.TemporaryDirectory() as folder:
            self.rows("displacement", folder, 1, "lbfgs")
            words = [LIMN, "fit", os.path.join(ROOT, "scenes", "fits", "displacement.xml")]
            for i in range(8):
                words += ["--target", os.path.join(folder, f"stone_{i}.exr")]
            defines = [f"mesh={folder}/stone.obj", "format=obj", "width=8", "height=8"]
            words += [w for d in defines for w in ("-D", d)]
            words += ["--wrt", "object.displacement", "--method", "analytic", "--points", "faces",
                      "--steps", "1", "--no-report", "-o", f"{folder}/at_truth"]  # fmt: skip
            subprocess.run(words, check=True, capture_output=True)
            with open(os.path.join(folder, "at_truth", "fit.json")) as file:
                # Targets are rounded to floats.
                self.assertLess(json.load(file)["history"][0]["loss"], 1e-12)

    # A person at a terminal reads an error on a line of its own, not behind half a line of progress.
    def test_an_error_takes_the_line_of_progress_away(self):
        with tempfile.TemporaryDirectory() as folder:
            out = os.path.join(folder, "out")
            scene = [os.path.join(ROOT, "scenes", "fits", "displacement.xml"), "-D", "width=8",
                     "-D", "height=8"]  # fmt: skip
            self.rows("displacement", folder, 1, "lbfgs")
            scene += ["-D", f"mesh={folder}/stone.obj", "-D", "format=obj"]
            words = [w for i in range(8) for w in ("--target", os.path.join(folder, f"stone_{i}.exr"))]
            ours, theirs = pty.openpty()
            fit = subprocess.Popen(
                [LIMN, "fit", *scene, *words, "--wrt", "object.displacement", "--spp", "16",
                 "--steps", "100000", "--snapshots", "20", "--no-report", "-o", out],
                stdout=subprocess.DEVNULL, stderr=theirs)  # fmt: skip
            os.close(theirs)
            told = b""
            while b"\rfit:" not in told:
                told += os.read(ours, 4096)
            shutil.rmtree(out)
            try:
                while part := os.read(ours, 4096):
                    told += part
            except OSError:  # the other end is closed
                pass
            self.assertEqual(fit.wait(), 2)
            last = told.decode().rstrip().split("\r")[-1]
            self.assertIn(out, last)
            self.assertNotIn("fit:", last)
            self.assertTrue(last.startswith("\x1b[K"), last)


if __name__ == "__main__":
    LIMN = sys.argv.pop(1)
    if not os.path.exists(os.path.join(ROOT, "build", "generated", "ball.ply")):
        print("no meshes in build/generated: left out")
        sys.exit(77)
    unittest.main()
