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

from report.python import use_one_with_matplotlib


def write(file, text):
    from report.records import ReportError

    try:
        with open(file, "w", encoding="utf-8") as stream:
            stream.write(text)
    except OSError as error:
        raise ReportError(f"{file}: cannot be written: {error.strerror}") from None


def run(arguments):
    from report import charts
    from report.page import page
    from report.records import ReportError, read_folder

    folders, status = arguments.folders, 2
    alone = os.path.join(folders[0], "report.html")
    file = arguments.output or (alone if len(folders) == 1 else "report.html")
    try:
        results = [result for folder in folders for result in read_folder(folder)]
        status = 3
        charts.require_matplotlib()
        status = 2
        text, missing = page(results)
        write(file, text)
    except ReportError as error:
        print(f"tools/report.py: {error}", file=sys.stderr)
        return status
    for name in missing:
        print(f"tools/report.py: warning: picture missing: {name}", file=sys.stderr)
    print(f"{file}: {len(results)} {'section' if len(results) == 1 else 'sections'}")
    return 0


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", metavar="FOLDER",
                        help="where compare.json, reject.json or fit.json lies")
    parser.add_argument("-o", "--output", metavar="FILE", help="the page (default: "
                        "FOLDER/report.html, or report.html for several folders)")
    arguments = parser.parse_args()
    use_one_with_matplotlib()
    return run(arguments)


if __name__ == "__main__":
    sys.exit(main())
