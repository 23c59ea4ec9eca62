"""The torque of a window over the turns of its shaft: means of whole revolutions, and what does not repeat."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.signals import Array

BATCHES = 10
"""Batches of a window: enough for a dependable scatter, long enough to outlive correlated noise."""
FEWEST_BATCHES = 5
"""Fewest batches of whole revolutions; below, the window is cut by time."""
COVERAGE = 0.9
"""Part of the window that batches of whole revolutions should use before their number is lowered."""
PIECES = 50
"""Most pieces from which the memory of the noise is learned."""
PHASES = 64
"""Most places of the average turn."""
SLACK = 2e-3
"""Part of a revolution that may be missing from a whole one: an encoder's count, or a sample."""
AT_REST = 0.1
"""Revolutions below which a shaft has not turned."""


@dataclass(frozen=True)
class Batches:
    """Means of consecutive pieces of a window.

    Parameters
    ----------
    means : (b,) array
        Mean of each piece; empty where the window is too short to be cut.
    length : float
        Samples of each piece.
    revolutions : int
        Whole revolutions of each piece; 0 where cut by time.
    """

    means: Array
    length: float
    revolutions: int


@dataclass(frozen=True)
class WholeRevolutions:
    """Torque without gaps, and how far its shaft had turned at each sample.

    Parameters
    ----------
    torque : (n,) array
        Torque [N m].
    turns : (n + 1,) array
        Revolutions since the first sample, never falling, to where the sample after the last would stand; zeros where
        the angle is not known.

    Notes
    -----
    What repeats with each turn of the shaft is no noise of the mean, so where at least `FEWEST_BATCHES` whole
    revolutions fit, means are taken over whole revolutions. Their borders fall between samples; the sum of the torque
    is interpolated there. Otherwise the window is cut by time and ripple counts as noise, which errs on the safe side.
    """

    torque: Array
    turns: Array

    @property
    def whole(self) -> int:
        """Whole revolutions of the window; 0 where too few fit."""
        turned = int(self.turns[-1] + SLACK)
        return turned if turned >= FEWEST_BATCHES else 0

    @cached_property
    def used(self) -> float:
        """Samples that `mean` takes in."""
        return float(np.diff(self._borders(1, self.whole))[0]) if self.whole else float(len(self.torque))

    def mean(self) -> float:
        """Mean over the whole revolutions that fit, or over all samples [N m]."""
        return float(self._cut(1, self.whole).means[0]) if self.whole else float(self.torque.mean())

    def batches(self) -> Batches:
        """Batches that give the uncertainty of the mean.

        Notes
        -----
        As many up to `BATCHES` of equal whole revolutions as use `COVERAGE` of the window, else the number that uses
        most of it; else `BATCHES` pieces of equal time.
        """
        count, revolutions = _whole_revolutions(float(self.turns[-1]) + SLACK)
        return self._cut(count, revolutions) if count else self._in_time(BATCHES)

    def pieces(self) -> Batches:
        """Pieces up to `PIECES`, finer than batches, from which the memory of the noise can be learned.

        Notes
        -----
        As few whole revolutions each as that number allows. With fewer revolutions than pieces, the span of the mean
        is cut by time and the average turn taken off first, which leaves its mean as it is. Of a shaft that turns,
        but not often enough to know its average turn, there are none.
        """
        if not self.whole:
            return self._in_time(PIECES) if self.turns[-1] < AT_REST else Batches(np.empty(0), 0.0, 0)
        if self.whole >= PIECES:
            each = math.ceil(self.whole / PIECES)
            return self._cut(self.whole // each, each)
        plain = WholeRevolutions(self.torque - self._average_turn(), self.turns)
        return plain._between(np.linspace(0.0, self.used, PIECES + 1), 0)

    def scatter(self) -> float:
        """Standard deviation of the torque without what repeats from turn to turn [N m].

        From differences to the value one revolution earlier, where the shaft turns. What is correlated over more than
        a revolution is missing from it.
        """
        if not self.whole:
            return float(self.torque.std(ddof=1))
        turns = self.turns[:-1]
        later = turns >= 1.0
        earlier = np.interp(turns[later] - 1.0, turns, self.torque)
        return float(np.sqrt(0.5 * np.mean((self.torque[later] - earlier) ** 2)))

    def _average_turn(self) -> Array:
        """The part that repeats from turn to turn, at each sample, with no mean over the whole revolutions (n,)."""
        turns = self.turns[:-1]
        count = int(np.clip(len(turns) / max(float(self.turns[-1]), 1.0) / 4.0, 4, PHASES))
        place = np.minimum((turns % 1.0 * count).astype(np.intp), count - 1)
        inside = turns < self.whole
        total = np.bincount(place[inside], self.torque[inside] - self.mean(), count)
        wave = total / np.maximum(np.bincount(place[inside], minlength=count), 1)
        shape = np.interp(turns, (np.arange(count) + 0.5) / count, wave, period=1.0)
        return np.asarray(shape - WholeRevolutions(shape, self.turns).mean())

    def _in_time(self, count: int) -> Batches:
        n = len(self.torque)
        if n < 2 * count:
            return Batches(np.empty(0), 0.0, 0)
        return self._between(np.linspace(0.0, float(n), count + 1), 0)

    def _cut(self, count: int, revolutions: int) -> Batches:
        return self._between(self._borders(count, revolutions), revolutions)

    def _borders(self, count: int, revolutions: int) -> Array:
        """Places between samples at which so many pieces of so many revolutions begin and end (count + 1,)."""
        places = np.arange(len(self.turns), dtype=np.float64)
        return np.asarray(np.interp(np.arange(count + 1) * float(revolutions), self.turns, places))

    def _between(self, borders: Array, revolutions: int) -> Batches:
        sums = np.diff(np.interp(borders, np.arange(len(self._total), dtype=np.float64), self._total))
        lengths = np.diff(borders)
        return Batches(sums / lengths, float(lengths.mean()), revolutions)

    @cached_property
    def _total(self) -> Array:
        return np.concatenate(([0.0], np.cumsum(self.torque)))


def whole_revolutions(angle: Array) -> Array:
    """Revolutions since the first of n samples (n + 1,) from an angle [rad], of either direction.

    The last one is where the sample after the last would stand, at the mean speed. Zeros where the angle has gaps.
    """
    n = len(angle)
    if n < 2 or not np.isfinite(angle).all():
        return np.zeros(n + 1)
    turns = np.maximum.accumulate(np.abs(angle - angle[0])) / REVOLUTION
    return np.append(turns, turns[-1] * n / (n - 1))


def batch_means(torque: Array, angle: Array) -> Batches:
    """Batches of a torque [N m] without gaps over the angle [rad] of the same shaft, (n,) each."""
    return WholeRevolutions(torque, whole_revolutions(angle)).batches()


def _whole_revolutions(turns: float) -> tuple[int, int]:
    """Number of batches and revolutions of each; (0, 0) where too few fit."""
    if turns < FEWEST_BATCHES:
        return 0, 0
    choices = [(b, int(turns // b)) for b in range(BATCHES, FEWEST_BATCHES - 1, -1) if turns >= b]
    for b, each in choices:
        if b * each >= COVERAGE * turns:
            return b, each
    return max(choices, key=lambda choice: choice[0] * choice[1])
