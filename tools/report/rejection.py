"""The section of one reject.json: slices, reachable edges, rates."""

import os

from . import charts
from .colours import EDGES, SLICES
from .markup import count, element, join, percent, table
from .pictures import Pictures, figure, missing_notice, size_choice

KINDS = tuple(SLICES)


def rate(part, whole):
    return part / whole if whole else None


class RejectionSection:
    """group: prefix of ids in the page."""

    def __init__(self, result, group, palette):
        self.data, self.group, self.palette = result.data, group, palette
        self.pictures = Pictures(result.folder)
        self.variants = self.data.records("variants")
        self.title = f"{os.path.splitext(os.path.basename(self.data.text('mesh')))[0]}: rejection"
        self.styles = []

    def html(self):
        parts = [
            element("h2", self.title),
            self._what(),
            self._missed(),
            self._interrupted(),
            self._gallery(),
            element("h3", "Hit rates"),
            self._hit_chart(),
            self._rates(),
            element("h3", "False accepts by depth"),
            self._depth_chart(),
            self._depth_table(),
            element("h3", "Settings"),
            self._command(),
        ]
        parts.insert(3, missing_notice(self.pictures.missing))
        return element("section", *parts, id=self.group)

    def _what(self):
        data = self.data
        node = data.record("node")
        return element(
            "p",
            f"{data.text('mesh')}: {count(data.number('edges'))} edges, {len(self.variants)}"
            f" variants, seed {data.number('seed')}. The slices cut space around a node at depth"
            f" {node.number('depth')} that holds {count(node.number('edges'))} edges: every point"
            " of them asks the node's rejection test, and brute force knows the answer.",
        )

    def _missed(self):
        """A silhouette that a test loses is a bug of the program, whatever else the report says.
        "missed" of a variant, where it is given, counts those of its descents too.
        """
        lost = {
            v.text("name"): (
                v.number("missed")
                if v.has("missed")
                else sum(s.number("missed") or 0 for s in v.records("slices"))
            )
            for v in self.variants
        }
        wrong = [f"{name}: {times} times" for name, times in lost.items() if times]
        if not wrong:
            return None
        return element(
            "div",
            element("strong", "⚠ Silhouettes were missed. "),
            "This is a bug, and gradients are biased by it: " + "; ".join(wrong) + ".",
            class_="notice danger",
        )

    def _interrupted(self):
        if self.data.text("status", "done") == "done":
            return None
        return element(
            "div",
            element("strong", f"{self.data.text('status')}. "),
            "Only what was finished is shown.",
            class_="notice",
        )

    def _gallery(self):
        cards = [self._overview_card()] + [self._card(v) for v in self.variants]
        return element(
            "div",
            size_choice(self.group),
            self._legend("Slices", SLICES),
            self._legend("Edges", EDGES),
            element("div", *cards, class_="cards"),
            class_="gallery wide",
        )

    def _legend(self, title, names):
        """The colours that the program says it drew with."""
        said = self.data.record_or_none("colors")
        entries = [
            element(
                "span",
                element("span", class_="swatch", style=f"background:{colour}"),
                f" {label}  ",
            )
            for label, colour in (
                (label, said.text(key, colour) if said else colour)
                for key, (label, colour) in names.items()
            )
        ]
        return element("p", f"{title}:  ", *entries, class_="legend")

    def _overview_card(self):
        picture = self.pictures.picture(
            self.data.text("overview"), "the mesh, the chosen node and the slices in space"
        )
        return element(
            "div",
            element("h4", "overview"),
            figure(picture, "mesh, chosen node, slices"),
            class_="card",
        )

    def _card(self, variant):
        name = variant.text("name")
        shown = []
        for i, s in enumerate(variant.records("slices")):
            accepted_wrongly = rate(
                s.number("false_accept"), s.number("false_accept") + s.number("true_reject")
            )
            caption = (
                f"slice {i + 1}: {percent(accepted_wrongly)} of what could be rejected is accepted"
            )
            if s.number("missed"):
                caption += f"; {count(s.number('missed'))} missed"
            shown.append(
                figure(
                    self.pictures.picture(s.text("picture"), f"slice {i + 1} of {name}"), caption
                )
            )
        edges = (
            f"{count(variant.number('reachable_edges'))} edges reachable,"
            f" {count(variant.number('silhouettes'))} silhouettes"
        )
        shown.append(
            figure(
                self.pictures.picture(variant.text("edges_picture"), f"reachable edges of {name}"),
                edges,
            )
        )
        return element("div", self._name(variant, "h4"), *shown, class_="card")

    def _name(self, variant, tag="span"):
        name = variant.text("name")
        swatch = element("span", class_="swatch", style=f"background:{self.palette.variable(name)}")
        return element(tag, swatch, name, title=variant.text("description", ""))

    def _hit_chart(self):
        rows = [
            (v.text("name"), v.number("hit_rate"), v.number("hit_rate_stderr"))
            for v in self.variants
            if v.number("hit_rate") is not None
        ]
        return charts.hit_rates(rows, self.palette) if rows else element("p", "No hit rates.")

    def _rates(self):
        head = [
            "variant",
            "hit rate",
            "reachable edges",
            "silhouettes",
            "false accepts",
            "reachable per silhouette",
            *(f"{SLICES[k][0]}, all slices" for k in KINDS),
            "description",
        ]
        rows = []
        for v in self.variants:
            slices = v.records("slices")
            points = sum(s.number("points") or 0 for s in slices)
            kinds = [percent(rate(sum(s.number(k) or 0 for s in slices), points)) for k in KINDS]
            per = rate(v.number("reachable_edges"), v.number("silhouettes"))
            rows.append(
                [
                    self._name(v),
                    percent(v.number("hit_rate"), v.number("hit_rate_stderr")),
                    count(v.number("reachable_edges")),
                    count(v.number("silhouettes")),
                    count(v.number("false_accepts")),
                    "–" if per is None else f"{per:.2f}",
                    *kinds,
                    element("td", v.text("description", ""), class_="words"),
                ]
            )
        note = element(
            "p",
            "Reachable edges, silhouettes and false accepts belong to one shading point, the one of"
            " the edge pictures; a descent is one draw of an edge. The fewer edges are reachable"
            " per silhouette, the better the rejection.",
            class_="hint",
        )
        return join(table(head, rows, f"Rates, {self.title}"), note)

    def _depth_chart(self):
        return charts.false_accepts_by_depth(self.variants, self.palette)

    def _depth_table(self):
        rows = [
            [
                self._name(v),
                f"{d.number('depth')}",
                count(d.number("nodes_tested")),
                count(d.number("accepted")),
                count(d.number("false_accepts")),
                percent(rate(d.number("false_accepts"), d.number("accepted"))),
            ]
            for v in self.variants
            for d in v.records("by_depth")
        ]
        head = [
            "variant",
            "depth",
            "nodes tested",
            "accepted",
            "false accepts",
            "of those accepted",
        ]
        return element(
            "details",
            element("summary", "By depth, in numbers"),
            table(head, rows, f"By depth, {self.title}"),
        )

    def _command(self):
        return join(
            element("p", "To repeat it (one click selects it all):"),
            element("pre", element("code", self.data.text("command")), class_="command"),
        )
