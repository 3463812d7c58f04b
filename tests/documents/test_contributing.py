#!/usr/bin/env python3
"""CONTRIBUTING.md's table against the code: each row's example is named in the files that the row
lists and in no other, and these are no more than the row says.
"""

import os
import re
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
FOLDERS = ("src", "include", "edgetree", "integrators", "tools")


def code_files():
    """(name from the root, text) of all that is compiled, but for the tests."""
    yield "CMakeLists.txt", read("CMakeLists.txt")
    for folder in FOLDERS:
        for inside, _, names in os.walk(os.path.join(ROOT, folder)):
            for name in names:
                if name.endswith((".h", ".cpp", ".inc", "CMakeLists.txt")):
                    file = os.path.relpath(os.path.join(inside, name), ROOT)
                    yield file, read(file)


def read(file):
    with open(os.path.join(ROOT, file), encoding="utf-8") as stream:
        return stream.read()


def quoted(cell):
    return re.findall(r"`([^`]+)`", cell)


def rows():
    """(what to add, most files, its files, names of its example)."""
    table = re.search(r"^\| to add \|.*?\n\n", read("CONTRIBUTING.md"), re.M | re.S)[0]
    for line in table.strip().splitlines()[2:]:
        kind, _, files, names = [cell.strip() for cell in line.strip("|").split("|")]
        yield kind, int(files.split(":")[0]), quoted(files), quoted(names)


class Contributing(unittest.TestCase):
    def test_examples_are_named_where_the_table_says(self):
        code = dict(code_files())
        for kind, most, files, names in rows():
            with self.subTest(kind=kind):
                # The example's own file is named, too, by what builds it.
                words = [*names, os.path.basename(files[0])]
                pattern = re.compile("|".join(rf"(?<!\w){re.escape(w)}(?!\w)" for w in words))
                found = {file for file, text in code.items() if pattern.search(text)}
                self.assertEqual(found, set(files))
                self.assertLessEqual(len(files), most)
                self.assertLessEqual(most, 4)
                # A name that is nowhere would hold the table to nothing.
                for name in names:
                    self.assertTrue(any(name in code[file] for file in files), name)

    def test_no_mode_names_a_term(self):
        """Forward and reverse mode, fits and comparisons take their terms from the table."""
        table = "integrators/terms/term_table.h"
        code = dict(code_files())
        terms = re.findall(r'\.name = ("\w+"),[^;]*?(make_\w+_term),', code[table], re.S)
        self.assertGreater(len(terms), 6)
        for name, factory in terms:
            own = {file for file, text in code.items() if re.search(rf"\b{factory}\b", text)}
            self.assertEqual(len(own), 2, factory)
            for file in code:
                if file.startswith("integrators/") and file not in own:
                    self.assertNotIn(name, code[file], file)
        for mode in ("methods/term_job.cpp", "backward/reverse_estimator.cpp"):
            self.assertIn("terms_of(", code["integrators/" + mode])

    def test_every_kind_has_its_row(self):
        kinds = " ".join(kind for kind, *_ in rows())
        for kind in ("sampler", "method", "term", "command", "BSDF", "texture", "light", "shape"):
            self.assertIn(kind, kinds)


if __name__ == "__main__":
    unittest.main()
