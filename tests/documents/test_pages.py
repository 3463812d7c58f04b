#!/usr/bin/env python3
"""The pages: links that lead somewhere, prose within 100 columns, few words and lines, the field's
words, small pictures, one version.
"""

import os
import re
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
WIDTH = 100
MOST_PICTURE_BYTES = 3_000_000
MOST_WORDS = 20_000  # of all pages together, as wc -w counts them
MOST_LINES = 150  # of a page
# Words for which the field has its own, each with the field's (some are names in code, which may
# stay).
FOREIGN = {
    r"convoys?": "wavefront",
    r"dead ends?": "false positive",
    r"even in batches|even numbers": "low-discrepancy points",
    r"found no edge": "rejected by the sampler",
    r"glare": "specular reflection of an emitter",
    r"hair's gap": "infinitesimal gap",
    r"hit rates?": "acceptance rate",
    r"jumps?": "radiance difference",
    r"kinks?": "non-differentiable point",
    r"lamps?": "area light",
    r"left out|left to roulette": "terminated by Russian roulette",
    r"levers?": "ablation",
    r"positions that move|directions that turn": "reparameterised",
    r"rims?": "boundary edge",
    r"squares of all": "sum of squares",
    r"without extent": "delta light",
}


def pages():
    """(name from the root, text) of every page in the repository."""
    for folder, inner, names in os.walk(ROOT):
        inner[:] = [n for n in inner if not n.startswith(("build", ".")) and n != "out"]
        for name in names:
            if name.endswith(".md"):
                file = os.path.join(folder, name)
                with open(file, encoding="utf-8") as stream:
                    yield os.path.relpath(file, ROOT), stream.read()


def read(name):
    with open(os.path.join(ROOT, name), encoding="utf-8") as stream:
        return stream.read()


def words_of(text):
    """A page on one line, without code and without what links lead to."""
    lines, fenced = [], False
    for line in text.splitlines():
        fenced ^= line.startswith("```")
        if not fenced and not line.startswith("    "):
            lines.append(line)
    return re.sub(r"`[^`]*`|\]\([^)]*\)|\s+", " ", " ".join(lines))


class Pages(unittest.TestCase):
    def test_links_lead_to_files(self):
        for name, text in pages():
            here = os.path.dirname(os.path.join(ROOT, name))
            targets = re.findall(r"\]\(([^)\s]+)\)", text)
            targets += re.findall(r"^\[[^]]+\]: (\S+)$", text, re.MULTILINE)
            for target in (t for t in targets if not t.startswith(("https://", "#"))):
                with self.subTest(page=name, target=target):
                    self.assertTrue(os.path.exists(os.path.join(here, target.split("#")[0])))

    # Tables, samples of output and what a link makes long are left as they are.
    def test_prose_keeps_to_the_width(self):
        for name, text in pages():
            fenced = False
            for number, line in enumerate(text.splitlines(), 1):
                fenced ^= line.startswith("```")
                exempt = line.startswith(("    ", "|", "![")) or re.match(r"\[[^]]+\]: ", line)
                if not fenced and not exempt:
                    with self.subTest(page=name, line=number):
                        self.assertLessEqual(len(line), WIDTH)

    # Words about them are comments of the shell.
    def test_lines_of_commands_run_as_printed(self):
        for name, text in pages():
            for line in re.findall(r"^ {4}(?:\$ )?((?:tools|build)/.*)$", text, re.MULTILINE):
                with self.subTest(page=name, line=line):
                    self.assertIsNone(re.search(r"\S {2,}(?!#)\S", line))

    def test_pages_are_short(self):
        total = 0
        for name, text in pages():
            total += len(text.split())
            with self.subTest(page=name):
                self.assertLessEqual(text.count("\n"), MOST_LINES)
        self.assertLessEqual(total, MOST_WORDS)

    def test_words_are_the_field_s(self):
        for name, text in pages():
            prose = words_of(text)
            for foreign, known in FOREIGN.items():
                with self.subTest(page=name, known=known):
                    found = re.search(rf"(?i)(?<![\w-])({foreign})(?![\w-])", prose)
                    self.assertIsNone(found)

    def test_pictures_are_small_and_shown(self):
        folder = os.path.join(ROOT, "scenes", "pictures")
        shown = set()
        for _, text in pages():
            shown |= set(re.findall(r"!\[[^]]*\]\([^)]*pictures/([\w.]+)\)", text))
        self.assertEqual(shown, set(os.listdir(folder)))
        total = sum(os.path.getsize(os.path.join(folder, n)) for n in shown)
        self.assertLessEqual(total, MOST_PICTURE_BYTES)

    def test_one_version_everywhere(self):
        version = re.search(r"project\(limn VERSION (\S+)", read("CMakeLists.txt"))[1]
        self.assertEqual(re.search(r"^version: (\S+)$", read("CITATION.cff"), re.M)[1], version)
        self.assertEqual(re.search(r"^## (\S+)", read("CHANGELOG.md"), re.M)[1], version)
        short = version.rsplit(".", 1)[0]
        self.assertIn(f"find_package(limn {short})", read("README.md"))


if __name__ == "__main__":
    unittest.main()
