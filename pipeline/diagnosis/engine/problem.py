"""The whitened problem: rows freed from a baseline, beside which candidates are fitted and compared."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import numpy as np

from pmg.pipeline.fit.span import orthonormal

if TYPE_CHECKING:
    from collections.abc import Hashable
    from typing import Self

    from pmg.sim.signals import Array


class Fit(Protocol):
    """A candidate fitted beside the baseline."""

    @property
    def identifier(self) -> str:
        """Id of the mechanism or term."""

    @property
    def gain(self) -> float:
        """Fall of the whitened sum of squares, in noise variances."""

    @property
    def cost(self) -> float:
        """Free parameters that it counts for."""

    @property
    def seen(self) -> Array:
        """Its effect (m,), whitened, less what the baseline absorbs."""

    @property
    def candidate(self) -> Hashable:
        """What was fitted."""

    @property
    def place(self) -> str:
        """Where it acts, of several places where it may; empty where there is one only."""

    @property
    def admissible(self) -> bool:
        """Whether it may stand in a set at all."""

    @property
    def needed(self) -> bool:
        """Whether its sizes are off their bounds, so that it is neither absent nor as large as can be."""

    @property
    def bends_to_anything(self) -> bool:
        """Whether its shape ran to where it no longer gives the effect a form of its own."""


F = TypeVar("F", bound=Fit)
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
        """What of a whitened vector or of whitened columns the baseline cannot absorb."""
        return np.asarray(columns - self.baseline @ (self.baseline.T @ columns))

    def score(self, fit: F) -> float:
        """Gain of a fit less the cost of its parameters (Schwarz's criterion, up to a constant), in noise variances."""
        return fit.gain - fit.cost * math.log(len(self.left))

    def take_out(self, fit: F) -> Self:
        """The problem with a fitted candidate taken out and its parameters free to move with the baseline's."""
        added = orthonormal(self.project(self.slopes(fit)), 1e-4)
        left = self.left - fit.seen
        changed: dict[str, Any] = {
            "baseline": np.hstack([self.baseline, added]),
            "left": left - added @ (added.T @ left),
        }
        return replace(self, **changed)
