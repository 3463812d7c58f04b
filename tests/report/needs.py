"""Ends a test as skipped, with the reason, where something that it needs is not installed."""

import sys

from browser import find_browser

SKIPPED = 77  # What tests/CMakeLists.txt tells ctest.


def skip(reason):
    print(f"SKIPPED: {reason}")
    sys.exit(SKIPPED)


def need_matplotlib():
    try:
        # This import makes the list of fonts where there is none yet. It is made here, as matplotlib
        # writes a warning when that takes long, and tests compare what programs write.
        import matplotlib.font_manager  # noqa: F401
        import numpy  # noqa: F401
    except ImportError as error:
        skip(f"{error}: apt-get install python3-matplotlib python3-numpy")


def need_browser():
    path = find_browser()
    return path or skip("no Chromium: apt-get install chromium")
