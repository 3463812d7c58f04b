"""The whole page: head, style, contents, sections and how to read them."""

import os

from .colours import Palette
from .comparison import ComparisonSection, biases
from .fitting import FitSection
from .markup import Markup, document, element, join
from .overview import Overview
from .rejection import RejectionSection

# A report with unbiased methods only shows a false alarm of bias in one of a hundred reports.
FALSE_ALARM = 0.01

READING = {
    "compare": [
        (
            "Equal time",
            (
                "Every method gets the same measured seconds on the same threads, its set-up"
                " included; repeats of different methods are interleaved, so that whatever else the"
                " machine did hit all alike."
            ),
        ),
        (
            "Derivative pictures",
            (
                "Red: the pixel gets brighter as the parameter grows; blue: darker; white: no"
                " change. All of a section share one scale, and all error pictures another."
            ),
        ),
        (
            "Mean squared error",
            (
                "Mean over pixels and channels of the squared difference to the reference, less the"
                " reference's own variance, so that a perfect method scores zero. Relative: divided"
                " by the reference's mean square. Trimmed: without the 0.1 % of pixels with the"
                " largest errors; where it is far smaller, a few bright samples rule the error."
            ),
        ),
        (
            "Time for equal error",
            (
                "How many times longer than the first method this one must run until its error is"
                " as small: the ratio of error times seconds, which holds for methods whose error"
                " falls as one over time."
            ),
        ),
        (
            "Slope",
            (
                "Of log error over log time. −1 is what unbiased sampling gives. Finite differences"
                " flatten out where the bias of their step begins to show."
            ),
        ),
        (
            "Bias z",
            (
                "Means over blocks of pixels, minus the reference's, in units of their standard"
                " errors: standard normal if the method is unbiased. p is the chance of scores as"
                " large as these. It is marked where p is too small even for the number of tests in"
                " this report (one false alarm in a hundred reports)."
            ),
        ),
    ],
    "fit": [
        (
            "Loss",
            (
                "Mean over views, pixels and channels, from two independent images of each view, so"
                " that it is unbiased and may come out below zero near the target (such points are"
                " left out). Band: its standard error."
            ),
        ),
        (
            "Distance to the truth",
            (
                "Of points spread evenly over either surface to the nearest point of the other one:"
                " the mean (chamfer), what 95 % do not exceed, and the largest (Hausdorff), over"
                " the diagonal of the true mesh's bounds; and the angle between the faces there."
            ),
        ),
        (
            "Faces inside out, crossings",
            (
                "Faces whose front is not outside, and pairs of faces that pass through each other:"
                " no gradient undoes either."
            ),
        ),
    ],
    "reject": [
        (
            "Slices",
            (
                "A rejection test says of a point in space whether a group of edges may hold a"
                " silhouette as seen from there. Grey: rejected, rightly. Blue: accepted, and there"
                " is one. Orange: accepted in vain, which costs time and misses. Red: a silhouette"
                " lost; there must be none."
            ),
        ),
        (
            "Reachable edges",
            (
                "Edges that a descent from one shading point can end on. Those that are no"
                " silhouettes are wasted."
            ),
        ),
        (
            "Hit rate",
            (
                "Share of descents that end on a true silhouette, over shading points around the"
                " whole mesh."
            ),
        ),
    ],
}


def _methods(results):
    for result in results:
        if result.kind == "fit":
            yield "fit"
            continue
        key = "methods" if result.kind == "compare" else "variants"
        yield from (entry.text("name") for entry in result.data.records(key))


def _style(palette):
    with open(os.path.join(os.path.dirname(__file__), "style.css"), encoding="utf-8") as stream:
        rules = stream.read()
    return rules.replace("/*light*/", palette.css(0) + ";").replace(
        "/*dark*/", palette.css(1) + ";"
    )


def _reading(kinds):
    entries = [
        join(element("dt", term), element("dd", text))
        for kind in READING
        if kind in kinds
        for term, text in READING[kind]
    ]
    return element(
        "section", element("h2", "How to read this"), element("dl", *entries), id="reading"
    )


def _contents(sections, overview):
    links = [("overview", "Overview")] if overview else []
    links += [(s.group, s.title) for s in sections] + [("reading", "How to read this")]
    return element(
        "nav",
        element(
            "ol", *(element("li", element("a", title, href=f"#{group}")) for group, title in links)
        ),
        aria_label="Contents",
    )


def _title(results, sections):
    if len(sections) == 1:
        return f"limn: {sections[0].title}"
    counts = [
        (sum(r.kind == kind for r in results), word)
        for kind, word in (("compare", "comparison"), ("reject", "rejection test"), ("fit", "fit"))
    ]
    return "limn: " + ", ".join(f"{n} {word}{'' if n == 1 else 's'}" for n, word in counts if n)


def page(results):
    """The HTML of a report on these results (records.Result), and the files of pictures that were
    missing.
    """
    palette = Palette(_methods(results))
    tests = sum(1 for r in results if r.kind == "compare" for _ in biases(r.data))
    threshold = FALSE_ALARM / max(1, tests)
    makers = {
        "compare": lambda *a: ComparisonSection(*a, threshold),
        "reject": RejectionSection,
        "fit": FitSection,
    }
    sections = [makers[r.kind](r, f"part-{i}", palette) for i, r in enumerate(results)]
    parts = [section.html() for section in sections]
    # Fits have nothing in common that an overview could show.
    overview = len(sections) > 1 and any(r.kind != "fit" for r in results)
    if overview:
        listed = [(r, s.group, s.title) for r, s in zip(results, sections)]
        parts.insert(
            0,
            Overview(
                [entry for entry in listed if entry[0].kind == "compare"],
                [entry for entry in listed if entry[0].kind == "reject"],
                palette,
                threshold,
            ).html(),
        )
    title = _title(results, sections)
    style = join(Markup(_style(palette)), *(rule for s in sections for rule in s.styles))
    page = document(
        title,
        style,
        element("header", element("h1", title), _contents(sections, overview)),
        element("main", *parts, _reading({r.kind for r in results})),
    )
    return page, [name for section in sections for name in section.pictures.missing]
