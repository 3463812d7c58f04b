"""What the sections of a page share, each of one result: pictures in cards, names with colours."""

import os

from .markup import command, element, join, notice
from .pictures import Pictures, size_choice


def stem(file):
    return os.path.splitext(os.path.basename(file))[0]


def swatch(colour):
    return element("span", class_="swatch", style=f"background:{colour}")


def legend(entries, *before):
    """entries: (swatch, label)."""
    shown = [element("span", square, f" {label}  ") for square, label in entries]
    return element("p", *before, *shown, class_="hint legend")


class Section:
    """group: prefix of ids in the page. title: of the section. after: notes beside names."""

    def __init__(self, result, group, palette, title, roles=None):
        self.data, self.group, self.palette = result.data, group, palette
        self.title, self.roles = title, roles or {}
        self.pictures, self.style = Pictures(result.folder), ""

    def html(self):
        """The section; parts() gives its contents, the first of them what it is about."""
        first, *parts = self.parts()
        missing = [element("li", element("code", m)) for m in self.pictures.missing]
        shown = notice("Pictures that could not be shown: ", element("ul", *missing))
        return element("section", element("h2", self.title), first, shown if missing else None,
                       *parts, id=self.group)

    def name(self, record, tag="span"):
        """A method's or variant's, with its colour and, where the page gives them, roles."""
        name = record.text("name")
        return element(tag, swatch(self.palette.variable(name)), name, self._role(name),
                       title=record.text("description", ""))

    def _role(self, name):
        return element("span", self.roles.get(name, ""), class_="role") if self.roles else None

    def figure(self, name, alt, caption, behind=None):
        return self.pictures.figure(name, alt, caption, behind)

    def card(self, head, *shown):
        """head: a text or an element."""
        head = head if str(head).startswith("<h4") else element("h4", head, self._role(""))
        return element("div", head, *shown, class_="card")

    def gallery(self, cards, *before, wide=False):
        return element("div", size_choice(self.group), *before,
                       element("div", *cards, class_="cards"),
                       class_="gallery wide" if wide else "gallery")

    def command(self):
        return command(self.data.text("command"))


def status_notice(record, name, *text):
    """None for what is done."""
    status = record.text("status", "done")
    return None if status == "done" else notice(f"{name}{status}. ", join(*text))
