"""Opens a report of sample folders in headless Chromium: every picture and chart is there, nothing
is asked of the network or the disk, nothing complains, in light and dark mode, wide, narrow and
printed.
"""

import os
import subprocess
import sys
import tempfile
import unittest

from needs import need_browser, need_matplotlib

need_matplotlib()
BROWSER = need_browser()

from browser import Browser  # noqa: E402
from sample_folders import write_samples  # noqa: E402

REPORT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tools", "report.py")
# Text of a chart or a heading against what lies behind it (WCAG 2: 4.5 is enough for small text).
CONTRAST = """(() => {
  const light = (colour) => colour.match(/[0-9.]+/g).slice(0, 3).map(Number).map(c => c / 255)
      .map(c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
      .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const page = light(getComputedStyle(document.body).backgroundColor);
  const texts = document.querySelectorAll('svg text, h2, td, th, figcaption, .hint, .bad');
  const ratios = [...texts].map(e => {
    const style = getComputedStyle(e);
    const ink = light(e.tagName == 'text' ? style.fill : style.color);
    return (Math.max(ink, page) + 0.05) / (Math.min(ink, page) + 0.05);
  });
  return Math.min(...ratios);
})()"""


class TestReportInBrowser(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="limn_report_")
        cls.folders = write_samples(os.path.join(cls.folder.name, "runs"))
        cls.file = os.path.join(cls.folder.name, "report.html")
        subprocess.run([sys.executable, REPORT, *cls.folders, "-o", cls.file], check=True)
        cls.browser = Browser(BROWSER)
        cls.browser.show(1280)
        cls.browser.open(cls.file)

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()
        cls.folder.cleanup()

    def test_every_picture_is_decoded(self):
        sizes = self.browser.evaluate(
            "[...document.images].map(i => [i.alt, i.complete, i.naturalWidth])"
        )
        # Two comparisons: picture and reference, two per method that ran; a rejection:
        # two per variant.
        self.assertEqual(len(sizes), (2 + 2 * 5) + (2 + 2 * 3) + 2 * 3)
        self.assertEqual([s for s in sizes if not s[1] or s[2] != 48 or not s[0]], [])

    def test_every_chart_is_drawn(self):
        charts = self.browser.evaluate(
            """[...document.querySelectorAll('svg')].map(s => [s.getAttribute('aria-label'),
            s.getBoundingClientRect().width, s.getBoundingClientRect().height,
            s.querySelectorAll('text').length])
            """
        )
        # Overview; error against time and factors of two comparisons; hit rates and depths.
        self.assertEqual(len(charts), 1 + 2 * 2 + 2)
        self.assertEqual([c for c in charts if not c[0] or c[1] < 300 or c[2] < 80 or c[3] < 5], [])

    def test_references_within_the_page_have_targets(self):
        lost = self.browser.evaluate(
            """[...document.querySelectorAll('[href^="#"]')]
            .map(e => e.getAttribute('href').slice(1)).filter(id => !document.getElementById(id))"""
        )
        self.assertEqual(lost, [])
        twice = self.browser.evaluate(
            """(() => { const ids = [...document.querySelectorAll('[id]')].map(e => e.id);
            return ids.filter((id, i) => ids.indexOf(id) != i); })()"""
        )
        self.assertEqual(twice, [])

    def test_nothing_is_asked_of_network_or_disk(self):
        outside = [url for url in self.browser.requests if not url.startswith("data:")]
        self.assertEqual(outside, [f"file://{os.path.abspath(self.file)}"])

    def test_nothing_complains(self):
        self.assertEqual(self.browser.complaints, [])
        self.assertEqual(self.browser.evaluate("document.scripts.length"), 0)
        self.assertEqual(self.browser.evaluate("document.compatMode"), "CSS1Compat")

    def test_pointing_at_a_derivative_shows_the_reference(self):
        state = """(() => { const box = document.querySelector('.flips'); %s;
            return [getComputedStyle(box.firstChild).opacity,
                    getComputedStyle(box).backgroundImage.startsWith('url("data:')]; })()"""
        self.assertEqual(self.browser.evaluate(state % "box.blur()"), ["1", True])
        self.assertEqual(self.browser.evaluate(state % "box.focus()"), ["0", True])
        self.browser.evaluate("document.activeElement.blur()")

    def test_picture_sizes(self):
        widths = self.browser.evaluate("""[0, 1, 2].map(i => {
            document.getElementById('part-0-size-' + i).checked = true;
            return document.querySelector('#part-0 img').getBoundingClientRect().width; })""")
        self.assertEqual(widths, sorted(set(widths)))

    def test_legible_in_light_and_dark(self):
        for scheme in ("light", "dark"):
            self.browser.show(1280, scheme)
            self.assertGreaterEqual(self.browser.evaluate(CONTRAST), 4.5, scheme)
        self.browser.show(1280)

    def test_fits_its_window(self):
        for width in (360, 800, 1280):
            self.browser.show(width)
            self.assertLessEqual(
                self.browser.evaluate("document.documentElement.scrollWidth"), width
            )
        self.browser.show(1280)

    def test_tables_fit_a_window_of_1280(self):
        cut = self.browser.evaluate("""[...document.querySelectorAll('.scroll')].filter(
            e => e.checkVisibility() && e.scrollWidth > e.clientWidth)
            .map(e => [e.getAttribute('aria-label'), e.scrollWidth, e.clientWidth])""")
        self.assertEqual(cut, [])

    def test_prints_on_white(self):
        self.browser.show(1280, "dark", "print")
        self.assertEqual(
            self.browser.evaluate("getComputedStyle(document.body).backgroundColor"),
            "rgb(255, 255, 255)",
        )
        self.assertGreaterEqual(self.browser.evaluate(CONTRAST), 4.5)
        self.browser.show(1280)


if __name__ == "__main__":
    unittest.main()
