"""The section of one fit.json: loss and distances over steps, a film strip, what was asked."""

import os

from . import charts
from .markup import count, element, figures, join, table, with_error
from .pictures import Pictures, figure, missing_notice, size_choice

# Columns of the strip at most; the table has all snapshots.
STRIP = 7


def chosen(snapshots):
    """Evenly spread, with the first and the last."""
    if len(snapshots) <= STRIP:
        return snapshots
    places = [round(i * (len(snapshots) - 1) / (STRIP - 1)) for i in range(STRIP)]
    return [snapshots[p] for p in places]


class FitSection:
    """group: prefix of ids in the page."""

    def __init__(self, result, group, palette):
        self.data, self.group, self.palette = result.data, group, palette
        self.pictures = Pictures(result.folder)
        self.asked = self.data.record("arguments")
        self.snapshots = self.data.records("snapshots")
        scene = self.asked.records("views")[0].text("scene")
        self.title = f"{os.path.splitext(os.path.basename(scene))[0]}: fit"
        self.styles = []

    def html(self):
        parts = [
            element("h2", self.title),
            self._what(),
            self._status(),
            self._strip(),
            element("h3", "Loss"),
            self._loss_chart(),
            self._distances(),
            element("h3", "Snapshots"),
            self._table(),
            element("h3", "Settings"),
            self._settings(),
        ]
        parts.insert(3, missing_notice(self.pictures.missing))
        return element("section", *parts, id=self.group)

    def _what(self):
        views = self.asked.records("views")
        history = self.data.records("history")
        seconds = sum(h.number("seconds") or 0 for h in history)
        words = (
            f"{count(self.data.number('steps'))} of {count(self.asked.number('steps'))} steps,"
            f" {len(views)} view{'' if len(views) == 1 else 's'}, {figures(seconds)} s without"
            f" snapshots; loss {self.asked.text('loss')}, optimiser"
            f" {self.asked.text('optimiser')}."
        )
        halved = sum(1 for h in history if h.number("halvings"))
        if halved:
            words += f" {halved} steps were halved, so that no face lost its area."
        found = [
            element("li", f"{s.text('name')}: {figures(s.number('value'), 5)} {s.text('unit')}")
            for s in self.data.records("scalars")
        ]
        return join(element("p", words), element("ul", *found) if found else None)

    def _status(self):
        if self.data.text("status") == "done":
            return None
        return element(
            "div",
            element("strong", f"{self.data.text('status')}. "),
            "limn fit --resume with this folder goes on.",
            class_="notice",
        )

    def _strip(self):
        targets = self.data.values.get("targets") or []
        cards = []
        for s in chosen([s for s in self.snapshots if s.values.get("pictures")]):
            step = s.number("step")
            shown = [
                figure(self.pictures.picture(name, f"view {v} after {step} steps"), f"view {v}")
                for v, name in enumerate(s.values["pictures"])
            ]
            cards.append(element("div", element("h4", f"step {step}"), *shown, class_="card"))
        if not cards:
            return None
        shown = [
            figure(self.pictures.picture(name, f"target of view {v}"), f"view {v}")
            for v, name in enumerate(targets)
        ]
        cards.append(element("div", element("h4", "target"), *shown, class_="card"))
        return element(
            "div",
            size_choice(self.group),
            element("div", *cards, class_="cards"),
            class_="gallery wide",
        )

    def _loss_chart(self):
        rows = [
            (h.number("step"), h.number("loss"), h.number("stderr") or 0)
            for h in self.data.records("history")
        ]
        return charts.loss_over_steps(rows, self.palette) if rows else element("p", "No step yet.")

    def _meshes(self):
        for s in self.snapshots:
            for mesh in s.records("meshes"):
                yield s.number("step"), mesh

    def _distances(self):
        if not any(mesh.has("chamfer") for _, mesh in self._meshes()):
            return None
        shapes = {}
        for step, mesh in self._meshes():
            shapes.setdefault(mesh.text("shape"), []).append(
                (step, mesh.number("chamfer"), mesh.number("normal_angle"))
            )
        return join(
            element("h3", "Distance to the truth"), charts.distance_over_steps(shapes, self.palette)
        )

    def _table(self):
        head = [
            "step",
            "shape",
            "chamfer / diagonal",
            "Hausdorff 95 %",
            "Hausdorff",
            "normals",
            "faces inside out",
            "crossings",
        ]

        def cell(mesh, key, end=""):
            return f"{figures(mesh.number(key))}{end}" if mesh.has(key) else "–"

        rows = [
            [
                count(step),
                mesh.text("shape"),
                cell(mesh, "chamfer"),
                cell(mesh, "hausdorff_95"),
                cell(mesh, "hausdorff"),
                cell(mesh, "normal_angle", "°"),
                count(mesh.number("inside_out")) if mesh.has("inside_out") else "–",
                count(mesh.number("crossings")),
            ]
            for step, mesh in self._meshes()
        ]
        last = self.data.records("history")[-1:]
        note = [
            element("p", f"Last loss: {with_error(h.number('loss'), h.number('stderr'))}.")
            for h in last
        ]
        meshes = table(head, rows, f"Snapshots, {self.title}") if rows else None
        return join(*note, meshes)

    def _settings(self):
        asked = [
            element("li", f"{name}: {value}")
            for name, value in self.asked.items()
            if name != "views" and value not in ("", [], 0)
        ]
        views = [
            element("li", f"{v.text('scene')} {v.values.get('defines') or ''}, {v.text('target')}")
            for v in self.asked.records("views")
        ]
        return element("ul", *views, *asked)
