"""The whitened problem: rows freed from a baseline, beside which candidates are fitted and compared."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import numpy as np
from scipy.optimize import lsq_linear

from pmg.pipeline.fit.span import lengths, orthonormal

if TYPE_CHECKING:
    from typing import Self

    from pmg.sim.signals import Array


class _Nameable(Protocol):
    """What may explain a mismatch; it can be hashed."""

    @property
    def identifier(self) -> str:
        """Id of the mechanism or term."""


C = TypeVar("C", bound=_Nameable)


TIE = 6
"""Decimals of a score [noise variances] that decide between candidates; those after them are the processor's."""


@dataclass(frozen=True)
class Fit(Generic[C]):
    """A candidate fitted beside the baseline.

    Parameters
    ----------
    candidate : Candidate
        What was fitted.
    gain : float
        Fall of the whitened sum of squares, in noise variances.
    cost : float
        Parameters it counts for.
    seen : (m,) array
        Its effect, whitened, less what the baseline absorbs.
    on_bound : tuple of str
        Parameters on a bound.
    """

    candidate: C
    gain: float
    cost: float
    seen: Array
    on_bound: tuple[str, ...]

    @property
    def identifier(self) -> str:
        """Id of the mechanism or term."""
        return self.candidate.identifier

    @property
    def place(self) -> str:
        """Where it acts, of several places where it may; empty where there is one only."""
        return ""

    @property
    def admissible(self) -> bool:
        """Whether it may stand in a set at all."""
        return True

    @property
    def needed(self) -> bool:
        """Whether its sizes are off their bounds, so that it is neither absent nor as large as can be."""
        return self.admissible

    @property
    def bends_to_anything(self) -> bool:
        """Whether its shape ran to where it is no longer a form of its own, or out of the range of its source."""
        return False


F = TypeVar("F", bound=Fit[Any])
P = TypeVar("P", bound="WhitenedProblem[Any]")


@dataclass(frozen=True)
class WhitenedProblem(ABC, Generic[F]):
    """Whitened rows freed from the baseline: where candidates are compared.

    Parameters
    ----------
    baseline : (m, k) array
        Orthonormal basis of what the baseline can absorb, whitened, and of what has been taken out.
    left : (m,) array
        Whitened rows with that projected out.
    """

    baseline: Array
    left: Array

    @abstractmethod
    def slopes(self, fit: F) -> Array:
        """Whitened change of the rows per change of each free parameter of a fit (m, p)."""

    def project(self, columns: Array) -> Array:
        """The part of a whitened vector or of whitened columns that the baseline cannot absorb."""
        return np.asarray(columns - self.baseline @ (self.baseline.T @ columns))

    def score(self, fit: F) -> float:
        """Gain of a fit less the cost of its parameters (Schwarz's criterion, up to a constant), in noise variances.

        Rounded, so that of candidates which the rows cannot tell apart the first of the catalogue leads.
        """
        return round(fit.gain - fit.cost * math.log(len(self.left)), TIE)

    def take_out(self, fit: F) -> Self:
        """The problem with a fitted candidate taken out and its parameters free to move with the baseline's."""
        changed: dict[str, Any] = {"left": self.left - fit.seen}
        return replace(self, **changed).take_up(self.slopes(fit))

    def take_up(self, columns: Array) -> Self:
        """The problem whose baseline may follow some more whitened columns (m, k)."""
        added = orthonormal(self.project(columns), 1e-4)
        changed: dict[str, Any] = {
            "baseline": np.hstack([self.baseline, added]),
            "left": self.left - added @ (added.T @ self.left),
        }
        return replace(self, **changed)


def bounded_sizes(seen: Array, left: Array, bounds: Array) -> tuple[float, Array]:
    """Sum of squares that columns (m, k) leave, and the sizes (k,) inside their bounds (2, k); equal ones fix it."""
    free, sizes = bounds[0] != bounds[1], bounds[0].astype(np.float64)
    rest = left - seen[:, ~free] @ sizes[~free]
    if not free.any():
        return float(rest @ rest), sizes
    length = lengths(seen[:, free])
    low, high = bounds[:, free]
    found = lsq_linear(seen[:, free] / length, rest, bounds=(low * length, high * length), method="bvls")
    sizes[free] = np.clip(found.x / length, low, high)
    return 2.0 * float(found.cost), sizes
