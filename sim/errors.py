"""The errors pmg raises on purpose.

::

    PmgError                 the input or the request is at fault; one line tells what to do
    ├── RecordingError       a recording, or a folder of them, cannot be used
    ├── StoreError           the store lacks something, or holds something unreadable
    ├── GridError            a grid has holes, wrong columns, or values out of range
    ├── BenchError           a bench parameter or scenario is out of its range
    │   └── UnsettledRunError    a run in time ends at a slipped pole, or at a step that does not converge
    └── FitError             a fit cannot be made from these points
        └── UnsettledFitError    its weights do not settle

Anything else that reaches the command line is a defect of pmg.
"""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


class PmgError(Exception):
    """A request that cannot be met, stated in four parts.

    Parameters
    ----------
    where : str
        File, column, topic or parameter.
    came : str
        What was found there.
    expected : str
        What should have been there.
    do : str
        What the user can do about it.
    """

    def __init__(self, where: str, came: str, expected: str, do: str) -> None:
        self.where, self.came, self.expected, self.do = where, came, expected, do
        super().__init__(where, came, expected, do)

    @property
    def advice(self) -> str:
        """Fault and remedy: what came, what was expected, what to do."""
        return f"{self.came}; expected {self.expected}. {self.do}"

    def __str__(self) -> str:
        """One line: the place, then the advice."""
        return f"{self.where}: {self.advice}"


class RecordingError(PmgError):
    """A recording, or a folder of them, cannot be used."""


class StoreError(PmgError):
    """The store lacks something, or holds something unreadable."""


class GridError(PmgError):
    """A grid has holes, wrong columns, or values out of range."""


class BenchError(PmgError):
    """A bench parameter or scenario is out of its range."""


class UnsettledRunError(BenchError):
    """A run in time ends before its time: at a slipped pole, or at a step that does not converge."""


class FitError(PmgError):
    """A fit cannot be made from these points."""


class UnsettledFitError(FitError):
    """The weights of a fit do not settle."""


def closest(word: str, known: Iterable[str]) -> str:
    """A hint such as ``Did you mean 'ring'?``; empty where nothing is near. Never the word itself."""
    close = get_close_matches(word, sorted(set(known) - {word}), n=1)
    return f"Did you mean '{close[0]}'?" if close else ""


def near_miss(word: str, known: Iterable[str]) -> str:
    """A hint as `closest` gives it, or the list of what is known."""
    names = sorted(set(known) - {word})
    return closest(word, names) or f"Known: {', '.join(names)}."
