"""The sheet on top of a report that says what to do: questions and answers, the machine with a mark, one picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from pmg.pipeline.report.figure import Figure

MARKS = {
    "cause": "Cause",
    "either": "One of two",
    "possible": "Possible",
    "inspect": "Inspect",
    "seen": "Seen here",
    "read": "Read here",
    "": "",
}
"""Mark of a part -> the word below it."""


@dataclass(frozen=True)
class SheetAnswer:
    """A question that a reader has, and the answer.

    Parameters
    ----------
    question : str
        In a few words.
    sentences : tuple of str
        The answer, a thought each; what stands between two backticks is a command.
    grounds : str
        Anchor of the section that holds the grounds; empty where there is none.
    """

    question: str
    sentences: tuple[str, ...]
    grounds: str = ""


@dataclass(frozen=True)
class MachinePart:
    """A part of the machine in a chain of parts.

    Parameters
    ----------
    name : str
        As people call it.
    group : str
        Which part of the chain it belongs to, such as a shaft.
    mark : str
        ``cause``, ``either`` of two, ``possible``, ``inspect``, ``seen``, ``read`` or empty.
    """

    name: str
    group: str = ""
    mark: Literal["cause", "either", "possible", "inspect", "seen", "read", ""] = ""


@dataclass(frozen=True)
class ActionSheet:
    """What a reader in a hurry acts on.

    Parameters
    ----------
    answers : tuple of SheetAnswer
        In the order asked.
    parts : tuple of MachinePart
        The machine, from one end to the other.
    figure : Figure, optional
        One picture, before and after.
    """

    answers: tuple[SheetAnswer, ...]
    parts: tuple[MachinePart, ...] = ()
    figure: Figure | None = None
