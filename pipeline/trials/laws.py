"""Laws that a concealed effect may follow: usual ones, and ones that are kept for a final trial."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pmg.sim.signals import Array

USUAL, RESERVED = "usual", "reserved"
CHOICES = (USUAL, RESERVED, "all")
"""Families that a trial may draw its laws from."""


@dataclass(frozen=True)
class Law:
    """A formula, and the ranges from which its constants are drawn.

    Parameters
    ----------
    shape : callable
        The formula: dimensionless arrays, then its constants by name.
    ranges : mapping of str to (low, high)
        Bounds of each constant.
    """

    shape: Callable[..., Array]
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Families:
    """Laws of one effect by name; those reserved are drawn for a final trial only."""

    usual: Mapping[str, Law] = field(default_factory=dict)
    reserved: Mapping[str, Law] = field(default_factory=dict)

    @cached_property
    def every(self) -> dict[str, Law]:
        """Usual and reserved laws."""
        return {**self.usual, **self.reserved}

    def among(self, choice: str) -> tuple[str, ...]:
        """Names that one of `CHOICES` draws from; an effect without reserved laws keeps its usual ones."""
        listed = {USUAL: self.usual, RESERVED: self.reserved or self.usual}.get(choice, self.every)
        return tuple(listed)

    def draw(self, choice: str, rng: np.random.Generator, pinned: Mapping[str, float | str]) -> dict[str, float | str]:
        """A law and its constants; `pinned` may fix any of them."""
        if not self.every:
            return {}
        drawn = str(rng.choice(self.among(choice)))
        law = str(pinned.get("law", drawn))
        return {"law": law} | {name: rng.uniform(*ends) for name, ends in self.every[law].ranges.items()}

    def family(self, law: str) -> str:
        """`RESERVED` or `USUAL`."""
        return RESERVED if law in self.reserved else USUAL


def softplus(x: Array, corner: float, width: float) -> Array:
    """Nothing below the corner, x less the corner beyond, joined smoothly over the width."""
    return np.asarray(width * np.logaddexp(0.0, (x - corner) / width))
