"""Every C++ file is as clang-format leaves it (.clang-format), and no comment is wider than a line; skipped where the
tool is missing."""
import os
import shutil
import subprocess
import sys

SKIPPED = 77
ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
FOLDERS = ("include", "src", "edgetree", "integrators", "tools", "tests")
VERSION = 14  # others break lines elsewhere
WIDTH = 100  # clang-format leaves comments as they are


def cpp_files():
    for folder in FOLDERS:
        for path, _, names in os.walk(os.path.join(ROOT, folder)):
            yield from (os.path.join(path, n) for n in sorted(names) if n.endswith((".h", ".cpp")))


def wide_comments(file):
    with open(file, encoding="utf-8") as stream:
        return [n for n, line in enumerate(stream, 1)
                if line.lstrip().startswith("//") and len(line.rstrip("\n")) > WIDTH]


def main():
    tool = shutil.which(f"clang-format-{VERSION}") or shutil.which("clang-format")
    if tool is None:
        print("skipped: clang-format is not installed (tools/packages test)")
        return SKIPPED
    version = subprocess.run([tool, "--version"], capture_output=True, text=True).stdout
    if f"version {VERSION}." not in version:
        print(f"skipped: the style is that of clang-format {VERSION}, here is {version.strip()}")
        return SKIPPED
    files = list(cpp_files())
    done = subprocess.run([tool, "--dry-run", "--Werror", *files], capture_output=True, text=True)
    wrong = sorted({line.split(":")[0] for line in done.stderr.splitlines() if " error: " in line})
    for file in wrong:
        print(f"clang-format -i {os.path.relpath(file, ROOT)}")
    wide = [f"{os.path.relpath(file, ROOT)}:{n}" for file in files for n in wide_comments(file)]
    for place in wide:
        print(f"{place}: a comment of more than {WIDTH} columns")
    print(f"{len(files)} files, {len(wrong)} not in format")
    return 0 if files and not wrong and not wide and done.returncode == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
