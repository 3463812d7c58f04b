"""What the tools that run limn share: arguments, the program, JSON files."""

import argparse
import json
import os
import shutil
import subprocess

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def positive(text):
    """A number above 0, of a command line."""
    number = float(text)
    if not number > 0:
        raise argparse.ArgumentTypeError(f"not a positive number: {text}")
    return number


def names(text):
    """Of a list with commas."""
    return [name for name in text.split(",") if name]


def check_names(parser, option, what, given, known):
    for name in given:
        if name not in known:
            parser.error(f"{option}: no {what} is called \"{name}\" (known: {', '.join(known)})")


def add_common_arguments(parser, folder):
    """Those of every tool that runs limn many times. folder: below out/."""
    parser.add_argument("--seed", type=int, default=1, metavar="N")
    parser.add_argument("-o", "--output", default=os.path.join(ROOT, "out", folder),
                        metavar="FOLDER", help=f"default: out/{folder}")
    parser.add_argument("--limn", metavar="PROGRAM",
                        help="use this one (default: build/limn, which is built first)")


def find_limn(given, *targets):
    """The program's path: `given`, or build/limn, which is built with further targets. Raises
    FileNotFoundError where there is none."""
    if not given:
        print("Building limn (tools/build) ...", flush=True)
        subprocess.run([os.path.join(ROOT, "tools", "build"), "limn", *targets], check=True,
                       cwd=ROOT)
    program = os.path.abspath(given) if given else os.path.join(ROOT, "build", "limn")
    if shutil.which(program) is None:
        raise FileNotFoundError(f"{program}: no such program")
    return program


def commit_line():
    """Of the commit that lies here, for figures that are published; tools/release reads it."""
    commit = subprocess.run(["git", "rev-parse", "--short=8", "HEAD"], cwd=ROOT, text=True,
                            capture_output=True, check=False).stdout.strip()
    return f"Figures: commit `{commit or 'unknown'}`."


def labelled(picture, text, size=15):
    """The picture with a line of text above it, `size` pixels high."""
    from PIL import Image, ImageDraw, ImageFont

    top = size + 9
    whole = Image.new("RGB", (picture.width, picture.height + top), "white")
    whole.paste(picture, (0, top))
    ImageDraw.Draw(whole).text((4, 3), text, "black", ImageFont.truetype("DejaVuSans.ttf", size))
    return whole


def read_json(file):
    """None if it cannot be read."""
    try:
        with open(file, encoding="utf-8") as stream:
            return json.load(stream)
    except (OSError, ValueError):
        return None


def write_json(file, value):
    """Whole or not at all."""
    os.makedirs(os.path.dirname(file), exist_ok=True)
    with open(file + ".partial", "w", encoding="utf-8") as out:
        json.dump(value, out, indent=1)
    os.replace(file + ".partial", file)
