"""The colours, once: what each role looks like on a light and on a dark page.

Series colours follow the Okabe-Ito set, darkened or lightened until they stand out from the page, and two more.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from html import escape

from pmg.pipeline.report.spelled import spelled

ROLES: dict[str, tuple[str, str]] = {
    "paper": ("#ffffff", "#15191d"),
    "ink": ("#1a1f24", "#e3e7eb"),
    "muted": ("#545d67", "#a4aeb8"),
    "rule": ("#d5dae0", "#353d45"),
    "missing": ("#c6ccd2", "#4a525b"),
    "flow": ("#7fa8cc", "#41688c"),
    "loss": ("#d98a5f", "#a65a30"),
    "gain": ("#8f5fa8", "#b583cf"),
    "unexplained": ("#d3d8dd", "#5a636c"),
    "link": ("#0a58a8", "#7cbcf5"),
    "soft": ("#f2f5f8", "#1f262d"),
    "good": ("#10663c", "#6fd6a0"),
    "good-soft": ("#e8f5ee", "#16291f"),
    "attention-soft": ("#fdf1e7", "#33231a"),
    "attention": ("#9a3b00", "#ffb37a"),
    "series-0": ("#0072b2", "#4ba6e0"),
    "series-1": ("#d55e00", "#f08a4b"),
    "series-2": ("#00835f", "#2fc39a"),
    "series-3": ("#b0588a", "#e39bc4"),
    "series-4": ("#a67400", "#efb53f"),
    "series-5": ("#7b3f00", "#cfa98c"),
    "series-6": ("#5c4fa3", "#ab9ff0"),
    "series-7": ("#555e68", "#b4bcc4"),
    "series-8": ("#0f6f80", "#6ccbd9"),
    "series-9": ("#a01c3c", "#ff9aa8"),
}
"""Role -> colour on a light page, colour on a dark page."""

FONTS = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', 'Noto Sans', 'DejaVu Sans', sans-serif"

_ROLE = {light: role for role, (light, _) in ROLES.items()}
"""Role of a colour in a drawing made with `LIGHT`: each has its own, and no map uses them."""
_COLOUR = rf"#(?:{'|'.join(light.removeprefix('#') for light in _ROLE)})\b"
_FAMILY = re.compile(r"font-family: 'DejaVu Sans'(?:, sans-serif)?(?:; )?")
_ATTRIBUTE = re.compile(rf'\b(fill|stroke)="({_COLOUR})"')
_STYLED = re.compile(_COLOUR)
_OUTSIDE = "'DejaVu Sans', Verdana, sans-serif"
"""Fonts of a drawing that stands alone: the one it was laid out with, and one of the same width."""
_PROLOGUE = re.compile(r"<!DOCTYPE.*?>", re.DOTALL)
_IDENTIFIER = re.compile(r'(\bid="|href="#|url\(#)')
_LEFT_OUT = re.compile(r"^.*?(?=<svg)|<style.*?</style>", re.DOTALL)
_SIZE = re.compile(r' (?:width|height)="[^"]*"')
_TAG = re.compile(r"<[^>]*>")


@dataclass(frozen=True)
class Palette:
    """Colours to draw with.

    Parameters
    ----------
    colours : dict
        Colour of each role.
    """

    colours: dict[str, str]

    def __getitem__(self, role: str) -> str:
        return self.colours[role]

    def series(self, index: int) -> str:
        """Colour of a series; the set repeats when it is used up."""
        return self.colours[f"series-{index % SERIES}"]


SERIES = sum(role.startswith("series-") for role in ROLES)
LIGHT = Palette({role: light for role, (light, _) in ROLES.items()})
DARK = Palette({role: dark for role, (_, dark) in ROLES.items()})


def variables(palette: Palette) -> str:
    """CSS declarations of every role."""
    return " ".join(f"--{role}: {colour};" for role, colour in palette.colours.items())


def themed(svg: str, prefix: str) -> str:
    """A drawing made with `LIGHT`, ready to stand inside a page.

    Colours become CSS variables, fonts the page's own, and identifiers get a prefix so that several drawings
    can share the page; its size is left out. Text between the tags is left as it is.

    Parameters
    ----------
    svg : str
        A whole SVG file, compact.
    prefix : str
        Distinguishes this drawing from all others on the page.
    """

    def tag(found: re.Match[str]) -> str:
        text = found[0]
        if text.startswith("<svg"):
            text = _SIZE.sub("", text).replace("<svg", f'<svg style="font-family: {FONTS}"', 1)
        text = _ATTRIBUTE.sub(r'style="\1: \2"', text)
        text = _STYLED.sub(lambda colour: f"var(--{_ROLE[colour[0]]})", text)
        return _IDENTIFIER.sub(rf"\g<1>{prefix}-", _FAMILY.sub("", text).replace("xlink:href=", "href="))

    return _TAG.sub(tag, _LEFT_OUT.sub("", svg)).strip()


def alone(svg: str, title: str, caption: str) -> str:
    """A drawing as a file of its own that asks for nothing outside of it, with words for those who cannot see it.

    Parameters
    ----------
    svg : str
        A whole SVG file made with `LIGHT`, compact.
    title, caption : str
        What it is, and what it shows.
    """
    words = f"<title>{escape(spelled(title))}</title>\n<desc>{escape(spelled(caption))}</desc>\n"
    paper = f'<rect width="100%" height="100%" fill="{LIGHT["paper"]}"/>\n'

    drawn = _TAG.sub(lambda found: _FAMILY.sub("", found[0]), _PROLOGUE.sub("", svg))
    head, opening, rest = drawn.partition("<svg ")
    tag, end, body = rest.partition(">")
    root = f'{opening}role="img" style="font-family: {_OUTSIDE}" {tag}{end}'
    return f"{head.strip()}\n{root}\n{words}{paper}{body.strip()}\n"
