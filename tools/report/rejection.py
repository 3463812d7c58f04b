"""The section of one reject.json: slices, rates."""

from . import charts
from .colours import SLICES
from .markup import count, details, element, hint, notice, percent, plural, share, table
from .section import Section, legend, status_notice, stem, swatch


class RejectionSection(Section):
    def __init__(self, result, group, palette, roles=None):
        super().__init__(result, group, palette, f"{stem(result.data.text('mesh'))}: rejection",
                         roles)
        self.variants = self.data.records("variants")

    def parts(self):
        rows = [(v.text("name"), v.number("hit_rate"), v.number("hit_rate_stderr"))
                for v in self.variants if v.number("hit_rate") is not None]
        return [
            self._what(), self._missed(),
            status_notice(self.data, "", "Only what was finished is shown."),
            self.slices(),
            element("h3", "Acceptance rates"),
            charts.acceptance(self.palette, rows) if rows else element("p", "No rates."),
            self.rates(),
            element("h3", "False positives by depth"),
            charts.false_positives_by_depth(self.palette, self.variants), self._by_depth(),
            element("h3", "Settings"), self.command()]

    def _what(self):
        data, node = self.data, self.data.record("node")
        return element(
            "p", f"{data.text('mesh')}: {count(data.number('edges'))} edges,"
            f" {plural(len(self.variants), 'variant')}, seed {data.number('seed')}. The slices cut"
            f" space around a node at depth {node.number('depth')} that holds"
            f" {count(node.number('edges'))} edges. The node's rejection test is evaluated at every"
            " point of them and compared with brute force.")

    def _missed(self):
        """A silhouette that a test loses is a bug of the program, whatever else the report says.
        "missed" of a variant, where it is given, counts those of its descents too."""
        lost = {v.text("name"): v.number("missed") if v.has("missed") else
                sum(s.number("missed") or 0 for s in v.records("slices")) for v in self.variants}
        wrong = [f"{name}: {times} times" for name, times in lost.items() if times]
        return notice("⚠ Silhouettes were missed. ", "This is a bug, and gradients are biased by"
                      f" it: {'; '.join(wrong)}.", danger=True) if wrong else None

    def slices(self):
        """A card per variant: its slices."""
        cards = [self._card(v) for v in self.variants]
        drawn = self.data.record_or_none("colors")  # that the program says it drew with
        keys = legend((swatch(drawn.text(key, colour) if drawn else colour), label)
                      for key, (label, colour) in SLICES.items())
        return self.gallery(cards, keys, wide=True)

    def _card(self, variant):
        name, shown = variant.text("name"), []
        for i, s in enumerate(variant.records("slices"), 1):
            wrong = s.number("false_accept")
            caption = (f"slice {i}: of the points without a silhouette"
                       f" {share(wrong, wrong + s.number('true_reject'))} are false positives")
            if s.number("missed"):
                caption += f"; {count(s.number('missed'))} missed"
            shown.append(self.figure(s.text("picture"), f"slice {i} of {name}", caption))
        return self.card(self.name(variant, "h4"), *shown)

    def rates(self):
        head = ["variant", "acceptance rate", "reachable per silhouette",
                *(f"{label}, all slices" for label, _ in SLICES.values()), "description"]
        rows = []
        for v in self.variants:
            slices = v.records("slices")
            points = sum(s.number("points") or 0 for s in slices)
            rows.append([
                self.name(v), percent(v.number("hit_rate"), v.number("hit_rate_stderr")),
                f"{v.number('reached_per_silhouette'):.2f}",
                *(share(sum(s.number(k) or 0 for s in slices), points) for k in SLICES),
                element("td", v.text("description", ""), class_="words")])
        note = hint("Edges where a descent can end, per silhouette among them, over all points: the"
                    " fewer, the better the rejection. A descent draws one edge.")
        return element("div", table(head, rows, f"Rates, {self.title}"), note)

    def _by_depth(self):
        rows = [[self.name(v), f"{d.number('depth')}",
                 *(count(d.number(k)) for k in ("nodes_tested", "accepted", "false_accepts")),
                 share(d.number("false_accepts"), d.number("accepted"))]
                for v in self.variants for d in v.records("by_depth")]
        head = ["variant", "depth", "nodes tested", "accepted", "false positives",
                "of those accepted"]
        return details("By depth, in numbers", table(head, rows, f"By depth, {self.title}"))
