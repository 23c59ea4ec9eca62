"""The sheet a figure is drawn on: how wide, which letters, which colours."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextToPath

from pmg.pipeline.report.theme import LIGHT

if TYPE_CHECKING:
    from pmg.pipeline.report.theme import Palette

_SPACES = re.compile(r"[ \t\n]+(?![^\[\]]*\])")
"""Where a line may break: not at a no-break space, and not inside brackets."""

POINTS = 72.0
"""Points per inch."""


@dataclass(frozen=True)
class Sheet:
    """Width, letter size and colours.

    Parameters
    ----------
    width : float
        Width [in].
    letters : float
        Size of ordinary text [pt].
    palette : Palette
        Colours.
    """

    width: float
    letters: float
    palette: Palette

    @property
    def small(self) -> float:
        """Size of tick labels and remarks [pt]."""
        return self.letters - 1.0

    @property
    def line(self) -> float:
        """Height of a line of text [in]."""
        return 1.35 * self.letters / POINTS

    def shared(self, columns: int) -> Sheet:
        """One of several columns of this sheet."""
        return replace(self, width=self.width / columns)


@lru_cache(maxsize=4096)
def text_width(text: str, size: float, weight: str = "normal") -> float:
    """Width of a line of text [in]."""
    font = FontProperties(family="DejaVu Sans", weight=weight, size=size)
    return float(TextToPath().get_text_width_height_descent(text, font, ismath=False)[0]) / POINTS


def wrapped(text: str, width: float, size: float, weight: str = "normal") -> tuple[str, ...]:
    """Lines that fit a width [in]; a word that does not fit alone, and a unit in brackets, stay whole."""
    lines: list[str] = []
    if not text.strip():
        return ()
    space = text_width("a b", size, weight) - text_width("ab", size, weight)
    taken = 0.0
    for word in _SPACES.split(text.strip(" \t\n")):
        needed = text_width(word, size, weight)
        if lines and taken + space + needed <= width:
            lines[-1], taken = f"{lines[-1]} {word}", taken + space + needed
        else:
            lines, taken = [*lines, word], needed
    return tuple(lines)


PAPER = Sheet(width=8.4, letters=9.5, palette=LIGHT)
"""The sheet of every figure."""
