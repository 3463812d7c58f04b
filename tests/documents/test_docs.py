#!/usr/bin/env python3
"""tools/docs: the pages are made without a warning, the notebooks run and show their pictures,
nothing is fetched from a network, and the reference names everything.
"""

import os
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
NOTEBOOKS = ["first_gradient", "is_it_right", "shape_from_shadow", "relight"]


def read(*parts):
    with open(os.path.join(*parts), encoding="utf-8") as stream:
        return stream.read()


class Docs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = os.environ["LIMN_DOCS"]

    def pages(self):
        for folder, _, names in os.walk(self.folder):
            for name in names:
                if name.endswith(".html"):
                    yield os.path.join(folder, name)

    def test_nothing_is_fetched(self):
        for page in self.pages():
            fetched = re.findall(r'<(?:script|img|link|iframe)\b[^>]*(?:src|href)="(https?:[^"]*)"',
                                 read(page))
            self.assertEqual(fetched, [], page)

    def test_notebooks_show_their_pictures(self):
        for name in NOTEBOOKS:
            page = read(self.folder, "tools", "python", "notebooks", f"{name}.html")
            self.assertGreaterEqual(len(re.findall(r'<img [^>]*src="[^"]*_images/', page)), 2, name)

    def test_photographs_and_bad_starts_are_uses(self):
        menu = read(self.folder, "history.html").split('class="caption"')
        (use,) = [part for part in menu if '<span class="caption-text">Use</span>' in part]
        for page in ("tools/python/RECONSTRUCT", "scenes/regularised/README"):
            self.assertIn(f"{page}.html", use)

    def test_the_history_has_its_table(self):
        page = read(self.folder, "history.html")
        with open(os.path.join(ROOT, "tools", "history.csv"), encoding="utf-8") as stream:
            rows = len(stream.readlines())
        self.assertEqual(page.count("<tr "), rows)

    def test_every_command_method_and_function_is_named(self):
        program = os.path.join(ROOT, "build", "limn")
        pages = {n: read(self.folder, "reference", f"{n}.html") for n in ("commands", "methods", "python")}
        listed = subprocess.check_output([program, "--help"], text=True).split("Subcommands:")[1]
        commands = re.findall(r"^  (\w+)  +\S", listed, re.MULTILINE)
        methods = subprocess.check_output([program, "methods"], text=True).splitlines()[1:]
        names = re.search(r"__all__ = \[(.*?)\]",
                          read(ROOT, "tools", "python", "limn", "__init__.py"), re.DOTALL)[1]
        self.assertGreater(len(commands), 8)
        for page, wanted in (("commands", commands), ("methods", [m.split()[0] for m in methods]),
                             ("python", re.findall(r'"(\w+)"', names))):
            for name in wanted:
                with self.subTest(page=page, name=name):
                    self.assertRegex(pages[page], rf"[>\b]{name}[<\b]")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="limn_docs_") as made:
        os.environ["LIMN_DOCS"] = made
        done = subprocess.run([os.path.join(ROOT, "tools", "docs"), "-o", made], check=False,
                              capture_output=True, text=True)
        if done.returncode == 77:
            print("SKIPPED:", done.stderr.strip())
            sys.exit(77)
        if done.returncode:
            sys.exit(done.stdout + done.stderr)
        unittest.main()
