"""Pictures as data: URIs, the colour bar of signed pictures, and what stands in for a missing one.
"""

import base64
import os
import struct

from .markup import Markup, element, figures, join

PNG_START = b"\x89PNG\r\n\x1a\n"
PNG_END = b"IEND\xaeB`\x82"


def _png(file):
    """(data URI, width, height) of a whole PNG, or (None, what is wrong, "")."""
    try:
        with open(file, "rb") as stream:
            content = stream.read()
    except OSError as error:
        return None, (error.strerror or "cannot be read").lower(), ""
    if not content.startswith(PNG_START):
        return None, "not a PNG file", ""
    if not content.rstrip(b"\0").endswith(PNG_END):
        return None, "the file is cut off", ""
    width, height = struct.unpack(">II", content[16:24])
    return "data:image/png;base64," + base64.b64encode(content).decode(), width, height


class Pictures:
    """Reads the pictures of one folder and remembers which were missing."""

    def __init__(self, folder):
        self.folder, self.missing = folder, []

    def uri(self, name):
        return _png(os.path.join(self.folder, name))[0]

    def figure(self, name, alt, caption, behind=None):
        """A <figure>, or a box that names the file. behind: CSS class that shows another picture
        while the pointer (or the keyboard's focus) is on this one."""
        file = os.path.join(self.folder, name)
        uri, width, height = _png(file)
        if uri is None:
            self.missing.append(f"{file}: {width}")
            shown = element("div", element("strong", "Picture missing"), element("code", name),
                            element("span", width), class_="missing-picture", role="note")
        else:
            shown = element("span", element("img", src=uri, alt=alt, width=width, height=height),
                            class_=f"picture flips {behind}" if behind else "picture",
                            tabindex="0" if behind else None)
        return element("figure", shown, element("figcaption", caption))

    def flip_style(self, behind, name):
        """The rule of `figure(..., behind=behind)`, which shows the picture `name`."""
        uri = self.uri(name)
        return Markup(f".{behind}{{background-image:url({uri})}}") if uri else Markup("")


def _signed_colour(t):
    """limn's signed pictures: linear (1 + min(t, 0), 1 - |t|, 1 - max(t, 0)), then the sRGB curve.
    """
    linear = (1 + min(t, 0), 1 - abs(t), 1 - max(t, 0))
    srgb = (12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in linear)
    return "rgb({},{},{})".format(*(round(255 * c) for c in srgb))


def colour_bar(scale, unit, what):
    """The legend of pictures that write_signed_png made: blue -scale, white 0, red +scale."""
    stops = ",".join(_signed_colour(-1 + i / 12) for i in range(25))
    text = f"{what}: blue −{figures(scale)}, white 0, red +{figures(scale)}, {unit}"
    ticks = [element("span", label) for label in (f"−{figures(scale)}", "0", f"+{figures(scale)}")]
    return element(
        "div",
        element("span", what, class_="bar-title"),
        element("span", class_="bar", style=f"background:linear-gradient(to right,{stops})"),
        element("span", *ticks, class_="bar-ticks"),
        element("span", unit, class_="bar-unit"),
        class_="colour-bar", role="img", aria_label=text)


def size_choice(group):
    """Radio buttons that the style sheet ties to the size of the pictures after them; no script."""
    choices = []
    for i, label in enumerate(("small", "medium", "large")):
        name = f"{group}-size-{i}"
        choices += [element("input", type="radio", name=f"{group}-size", id=name,
                            class_=f"size-{i}", checked="" if i == 1 else None),
                    element("label", label, for_=name)]
    return join(element("span", "Picture size", class_="size-label"), *choices)
