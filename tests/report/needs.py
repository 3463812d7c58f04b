"""Ends a test as skipped, with the reason, where something that it needs is not installed."""

import sys

from browser import find_browser

SKIPPED = 77  # What tests/CMakeLists.txt tells ctest.


def skip(reason):
    print(f"SKIPPED: {reason}")
    sys.exit(SKIPPED)


def need_matplotlib():
    try:
        import matplotlib  # noqa: F401
        import numpy  # noqa: F401
    except ImportError as error:
        skip(f"{error}: apt-get install python3-matplotlib python3-numpy")


def need_browser():
    path = find_browser()
    return path or skip("no Chromium: apt-get install chromium")
