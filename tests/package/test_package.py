#!/usr/bin/env python3
"""Installs limn into a prefix and lets a project of its own find, link and run it there.

    test_package.py BUILD CMAKE WORK_FOLDER
"""

import json
import os
import re
import shutil
import subprocess
import sys
import unittest

BUILD, CMAKE, WORK = os.path.abspath(sys.argv[1]), sys.argv[2], os.path.abspath(sys.argv[3])
HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
PREFIX, CONSUMER = os.path.join(WORK, "prefix"), os.path.join(WORK, "consumer")


def run(*command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise AssertionError(" ".join(command) + "\n" + done.stdout)
    return done.stdout


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        run(CMAKE, "--install", BUILD, "--prefix", PREFIX)
        cls.configured = run(CMAKE, "-S", HERE, "-B", CONSUMER, "-G", "Ninja",
                             f"-DCMAKE_PREFIX_PATH={PREFIX}", "-DCMAKE_BUILD_TYPE=Release")
        cls.built = run(CMAKE, "--build", CONSUMER)

    # The Python module belongs into a wheel.
    def test_prefix_holds_the_package_alone(self):
        self.assertEqual(sorted(os.listdir(PREFIX)), ["bin", "include", "lib", "share"])

    def test_finding_it_says_nothing_of_its_dependencies(self):
        for word in ("Warning", "warning", "not exist", "not found"):
            self.assertNotIn(word, self.configured)

    def test_using_it_warns_of_nothing(self):
        for word in ("warning:", "note:"):
            self.assertNotIn(word, self.built)

    # The closed form's mean, within five standard errors (two sides: 6e-7).
    def test_program_renders_what_the_closed_form_says(self):
        folder = os.path.join(ROOT, "scenes", "closed_form")
        with open(os.path.join(folder, "references.json"), encoding="utf-8") as stream:
            scenes = json.load(stream)["scenes"]
        exact = next(s for s in scenes if s["file"] == "cube_in_sky.xml")["image"][::3]
        mean, error = map(float, run(os.path.join(CONSUMER, "consumer"),
                                     os.path.join(folder, "cube_in_sky.xml")).split())
        self.assertGreater(error, 0)
        self.assertLess(abs(mean - sum(exact) / len(exact)) / error, 5)

    # A stranger's files are compiled without limn's flags and see the prefix alone.
    def test_no_flag_and_no_folder_of_this_build_leaks(self):
        with open(os.path.join(CONSUMER, "compile_commands.json"), encoding="utf-8") as stream:
            words = json.load(stream)[0]["command"].split()
        self.assertEqual([w for w in words if w.startswith(("-W", "-m", "-f"))], [])
        folders = [b if a == "-isystem" else a[2:] for a, b in zip(words, words[1:] + [""])
                   if a == "-isystem" or a.startswith("-I")]
        self.assertEqual([os.path.normpath(f) for f in folders], [os.path.join(PREFIX, "include")])

    # As wheels are built. GCC warns of lanes in signatures only where it makes code of them.
    def test_lanes_compile_for_any_processor_of_the_kind(self):
        folder = os.path.join(WORK, "portable")
        run(CMAKE, "-S", ROOT, "-B", folder, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Debug",
            "-DLIMN_NATIVE=OFF")
        with open(os.path.join(folder, "compile_commands.json"), encoding="utf-8") as stream:
            commands = {c["file"]: c["command"] for c in json.load(stream)}
        command = commands[os.path.join(ROOT, "edgetree", "lobe", "ltc.cpp")]
        self.assertNotIn("-march", command)
        done = subprocess.run(command, shell=True, cwd=folder, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.assertEqual(done.returncode, 0, done.stdout)

    def test_all_missing_libraries_are_named_at_once(self):
        done = subprocess.run(
            [CMAKE, "-S", ROOT, "-B", os.path.join(WORK, "missing"), "-G", "Ninja",
             "-DCMAKE_DISABLE_FIND_PACKAGE_PNG=ON", "-DCMAKE_DISABLE_FIND_PACKAGE_CLI11=ON",
             "-DCLP_LIBRARY=OFF"],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.assertNotEqual(done.returncode, 0)
        said = " ".join(done.stdout.split())
        self.assertIn("not found: PNG, CLI11, CLP_LIBRARY. tools/packages installs", said)

    # Files of the package name no folder of the source or of the build.
    def test_package_can_be_moved(self):
        for folder, _, names in os.walk(os.path.join(PREFIX, "lib")):
            for name in (n for n in names if n.endswith(".cmake")):
                with open(os.path.join(folder, name), encoding="utf-8") as stream:
                    text = stream.read()
                for place in (os.path.join(ROOT, "src"), BUILD):
                    self.assertNotIn(place, text, name)

    def test_installed_program_finds_its_report_script(self):
        mesh = os.path.join(ROOT, "scenes", "closed_form", "cube_in_sky_object.obj")
        folder = os.path.join(WORK, "reject")
        text = run(os.path.join(PREFIX, "bin", "limn"), "reject", mesh, "--methods", "forest",
                   "--size", "64", "--points", "20", "-o", folder)
        script = os.path.join(PREFIX, "share", "limn", "report.py")
        found = os.path.exists(os.path.join(folder, "report.html")) or f"python3 {script}" in text
        self.assertTrue(found, text)

    def test_installed_program_says_its_version(self):
        with open(os.path.join(ROOT, "CMakeLists.txt"), encoding="utf-8") as stream:
            version = re.search(r"project\(limn VERSION (\S+)", stream.read())[1]
        text = run(os.path.join(PREFIX, "bin", "limn"), "--version")
        self.assertRegex(text, rf"^limn {re.escape(version)} \(commit ([0-9a-f]{{12}}(-dirty)?|"
                               r"unknown), (Release|Debug|RelWithDebInfo|MinSizeRel)\)\n$")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
