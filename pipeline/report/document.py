"""The nouns of a report; nothing here draws, and nothing knows what the report is about."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from pmg.pipeline.report.figure import Chart, Figure, PowerFlow, Series, SpeedMap
from pmg.pipeline.report.names import checked_id
from pmg.pipeline.report.table import Cell, Column, Measured, Table

if TYPE_CHECKING:
    from pmg.pipeline.report.action_sheet import ActionSheet
    from pmg.sim.signals import Signal
    from pmg.sim.sources import Source

__all__ = [
    "Caution",
    "Cell",
    "Chart",
    "Column",
    "Facts",
    "Figure",
    "Fold",
    "Headline",
    "Measured",
    "PowerFlow",
    "Report",
    "Section",
    "Series",
    "Signals",
    "SpeedMap",
    "Table",
    "Text",
    "measured",
]

RESERVED = (
    "announced",
    "contents",
    "folds",
    "main",
    "open-signals",
    "plotly",
    "provenance",
    "references",
    "scheme",
    "signals",
    "signals-data",
    "signals-heading",
    "signals-index",
    "signals-simulated",
    "verdict",
    "warnings",
    "with-cause",
)
"""Anchors that the page itself uses."""


@dataclass(frozen=True)
class Text:
    """Paragraphs of plain text.

    Parameters
    ----------
    body : str
        Paragraphs, an empty line between them.
    kind : str
        ``plain``, or one that is set apart: ``note``, ``warning``, ``finding``.
    """

    body: str
    kind: Literal["plain", "note", "warning", "finding"] = "plain"

    @property
    def paragraphs(self) -> tuple[str, ...]:
        """The paragraphs, without the space around them."""
        return tuple(part.strip() for part in self.body.split("\n\n") if part.strip())


@dataclass(frozen=True)
class Facts:
    """Labels and what they stand for.

    Parameters
    ----------
    rows : tuple of (label, value)
        In the order shown.
    """

    rows: tuple[tuple[str, Cell], ...]

    @property
    def shown(self) -> tuple[tuple[str, str], ...]:
        """The rows as people read them."""
        return tuple((label, Column(label).text(value)) for label, value in self.rows)


Plain: TypeAlias = Text | Facts | Table | Figure
"""What a page shows."""


@dataclass(frozen=True)
class Fold:
    """What only a specialist reads, under its title: closed until asked for, on the screen and in print."""

    title: str
    items: tuple[Plain, ...]


Item: TypeAlias = Plain | Fold


@dataclass(frozen=True)
class Section:
    """A heading and what stands under it.

    Parameters
    ----------
    id : str
        Anchor, unique in the report.
    title : str
        Heading.
    items : tuple of Item
        In the order shown.
    sources : tuple of Source
        Where the equations and numbers of this section come from.
    question : str
        What a reader asks that this section answers, with its neighbours of the same question; may be empty.
    """

    id: str
    title: str
    items: tuple[Item, ...]
    sources: tuple[Source, ...] = ()
    question: str = ""

    def __post_init__(self) -> None:
        checked_id("Section", self.id)

    @property
    def unfolded(self) -> tuple[Plain, ...]:
        """Its items in order, what is folded among them."""
        return tuple(each for item in self.items for each in (item.items if isinstance(item, Fold) else (item,)))

    @property
    def warned(self) -> tuple[Text, ...]:
        """Its warnings."""
        return tuple(item for item in self.unfolded if isinstance(item, Text) and item.kind == "warning")


STATES = {"good": "Good", "attention": "Needs attention", "neutral": "Result"}
"""State of a verdict -> the word above it."""


@dataclass(frozen=True)
class Caution:
    """A warning at the head of a report, and the anchor of what it holds for; empty for the whole report."""

    text: str
    where: str = ""


@dataclass(frozen=True)
class Headline:
    """The headline of a report.

    Parameters
    ----------
    text, state : str
        One or two short sentences; ``good``, ``attention`` or ``neutral``.
    counted : tuple of (label, value)
        Figures that stand before the text.
    warnings : tuple of Caution
        What stands behind it, before the warnings of the sections.
    asks : str
        What it asks for in two or three words; empty where the word of its state says it.
    """

    text: str
    state: Literal["good", "attention", "neutral"] = "neutral"
    counted: tuple[tuple[str, str], ...] = ()
    warnings: tuple[Caution, ...] = ()
    asks: str = ""

    @property
    def label(self) -> str:
        """What stands above it."""
        return self.asks or STATES[self.state]


@dataclass(frozen=True)
class Signals:
    """Signals that a page can open behind a test point, packed.

    Parameters
    ----------
    index : str
        JSON that says what there is and where; it may stand in a ``script`` element.
    data : str
        The packed points, in base64.
    simulated : str
        JSON that says what is simulated at each point, for a ``script`` element; empty where nothing is.
    """

    index: str
    data: str
    simulated: str = ""


@dataclass(frozen=True)
class Report:
    """All that is reported about one analysis.

    Parameters
    ----------
    title, subtitle : str
        Head of the page.
    verdict : Verdict
        What a reader in a hurry takes away.
    sections : tuple of Section
        The body.
    provenance : Facts
        Which inputs, versions, seeds and times made it.
    signals : Signals, optional
        What the page opens behind the points of its figures.
    sheet : ActionSheet, optional
        What to do; the page then shows it instead of the words of the verdict.
    switch : str
        Words beside the switch of figures.

    Raises
    ------
    ValueError
        When two sections, tables or figures share an id, or an answer or a warning has its grounds nowhere.
    """

    title: str
    subtitle: str
    verdict: Headline
    sections: tuple[Section, ...]
    provenance: Facts
    signals: Signals | None = None
    sheet: ActionSheet | None = None
    switch: str = "Simulate with the cause"

    def __post_init__(self) -> None:
        ids = [item.id for item in self._named]
        twice = sorted(name for name, count in Counter((*ids, *RESERVED)).items() if count > 1)
        if twice:
            raise ValueError(f"Report {self.title!r}: ids used twice or reserved: {', '.join(twice)}")
        grounds = set() if self.sheet is None else {answer.grounds for answer in self.sheet.answers}
        grounds |= {warning.where for warning in self.verdict.warnings}
        if lost := sorted(grounds - {"", *ids}):
            raise ValueError(f"Report {self.title!r}: grounds that are nowhere: {', '.join(lost)}")

    @property
    def _named(self) -> tuple[Section | Table | Figure, ...]:
        return (*self.sections, *self.tables, *self.figures)

    @property
    def titles(self) -> dict[str, str]:
        """Title of each section, table and figure by its anchor."""
        return {item.id: item.title for item in self._named}

    @property
    def tables(self) -> tuple[Table, ...]:
        """Every table, in order."""
        return tuple(item for section in self.sections for item in section.unfolded if isinstance(item, Table))

    @property
    def figures(self) -> tuple[Figure, ...]:
        """Every figure, in order."""
        first = () if self.sheet is None or self.sheet.figure is None else (self.sheet.figure,)
        return first + tuple(item for section in self.sections for item in section.unfolded if isinstance(item, Figure))

    @property
    def warnings(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Each warning once, of the head, then of the sections, with the anchors of all that it holds for."""
        found: dict[str, list[str]] = {}
        of_sections = (Caution(text.body, section.id) for section in self.sections for text in section.warned)
        for one in (*self.verdict.warnings, *of_sections):
            found.setdefault(one.text, []).extend([one.where] if one.where else [])
        return tuple((text, tuple(dict.fromkeys(places))) for text, places in found.items())

    @property
    def bibliography(self) -> tuple[Source, ...]:
        """Sources of all sections, each once, in the order of first use."""
        return tuple(dict.fromkeys(source for section in self.sections for source in section.sources))


def measured(signal: Signal, value: float, u: float) -> Measured | None:
    """A table cell in display units; empty where nothing is known."""
    if not np.isfinite(value):
        return None
    return Measured(float(signal.display(value)), abs(float(u)) / signal.scale)
