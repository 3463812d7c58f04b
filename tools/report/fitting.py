"""The section of one fit.json: loss and distances over steps, a film strip, its arguments."""

from . import charts
from .markup import count, element, figures, join, plural, table, with_error
from .section import Section, status_notice, stem

MOST_CURVES = 8  # of scalars; the table has all
STRIP = 7  # columns of the strip at most; the table has all snapshots

# Columns of the table of snapshots, head: (key, text).
COLUMNS = {
    "chamfer / diagonal": ("chamfer", figures),
    "Hausdorff 95 %": ("hausdorff_95", figures),
    "Hausdorff": ("hausdorff", figures),
    "normals": ("normal_angle", lambda angle: f"{figures(angle)}°"),
    "faces inside out": ("inside_out", count),
    "crossings": ("crossings", count),
}


def chosen(snapshots):
    """Evenly spread, with the first and the last."""
    if len(snapshots) <= STRIP:
        return snapshots
    return [snapshots[round(i * (len(snapshots) - 1) / (STRIP - 1))] for i in range(STRIP)]


class FitSection(Section):
    def __init__(self, result, group, palette):
        self.arguments = result.data.record("arguments")
        self.views = self.arguments.records("views")
        super().__init__(result, group, palette, f"{stem(self.views[0].text('scene'))}: fit")
        self.snapshots = self.data.records("snapshots")
        self.history = self.data.records("history")
        self.meshes = [(s.number("step"), mesh) for s in self.snapshots
                       for mesh in s.records("meshes")]

    def parts(self):
        losses = [(h.number("step"), h.number("loss"), h.number("stderr") or 0)
                  for h in self.history]
        return [
            self._what(),
            status_notice(self.data, "", "limn fit --resume with this folder goes on."),
            self._strip(),
            element("h3", "Loss"),
            charts.loss_over_steps(self.palette, losses) if losses else "No step yet.",
            self._blur(),
            self._values(),
            self._distances(),
            element("h3", "Snapshots"), self._table(),
            element("h3", "Settings"), self._settings()]

    def _what(self):
        seconds = sum(h.number("seconds") or 0 for h in self.history)
        words = (f"{count(self.data.number('steps'))} of {count(self.arguments.number('steps'))}"
                 f" steps, {plural(len(self.views), 'view')}, {figures(seconds)} s without"
                 f" snapshots; loss {self.arguments.text('loss')}, optimiser"
                 f" {self.arguments.text('optimiser')}.")
        halved = sum(1 for h in self.history if h.number("halvings"))
        if halved:
            words += f" {halved} steps were halved, so that no face lost its area."
        found = [element("li", f"{s.text('name')}: {figures(s.number('value'), 5)}",
                         f" {s.text('unit')}") for s in self.data.records("scalars")]
        return join(element("p", words), element("ul", *found) if found else None)

    def _strip(self):
        columns = [(f"step {s.number('step')}", s.values["pictures"])
                   for s in chosen([s for s in self.snapshots if s.values.get("pictures")])]
        columns.append(("target", self.data.values.get("targets") or []))
        cards = [self.card(head, *(self.figure(name, f"view {v}, {head}", f"view {v}")
                                   for v, name in enumerate(names))) for head, names in columns]
        return self.gallery(cards, wide=True) if len(cards) > 1 else None

    def _blur(self):
        sigmas = [(h.number("step"), h.number("sigma")) for h in self.history
                  if h.has("sigma") and h.number("sigma")]
        if not sigmas:
            return None
        return join(element("h3", "Blur: sigma"),
                    charts.values_over_steps(self.palette, {"sigma": sigmas}))

    def _values(self):
        """Curves of scalars, and what they were at each snapshot."""
        units = {s.text("name"): s.text("unit") for s in self.data.records("scalars")}
        known = [(h.number("step") + 1, h.values.get("values") or {}) for h in self.history]
        found = {name: [(step, values[name]) for step, values in known if name in values]
                 for name in units}
        found = {name: rows for name, rows in found.items() if rows}
        if not found:
            return None
        heads = [f"{name} [{units[name]}]" if units[name] else name for name in found]
        of_steps = {name: dict(rows) for name, rows in found.items()}
        rows = [[count(s), *(figures(of_steps[n][s], 5) if s in of_steps[n] else "–" for n in found)]
                for s in (snapshot.number("step") for snapshot in self.snapshots)]
        few = dict(list(found.items())[:MOST_CURVES])
        return join(element("h3", "Values"), charts.values_over_steps(self.palette, few),
                    table(["step", *heads], rows, f"Values, {self.title}") if rows else None)

    def _distances(self):
        if not any(mesh.has("chamfer") for _, mesh in self.meshes):
            return None
        shapes = {}
        for step, mesh in self.meshes:
            shapes.setdefault(mesh.text("shape"), []).append(
                (step, mesh.number("chamfer"), mesh.number("normal_angle")))
        return join(element("h3", "Distance to the truth"),
                    charts.distance_over_steps(self.palette, shapes))

    def _table(self):
        rows = [[count(step), mesh.text("shape"),
                 *(text(mesh.number(key)) if mesh.has(key) else "–"
                   for key, text in COLUMNS.values())] for step, mesh in self.meshes]
        last = [element("p", f"Last loss: {with_error(h.number('loss'), h.number('stderr'))}.")
                for h in self.history[-1:]]
        shown = table(["step", "shape", *COLUMNS], rows, f"Snapshots, {self.title}")
        return join(*last, shown if rows else None)

    def _settings(self):
        views = [f"{v.text('scene')} {v.values.get('defines') or ''}, {v.text('target')}"
                 for v in self.views]
        given = [f"{name}: {value}" for name, value in self.arguments.items()
                 if name != "views" and value not in ("", [], 0)]
        return element("ul", *(element("li", text) for text in views + given))
