#!/usr/bin/env python3
"""One HTML page from folders that `limn compare`, `reject` or `fit` wrote.

    tools/report.py FOLDER             writes FOLDER/report.html
    tools/report.py FOLDER... -o FILE  all of them in one page, an overview first

Pictures and charts are within the page: it opens from disk and needs no network. The charts need
matplotlib (Debian: python3-matplotlib). Exit status: 0 written, 2 bad input, 3 matplotlib is
missing.
"""

import argparse
import os
import sys

SYSTEM_PYTHON = (  # Where Debian's matplotlib is, when another python3 comes first.
    "/usr/bin/python3"
)


def use_a_python_with_matplotlib():
    """Starts anew under the system's Python where this one has no matplotlib."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        if os.environ.get("LIMN_REPORT_PYTHON") is None and os.access(SYSTEM_PYTHON, os.X_OK):
            os.environ["LIMN_REPORT_PYTHON"] = SYSTEM_PYTHON
            os.execv(SYSTEM_PYTHON, [SYSTEM_PYTHON, os.path.abspath(__file__), *sys.argv[1:]])


def write(file, text):
    from report.errors import ReportError

    try:
        with open(file, "w", encoding="utf-8") as stream:
            stream.write(text)
    except OSError as error:
        raise ReportError(f"{file}: cannot be written: {error.strerror}") from None


def run(arguments):
    from report import charts
    from report.errors import ReportError
    from report.page import page
    from report.records import read_folder

    try:
        results = [result for folder in arguments.folders for result in read_folder(folder)]
    except ReportError as error:
        return fail(error, 2)
    try:
        charts.require_matplotlib()
    except ReportError as error:
        return fail(error, 3)
    one = len(arguments.folders) == 1
    file = arguments.output or (
        os.path.join(arguments.folders[0], "report.html") if one else "report.html"
    )
    try:
        text, missing = page(results)
        write(file, text)
    except ReportError as error:
        return fail(error, 2)
    for name in missing:
        print(f"tools/report.py: warning: picture missing: {name}", file=sys.stderr)
    print(f"{file}: {len(results)} {'section' if len(results) == 1 else 'sections'}")
    return 0


def fail(error, status):
    print(f"tools/report.py: {error}", file=sys.stderr)
    return status


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "folders", nargs="+", metavar="FOLDER", help="where compare.json, reject.json or fit.json lies"
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="the page (default: FOLDER/report.html, or report.html for several folders)",
    )
    arguments = parser.parse_args()
    use_a_python_with_matplotlib()
    return run(arguments)


if __name__ == "__main__":
    sys.exit(main())
