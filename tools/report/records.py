"""JSON files whose every access is checked: a faulty file is named, and the place in it."""

import json
import math
import os

KINDS = ("compare", "reject", "fit")  # of results, each a file KIND.json


class ReportError(Exception):
    """A fault that the user can mend; the text says what is wrong, where, and what to do."""


class Record:
    """A JSON object that knows where it stands. `number` may be None: JSON has no other word for
    "undefined", and programs write null for what is not finite."""

    def __init__(self, values, place):
        self.values, self.place = values, place

    def _fail(self, key, expected):
        found = "is missing" if key not in self.values else f"is not {expected}"
        raise ReportError(f'{self.place}: "{key}" {found}; was the file written by another '
                          "version of limn? Run its command again.")

    def _get(self, key, kinds, expected, default=None):
        value = self.values.get(key, default)
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            self._fail(key, expected)
        return value

    def has(self, key):
        return self.values.get(key) is not None

    def text(self, key, default=None):
        return self._get(key, (str,), "a text", default)

    def flag(self, key, default=None):
        return self._get(key, (bool,), "true or false", default)

    def number(self, key):
        if key not in self.values:
            self._fail(key, "a number")
        value = self._get(key, (int, float, type(None)), "a number")
        return value if value is not None and math.isfinite(value) else None

    def total(self, keys):
        """The sum of several numbers; None counts as zero."""
        return sum(self.number(key) or 0 for key in keys)

    def numbers(self, key):
        values = self._get(key, (list,), "a list of numbers")
        if any(isinstance(v, bool) or not isinstance(v, (int, float)) for v in values):
            self._fail(key, "a list of numbers")
        return values

    def record(self, key):
        return Record(self._get(key, (dict,), "an object"), f"{self.place}: {key}")

    def record_or_none(self, key):
        return self.record(key) if self.has(key) else None

    def records(self, key):
        values = self._get(key, (list,), "a list of objects")
        if not all(isinstance(v, dict) for v in values):
            self._fail(key, "a list of objects")
        return [Record(v, f"{self.place}: {key}[{i}]") for i, v in enumerate(values)]

    def items(self):
        return self.values.items()


class Result:
    """One compare.json, reject.json or fit.json. data: Record, folder: where its pictures lie."""

    def __init__(self, folder, data):
        self.folder, self.data = folder, data
        self.kind = data.text("kind")
        if self.kind not in KINDS:
            known = ", ".join(KINDS)
            raise ReportError(f'{data.place}: "kind" is "{self.kind}" (known: {known})')


def read_record(file):
    try:
        with open(file, encoding="utf-8") as stream:
            values = json.load(stream)
    except OSError as error:
        raise ReportError(f"{file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ReportError(f"{file}: not a text file") from None
    except json.JSONDecodeError as error:
        raise ReportError(f"{file}:{error.lineno}:{error.colno}: not JSON: {error.msg}; "
                          "run the command that wrote it again") from None
    if not isinstance(values, dict):
        raise ReportError(f"{file}: not a JSON object")
    return Record(values, file)


def read_folder(folder):
    """All results in a folder, at least one."""
    if not os.path.isdir(folder):
        raise ReportError(f"{folder}: no such folder")
    files = [os.path.join(folder, f"{kind}.json") for kind in KINDS]
    results = [Result(folder, read_record(file)) for file in files if os.path.exists(file)]
    if not results:
        raise ReportError(
            f"{folder}: neither compare.json nor reject.json nor fit.json is here; "
            f"make one with `limn compare ... -o {folder}`, `limn reject ... -o {folder}` or "
            f"`limn fit ... -o {folder}`")
    return results
