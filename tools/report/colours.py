"""One colour and one marker per method, the same in every chart of a page. The colours differ in
lightness as well as hue, and markers and names stand beside them: nothing rests on hue alone."""

# Method: (on white, on black, marker of matplotlib).
KNOWN = {
    "forest": ("#0060b0", "#63aeff", "o"),
    "li2019": ("#c06a00", "#ffb547", "s"),
    "uniform": ("#00805a", "#38cf9f", "^"),
    "brute": ("#7a3fb8", "#c7a0f7", "D"),
    "fd": ("#c2255c", "#ff80ab", "v"),
    "mitsuba": ("#59616b", "#bcc4ce", "P"),
}
OTHERS = [
    ("#0e7f90", "#4fd3e6", "X"),
    ("#6a7400", "#c8d53d", "<"),
    ("#8a4b2a", "#dfa07e", ">"),
    ("#24408f", "#93abff", "h"),
    ("#a8338a", "#f48fd6", "p"),
    ("#3c6e3c", "#9bd292", "*"),
    ("#4a4a4a", "#dddddd", "d"),
]

# Parts of a run's time: terms, and what none of them accounts for; (on white, on black).
SHADES = {
    "interior": ("#3f8fb5", "#5fb3da"),
    "camera": ("#d9a441", "#e5b95f"),
    "boundary": ("#8c5a9e", "#b584c8"),
    "direct": ("#3f9b6c", "#63c493"),
    "penumbra": ("#b5523f", "#dd8571"),
    "shadow": ("#3c4f76", "#7d93c4"),
    "filter": ("#8f8a2c", "#c6c05a"),
    "differences": ("#c2255c", "#ff80ab"),
    "rest": ("#b8bec6", "#59616b"),
}

# The colours of the pictures that `limn reject` draws, unless its file names others; equal in both
# modes because the pictures are.
SLICES = {
    "true_reject": ("true negative", "#d9d9d9"),
    "true_accept": ("true positive", "#2f6fb7"),
    "false_accept": ("false positive", "#f28e2b"),
    "missed": ("missed (false negative)", "#d6006e"),
}
class Palette:
    """Methods to colours, for a whole page. A chart is drawn with `ink(name)`, a stand-in that
    `page_colours` turns into the CSS variable `variable(name)`, which follows light and dark mode.
    """

    def __init__(self, methods=()):
        self.methods = list(dict.fromkeys(methods))
        others = [m for m in self.methods if m not in KNOWN]
        self._looks = {m: KNOWN.get(m) or OTHERS[others.index(m) % len(OTHERS)]
                       for m in self.methods}

    def variable(self, method):
        return f"var(--method-{self.methods.index(method)})"

    def ink(self, method):
        return f"#a1{self.methods.index(method):02x}5e"

    def marker(self, method):
        return self._looks[method][2]

    def css(self, mode):
        """mode: 0 light, 1 dark."""
        lines = [f"--method-{i}:{self._looks[m][mode]}" for i, m in enumerate(self.methods)]
        lines += [f"--term-{name}:{shades[mode]}" for name, shades in SHADES.items()]
        return ";".join(lines)

    def page_colours(self, svg):
        for method in self.methods:
            svg = svg.replace(self.ink(method), self.variable(method))
        return svg
