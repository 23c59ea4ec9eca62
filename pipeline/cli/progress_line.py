"""The progress line of a command on standard error: how much is done, of what, and the time left."""

from __future__ import annotations

import os
import sys
import time
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING

from pmg.pipeline.wording.safe_text import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pmg.pipeline.files.progress import Progress

FEWEST_STEPS = 10
"""Steps from which on the time left is estimated: a few steps of a stage take very different times."""

A_MINUTE = timedelta(minutes=1).total_seconds()
"""[s]; the constant of `pmg.sim.signals` would load numpy for a help text."""

IN_SECONDS = 1.5 * A_MINUTE
"""Time left up to which it is given in seconds [s]."""


def say(text: str, end: str = "\n") -> None:
    """Print on standard error; where that takes nothing more, its words go nowhere and the command goes on."""
    try:
        sys.stderr.write(text + end)
        sys.stderr.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())


class _TimeLeft:
    """Estimate of the time that a series of alike steps still takes.

    Parameters
    ----------
    clock : callable
        Gives the time [s].
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._total = 0
        self._first = 0
        self._began = 0.0

    def words(self, done: int, total: int) -> str:
        """The time left in words, such as ``, 12 s left``; empty where it is not known yet."""
        now = self._clock()
        if total != self._total or done < self._first:
            self._total, self._first, self._began = total, done, now
        gone = done - self._first
        if total < FEWEST_STEPS or gone < 1 or done >= total:
            return ""
        left = (now - self._began) / gone * (total - done)
        return f", {left:.0f} s left" if left < IN_SECONDS else f", {left / A_MINUTE:.0f} min left"


@contextmanager
def progress_line(quiet: bool, what: str, clock: Callable[[], float] = time.monotonic) -> Iterator[Progress]:
    """A progress line on standard error: rewritten on a terminal, one line a tenth elsewhere.

    Parameters
    ----------
    quiet : bool
        Whether only a terminal is written to.
    what : str
        The command.
    clock : callable
        Gives the time [s].
    """
    terminal = sys.stderr.isatty()
    shown: tuple[int, ...] = ()
    left = _TimeLeft(clock)

    def show(done: int, total: int, name: str) -> None:
        nonlocal shown
        remaining = left.words(done, total)
        step = (total, done if terminal else (10 * done) // max(total, 1))
        if step == shown or (quiet and not terminal):
            return
        shown = step
        text = printable(f"{what} {done}/{total} {name}{remaining}")
        say(f"\r\x1b[K{text}" if terminal else text, end="" if terminal else "\n")

    try:
        yield show
    finally:
        if terminal and shown:
            say("\r\x1b[K", end="")
