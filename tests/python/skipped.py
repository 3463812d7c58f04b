#!/usr/bin/env python3
"""Stands in for the tests of the Python module where it was not built: says why."""

import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
REASON = os.path.join(ROOT, "build", "venv.missing")

if os.path.exists(REASON):
    with open(REASON, encoding="utf-8") as stream:
        print("SKIPPED:", stream.read().strip())
else:
    print("SKIPPED: built without LIMN_PYTHON; tools/test builds with it")
sys.exit(77)
