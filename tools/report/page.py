"""The whole page: title, contents, sections and how to read them."""

from .colours import Palette
from .comparison import ComparisonSection, biases
from .fitting import FitSection
from .markup import document, element, how_to_read, join, plural
from .overview import Overview
from .rejection import RejectionSection

# A report with unbiased methods only shows a false alarm of bias in one of a hundred reports.
FALSE_ALARM = 0.01

READING = {
    "compare": [
        ("Equal time",
         "Every method gets the same measured seconds on the same threads, its set-up included;"
         " repeats of different methods are interleaved, so that whatever else the machine does"
         " hits all alike."),
        ("Derivative pictures",
         "Red: the pixel gets brighter as the parameter grows; blue: darker; white: no change. All"
         " of a section share one scale, and all error pictures another."),
        ("Mean squared error",
         "Mean over pixels and channels of the squared difference to the reference, less the"
         " reference's own variance, so that a perfect method scores zero. Relative: divided by the"
         " reference's mean square. Trimmed mean: without the 0.1 % of pixels with the largest"
         " errors; where it is far smaller, a few outliers rule the error."),
        ("Time for equal error",
         "How many times longer than the first method this one must run until its error is as"
         " small: the ratio of error times seconds, which holds for methods whose error falls as"
         " one over time."),
        ("Slope",
         "Of log error over log time. −1 is what unbiased sampling gives. Finite differences"
         " flatten out where the bias of their step begins to show."),
        ("Bias z",
         "Means over blocks of pixels, minus the reference's, in units of their standard errors:"
         " standard normal if the method is unbiased. p is the chance of scores as large as these."
         " It is marked where p is too small even for the number of tests in this report (one false"
         " alarm in a hundred reports)."),
    ],
    "fit": [
        ("Loss",
         "Mean over views, pixels and channels, from two independent images of each view, so that"
         " it is unbiased and may come out below zero near the target (such steps have a mark)."
         " Band: its standard error."),
        ("Distance to the truth",
         "Of points spread evenly over either surface to the nearest point of the other one: the"
         " mean (chamfer), what 95 % do not exceed, and the largest (Hausdorff), over the diagonal"
         " of the true mesh's bounds; and the angle between the faces there."),
        ("Faces inside out, crossings",
         "Faces whose front is not outside, and pairs of faces that pass through each other: no"
         " gradient undoes either."),
    ],
    "reject": [
        ("Slices",
         "A rejection test says of a point in space whether a group of edges may hold a silhouette"
         " as seen from there. Grey: true negative. Blue: true positive. Orange: false positive,"
         " which costs time and samples. Magenta: a silhouette lost; there must be none."),
        ("Reachable edges",
         "Edges that a descent from a shading point can end on. Those that are no silhouettes are"
         " wasted."),
        ("Acceptance rate",
         "Share of descents that end on a true silhouette, over shading points around the whole"
         " mesh."),
    ],
}
NAMES = {"compare": "comparison", "reject": "rejection test", "fit": "fit"}


def palette_of(results):
    """Colours for all methods and variants of these results."""
    names = []
    for result in results:
        key = {"compare": "methods", "reject": "variants"}.get(result.kind)
        names += [r.text("name") for r in result.data.records(key)] if key else ["fit"]
    return Palette(names)


def bias_threshold(results):
    return FALSE_ALARM / max(1, biases(results))


def _contents(sections, overview):
    links = [("overview", "Overview")] if overview else []
    links += [(s.group, s.title) for s in sections] + [("reading", "How to read this")]
    entries = (element("li", element("a", title, href=f"#{group}")) for group, title in links)
    return element("nav", element("ol", *entries), aria_label="Contents")


def _title(results, sections):
    if len(sections) == 1:
        return f"limn: {sections[0].title}"
    counts = {word: sum(r.kind == kind for r in results) for kind, word in NAMES.items()}
    return "limn: " + ", ".join(plural(n, word) for word, n in counts.items() if n)


def page(results):
    """The HTML of a report on these results (records.Result), and the files of pictures that were
    missing."""
    palette, threshold = palette_of(results), bias_threshold(results)
    makers = {"compare": lambda *a: ComparisonSection(*a, threshold), "reject": RejectionSection,
              "fit": FitSection}
    sections = [makers[r.kind](r, f"part-{i}", palette) for i, r in enumerate(results)]
    parts = [section.html() for section in sections]
    # Fits have nothing in common that an overview could show.
    overview = len(sections) > 1 and any(r.kind != "fit" for r in results)
    if overview:
        parts.insert(0, Overview(sections, palette, threshold).html())
    reading = [entry for kind in READING if any(r.kind == kind for r in results)
               for entry in READING[kind]]
    whole = document(_title(results, sections), palette, join(*(s.style for s in sections)),
                     [_contents(sections, overview)], *parts, how_to_read(reading))
    return whole, [name for section in sections for name in section.pictures.missing]
