"""Progress of long work: its steps announced as they begin."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int, str], None]
"""Takes how much is done, of how much, and the name of what is next or was last."""


class Steps:
    """Steps of a stage by name, in order.

    Parameters
    ----------
    progress : Progress or None
        Receives each step as it begins; None where nobody asks.
    names : tuple of str
        The steps.
    """

    def __init__(self, progress: Progress | None, *names: str) -> None:
        self._progress = progress
        self._names = names

    def begin(self, name: str) -> None:
        """Announce a step.

        Raises
        ------
        ValueError
            It is none of the stage's.
        """
        place = self._names.index(name)
        if self._progress is not None:
            self._progress(place, len(self._names), name)


def named(progress: Progress | None, stage: str) -> Progress | None:
    """The same progress with the name of a stage before that of each step; None where nobody asks."""
    if progress is None:
        return None
    return lambda done, total, name: progress(done, total, f"{stage}: {name}")
