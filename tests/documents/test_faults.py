#!/usr/bin/env python3
"""The list of faults: each text occurs once in its file, its program exists, the table has it."""

import csv
import os
import re
import sys
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "tests", "faults"))

from fault_list import FAULTS  # noqa: E402
from faults import HEAD, TABLE  # noqa: E402


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
        programs = {*re.findall(r"limn_test\((\w+)", read("tests", "CMakeLists.txt")), "python"}
        self.assertLessEqual({f.program for f in FAULTS}, programs)

    def test_sources_include_their_header(self):
        for fault in FAULTS:
            if fault.file.endswith(".h"):
                self.assertTrue(fault.sources, fault.name)
            for name in fault.sources:
                self.assertTrue(os.path.isfile(os.path.join(ROOT, name)), name)

    def test_table_has_them_all(self):
        with open(TABLE, encoding="utf-8", newline="") as stream:
            head, *rows = csv.reader(stream)
        self.assertEqual(head, HEAD)
        self.assertEqual([row[:3] for row in rows], [[f.part, f.name, f.program] for f in FAULTS],
                         "tests/faults/faults.py --write")


if __name__ == "__main__":
    unittest.main()
