"""A figure as the thesis prints it: value, digits, unit, place."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pmg.sim import sources
from pmg.sim.signals import Signal
from pmg.sim.sources import Source


@dataclass(frozen=True)
class Unit:
    """The unit a figure is printed in, and its value in SI."""

    name: str
    scale: float = 1.0

    @classmethod
    def of(cls, signal: Signal) -> Unit:
        """The display unit of a quantity."""
        return cls(signal.display_unit, signal.scale)


@dataclass(frozen=True)
class Other:
    """Value that the source prints, or implies, for the same figure elsewhere."""

    value: float
    decimals: int
    place: str


@dataclass(frozen=True)
class PublishedFigure:
    """A figure as printed.

    Parameters
    ----------
    id : str
        Name; what stands before the first dot is its group.
    what : str
        What it is, for people.
    value : float
        As printed, in `unit`. Infinite values leave a side of a claim open.
    decimals : int
        Decimals printed; half a unit of the last one is the figure's own rounding. Negative: tens.
    unit : Unit
        Unit as printed.
    place : str
        Where it stands in the thesis.
    until : float, optional
        The upper end where a range is printed.
    size : float, optional
        What the width of an interval is judged against, where the figure's own value will not do.
    other : Other, optional
        A second statement of the same.
    """

    id: str
    what: str
    value: float
    decimals: int
    unit: Unit
    place: str
    until: float | None = None
    size: float | None = None
    other: Other | None = None

    @property
    def group(self) -> str:
        """Group of the id."""
        return self.id.partition(".")[0]

    @property
    def source(self) -> Source:
        """The thesis, with the place."""
        return sources.THESIS.at(self.place)

    @property
    def rounding(self) -> float:
        """Half a unit of the last digit, in the unit as printed."""
        return 0.5 * 10.0**-self.decimals

    @property
    def upper(self) -> float:
        """Upper end of what is claimed; the value itself where one number is printed."""
        return self.value if self.until is None else self.until

    @property
    def consistent(self) -> bool:
        """Whether the source's statements of this figure agree within their digits."""
        if self.other is None:
            return True
        reach = self.rounding + 0.5 * 10.0**-self.other.decimals
        other, slack = self.other.value, 1e-9 * abs(self.other.value)
        return self.value - reach - slack <= other <= self.upper + reach + slack

    @property
    def text(self) -> str:
        """The figure as printed."""
        low, high = (f"{v:.{max(self.decimals, 0)}f}" for v in (self.value, self.upper))
        if math.isinf(self.value):
            return f"<= {high}"
        if math.isinf(self.upper):
            return f">= {low}"
        return low if self.until is None else f"{low} to {high}"
