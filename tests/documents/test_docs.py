#!/usr/bin/env python3
"""tools/docs: the pages are made without a warning, the notebooks run and show their pictures,
nothing is fetched from a network, the reference names everything, and pages fit wide and narrow
windows.
"""

import ast
import os
import re
import subprocess
import sys
import tempfile
import unittest
from importlib.machinery import SourceFileLoader
from importlib.util import find_spec, module_from_spec, spec_from_loader

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.append(os.path.join(ROOT, "tests", "report"))
from browser import Browser, find_browser  # noqa: E402

NOTEBOOKS = ["first_gradient", "is_it_right", "shape_from_shadow", "relight"]


def read(*parts):
    with open(os.path.join(*parts), encoding="utf-8") as stream:
        return stream.read()


# Elements that reach out of the window and that nothing scrolls into it.
CUT = """(() => {
  const scrolls = e => e && (e.getBoundingClientRect().right <= innerWidth + 1
      && ['auto', 'scroll'].includes(getComputedStyle(e).overflowX) || scrolls(e.parentElement));
  return [...document.querySelectorAll('article *')]
      .filter(e => e.checkVisibility() && e.getBoundingClientRect().right > innerWidth + 1)
      .filter(e => !scrolls(e)).map(e => e.tagName + ' ' + e.textContent.slice(0, 60));
})()"""
SCROLLED_TABLES = """[...document.querySelectorAll('article .table-wrapper')]
    .filter(e => e.scrollWidth > e.clientWidth + 1).map(e => e.textContent.trim().slice(0, 60))"""
MISSING_PICTURES = """Promise.all([...document.querySelectorAll('article img')].map(i =>
    i.decode().then(() => null, () => i.src))).then(all => all.filter(src => src))"""


class Docs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = os.environ["LIMN_DOCS"]

    def pages(self):
        for folder, _, names in os.walk(self.folder):
            for name in names:
                if name.endswith(".html"):
                    yield os.path.join(folder, name)

    @unittest.skipUnless(find_browser(), "no Chromium: apt-get install chromium")
    def test_pages_fit_wide_and_narrow_windows(self):
        browser = Browser(find_browser())
        self.addCleanup(browser.close)
        for page in self.pages():
            browser.open(page)
            for width in (390, 1280):
                browser.show(width)
                with self.subTest(page=page, width=width):
                    shown = browser.evaluate("document.documentElement.scrollWidth")
                    self.assertLessEqual(shown, width)
                    self.assertEqual(browser.evaluate(CUT), [])
            with self.subTest(page=page):
                self.assertEqual(browser.evaluate(SCROLLED_TABLES), [])
                self.assertEqual(browser.evaluate(MISSING_PICTURES), [])
        self.assertEqual(browser.complaints, [])

    @unittest.skipUnless(find_browser() and find_spec("matplotlib"),
                         "no Chromium or matplotlib: apt-get install chromium python3-matplotlib")
    def test_the_page_of_the_history_does_too(self):
        sys.path.append(os.path.join(ROOT, "tools"))
        loader = SourceFileLoader("history", os.path.join(ROOT, "tools", "history"))
        history = module_from_spec(spec_from_loader("history", loader))
        loader.exec_module(history)
        rows = history.table_rows()
        browser = Browser(find_browser())
        self.addCleanup(browser.close)
        with tempfile.TemporaryDirectory() as history.ROOT:
            history.write_page(rows, '<svg width="576" height="432"></svg>')
            browser.open(os.path.join(history.ROOT, "out", "history.html"))
        for width in (390, 1280):
            browser.show(width)
            shown = browser.evaluate("document.documentElement.scrollWidth")
            self.assertLessEqual(shown, width)

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

    def test_every_type_has_its_parameters(self):
        page = re.sub(r"<[^>]*>", " ", read(self.folder, "reference", "parameters.html"))
        types = re.search(r"^TYPES = (\{.*?^\})",
                          read(ROOT, "tools", "python", "limn", "dicts.py"), re.M | re.S)[1]
        types = ast.literal_eval(types)
        self.assertGreater(len(types["bsdf"] + types["emitter"]), 20)
        for tag in ("bsdf", "emitter"):
            for name in (n for n in types[tag] if n != "null"):  # which has none
                with self.subTest(tag=tag, type=name):
                    self.assertRegex(page, rf"{tag} {name}\s")

    # Some are there only where a scene gives them.
    def test_materials_have_all_their_numbers(self):
        page = read(self.folder, "reference", "parameters.html")
        rows = {re.sub("<[^>]*>", "", row).split()[1]: row for row in re.split("<tr[^>]*>", page)
                if ">bsdf " in row}
        for name, numbers in (("principled", "anisotropic clearcoat_gloss eta spec_trans specular"),
                              ("principledthin", "anisotropic eta"),
                              ("roughconductor", "alpha alpha_u alpha_v k"),
                              ("roughdielectric", "alpha alpha_u alpha_v")):
            for number in numbers.split():
                with self.subTest(type=name, number=number):
                    self.assertIn(f">{number}<", rows[name])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="limn_docs_") as made:
        os.environ["LIMN_DOCS"] = made
        done = subprocess.run([os.path.join(ROOT, "tools", "docs"), "--draft", "-o", made], check=False,
                              capture_output=True, text=True)
        if done.returncode == 77:
            print("SKIPPED:", done.stderr.strip())
            sys.exit(77)
        if done.returncode:
            sys.exit(done.stdout + done.stderr)
        unittest.main()
