"""What a contestant of `./pmgw bench rivals` is given, and what it answers; the truth is not among it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from pmg.pipeline.diagnosis.engine.withheld import FOLDS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

B = TypeVar("B", bound="AnyBout", contravariant=True)
GENERIC, PHYSICAL, BESIDE = "polynomials and Fourier", "physical terms", "physical terms, baseline projected out"
"""Kinds of library that a regression may choose from."""
TOUCHED = 0.1
"""Part of the root mean square of an effect from which a reading counts as touched, as in `pmg prove`."""


@dataclass(frozen=True)
class Library:
    """Columns to choose from.

    Parameters
    ----------
    theta : (m, k) array
        The columns in units of the noise, each of unit root mean square.
    owners : tuple of (id, shaft) or None
        The mechanism of each; None where it stands for none.
    beside : bool
        Whether the baseline stays free beside them; else it is frozen.
    """

    theta: Array
    owners: tuple[tuple[str, str] | None, ...]
    beside: bool = False

    def columns(self, bout: AnyBout, train: Mask) -> Array:
        """The columns; where the baseline is projected out, as the training rows determine that."""
        return bout.beside(self.theta, train) if self.beside else self.theta


def of_unit_size(theta: Array, owners: list[Any]) -> tuple[Array, tuple[Any, ...]]:
    """Columns of unit root mean square with their owners, without those that are zero."""
    size = np.sqrt(np.mean(theta**2, axis=0))
    kept = size > 0.0
    return theta[:, kept] / size[kept], tuple(owner for owner, keep in zip(owners, kept, strict=True) if keep)


class AnyBout(ABC):
    """A measured campaign about its baseline: m rows, the baseline's columns, the noise.

    Parameters
    ----------
    fold : (m,) array of int
        Fold of each row: the blocks of the diagnosis's own withheld proof; `FOLDS` for a row that is never withheld.
    scale : (m,) array
        Noise of each row.
    residual : (m,) array
        Residual of the frozen baseline, in units of the noise.
    free : (m, k) array
        Columns of the baseline, in units of the noise.
    """

    fold: npt.NDArray[np.int64]
    scale: Array
    residual: Array
    free: Array

    @abstractmethod
    def library(self, kind: str) -> Library:
        """Columns of a kind, for a regression that chooses from them."""

    def beside(self, values: Array, train: Mask) -> Array:
        """Values (m,) or (m, k) [noise] less what the baseline takes up of them on the training rows."""
        length = np.linalg.norm(self.free[train], axis=0)
        length[length == 0.0] = 1.0
        solution = np.linalg.lstsq(self.free[train] / length, values[train], rcond=1e-8)[0]
        return np.asarray(values - (self.free / length) @ solution)

    def residual_without(self, train: Mask) -> Array:
        """Residual of the baseline that the training rows alone determine, at every reading, in units of the noise."""
        return self.beside(self.residual, train)

    def held_out(self, effect: Array, predict: Callable[[Mask], Array]) -> float | None:
        """Error on withheld readings over the noise, where the effect acts; None without an effect.

        Parameters
        ----------
        effect : (m,) array
            What was found on all readings [noise]; it decides only which readings are looked at.
        predict : callable
            From the training rows to a correction of every reading [noise].
        """
        size = math.sqrt(float(np.mean(effect**2)))
        if size == 0.0:
            return None
        touched = np.abs(effect) > TOUCHED * size
        touched &= self.fold < FOLDS
        after = np.zeros(len(effect))
        for k in range(FOLDS):
            test, train = self.fold == k, self.fold != k
            after[test] = (self.residual_without(train) - predict(train))[test]
        return self.ratio(after, touched)

    def ratio(self, error: Array, rows: Mask) -> float | None:
        """Root mean square of errors [noise] over that of the noise, both in N m; None over no readings."""
        if not rows.any():
            return None
        return math.sqrt(float(np.mean((error * self.scale)[rows] ** 2) / np.mean(self.scale[rows] ** 2)))


@dataclass(frozen=True)
class Reply:
    """What a contestant says of a campaign by one of its settings.

    Parameters
    ----------
    alarm : bool
        Whether it claims a mismatch.
    said : (id, shaft) or None
        The mechanism that it names; None where it names nothing.
    held_out : float or None
        Error on withheld readings with its correction in, over the noise.
    """

    alarm: bool
    said: tuple[str, str] | None = None
    held_out: float | None = None


@dataclass(frozen=True)
class Answer:
    """All that a contestant says of a campaign.

    Parameters
    ----------
    level : float
        How strongly it alarms; a calibrated setting alarms above the level that clean campaigns seldom pass.
    settings : dict of str to Reply
        By each of its own rules.
    graded : tuple of (float, Reply)
        What it says when told to ask for that much, in rising order; one entry where asking for more changes nothing
        but whether it alarms.
    seconds : float
        Time without the withheld folds, which are the bench's question and not its own.
    remarks : dict
        Whatever else it tells.
    """

    level: float
    settings: Mapping[str, Reply]
    graded: tuple[tuple[float, Reply], ...]
    seconds: float
    remarks: Mapping[str, Any]

    def above(self, threshold: float) -> Reply:
        """The reply of the setting that alarms above a level."""
        if self.level <= threshold:
            return Reply(alarm=False)
        said = next((reply for level, reply in self.graded if level > threshold), self.graded[-1][1])
        return Reply(True, said.said, said.held_out)


class Contestant(Protocol[B]):
    """One that answers."""

    @property
    def name(self) -> str:
        """As in the table, and in the files that keep its answers."""

    def __call__(self, bout: B, *, withheld: bool) -> Answer:
        """What it says of a campaign; errors on withheld readings only when asked for."""
