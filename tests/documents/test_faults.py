#!/usr/bin/env python3
"""The list of faults: each text occurs once in its file, its program and its tests exist."""

import os
import re
import sys
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "tests", "faults"))

from fault_list import FAULTS  # noqa: E402
from faults import BEGIN, END  # noqa: E402


def read(*names):
    with open(os.path.join(ROOT, *names), encoding="utf-8") as stream:
        return stream.read()


class Faults(unittest.TestCase):
    def test_texts_occur_once(self):
        for fault in FAULTS:
            with self.subTest(part=fault.part, fault=fault.name):
                self.assertEqual(read(fault.file).count(fault.old), 1)
                self.assertNotEqual(fault.old, fault.new)

    def test_names_are_unique(self):
        names = [(f.part, f.name) for f in FAULTS]
        self.assertEqual(len(names), len(set(names)))
        self.assertGreaterEqual(len(names), 40)

    def test_programs_exist(self):
        programs = set(re.findall(r"limn_test\((\w+)", read("tests", "CMakeLists.txt")))
        self.assertLessEqual({f.program for f in FAULTS}, programs)

    def test_page_has_a_place_for_the_table(self):
        page = read("tests", "README.md")
        self.assertEqual(page.count(BEGIN), 1)
        self.assertEqual(page.split(BEGIN)[1].count(END), 1)


if __name__ == "__main__":
    unittest.main()
