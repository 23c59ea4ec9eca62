"""Candidates in motion: what one is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.balance.library.term import Quantity, Term
from pmg.pipeline.diagnosis.motion.constants import MAP_WAVES, map_name
from pmg.pipeline.diagnosis.motion.view import RotorView
from pmg.sim import sources
from pmg.sim.mechanisms.base import Component, LawCovariate
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from pmg.sim.signals import Array, Spectrum
    from pmg.sim.sources import Source

BOTH = "both"
"""Place of what acts on both shafts."""


@dataclass(frozen=True)
class MotionTerm(Term[RotorView]):
    """A mechanism on a place.

    Parameters
    ----------
    component : Component
        Where it sits.
    shaft : str
        ``sun``, ``ring`` or ``both``.
    spreads : bool
        Whether the gear carries its effect to the other rotor.
    constants : tuple of str
        Constants of the baseline of which it says that the data sheet is wrong; its sizes are by how much.
    mimicked_by : tuple of str
        Constants of the baseline that would take up its effect, far off their data sheet.
    hears : callable, optional
        Of a fault of a transducer: what its column holds of the noise in the own reading and in the other's, by the
        rate of change of a wave (f,) and the shape.
    sharpness : float
        Of a lag whose time is the shape; NaN for any other mechanism.
    sense : float
        -1 where a torque comes before its angle, 1 of any other mechanism.
    follows : tuple of LawCovariate
        Quantities along which its law may be another one.
    holds : tuple of str
        Ids of mechanisms that it is where a part of it is zero.
    between : bool
        Whether its law is an expansion that lies between others of its mechanism and that of another mechanism, so that
        it is a rival of that one where one of those is, too.
    within : str
        Variant of the same mechanism of which it is a special case; empty of none.
    mixes : bool
        Whether its law may be one of several shapes at once, as of bristles of several lengths.
    of_pole_angle : bool
        Whether its sizes are torques on the pole angle, of which a rotor feels as many times as it has pole pairs.
    engaged_only : bool
        Whether it acts in the engaged gear only.
    shown_at_rest : bool
        Whether a zero run shows it, too.
    shown_held : bool
        Whether the reading of a shaft shows it that is held while the other one turns.
    granted : float, optional
        Value of its shape at which every machine may have some of it: what it does there is free, and no finding.
    """

    component: Component = field(kw_only=True)
    shaft: str = field(kw_only=True)
    spreads: bool = False
    constants: tuple[str, ...] = ()
    mimicked_by: tuple[str, ...] = ()
    hears: Callable[[Spectrum, float], tuple[Spectrum | float, Spectrum | float]] | None = None
    sharpness: float = math.nan
    sense: float = 1.0
    follows: tuple[LawCovariate, ...] = ()
    holds: tuple[str, ...] = ()
    between: bool = False
    within: str = ""
    mixes: bool = False
    of_pole_angle: bool = False
    engaged_only: bool = False
    shown_at_rest: bool = False
    shown_held: bool = False
    granted: float | None = None

    @property
    def place(self) -> str:
        """Shaft on which it acts."""
        return self.shaft

    @property
    def sides(self) -> tuple[str, ...]:
        """Shafts on which it acts."""
        return sides_of(self.shaft)

    @property
    def key(self) -> str:
        """Its own among all terms."""
        return "/".join((self.identifier, self.shaft, self.variant))

    @property
    def of_transducer(self) -> bool:
        """Whether it is what a transducer shows beyond the torque of its coupling."""
        return self.component.endswith("torque_transducer")

    @property
    def of_turn(self) -> bool:
        """Whether it comes back with the turn of a shaft, in a phase that it has as a cosine and a sine."""
        return self.amplitudes[0].name == "cosine"

    @property
    def is_lag(self) -> bool:
        """Whether it is a lag of any size, of the torque that the model predicts."""
        return not math.isnan(self.sharpness)

    @property
    def bends_spring(self) -> bool:
        """Whether it is a torque by where the poles stand, as that of the magnetic spring is."""
        return any(name in map(map_name, MAP_WAVES) for name in self.mimicked_by)

    @property
    def of_noisy_angles(self) -> bool:
        """Whether it is made of the angles as the constants are: what is left of the rows then holds their noise."""
        return self.is_lag or self.bends_spring

    @property
    def comes_late(self) -> bool:
        """Whether it shows a torque later than it is, as a skew of the baseline does."""
        return self.of_transducer and any(name.startswith("skew") for name in self.mimicked_by)

    def acts(self, view: RotorView) -> bool:
        """Whether it may act on that rotor in its run; its law is asked for nowhere else."""
        if self.constants or (self.engaged_only and not view.coupled):
            return False
        if view.at_rest and not (self.shown_held if view.held else self.shown_at_rest):
            return False
        return self.spreads or view.side in self.sides

    def columns_on(self, view: RotorView, shape: float) -> Array:
        """Columns (n, a) at the fine samples of a rotor; zero where it does not act."""
        return self.columns(view, shape) if self.acts(view) else np.zeros((len(view.speed), len(self.amplitudes)))

    def rows_on(self, view: RotorView, shape: float) -> Array:
        """The same at the rows of a stretch (r, a)."""
        return view.state.stretch.of_rows(self.columns_on(view, shape))


def sides_of(place: str) -> tuple[str, ...]:
    """The shafts of a place: itself, or those of both."""
    return SIDES if place == BOTH else (place,)


def term(
    identifier: str,
    title: str,
    equation: str,
    sizes: tuple[Quantity, ...],
    law: Callable[[RotorView, float], Array],
    *,
    source: Source = sources.BALANCE,
    shape: Quantity | None = None,
    **where: Any,  # noqa: ANN401 - component, shaft, variant, spreads, constants, mimicked_by, hears, follows, mixes, ...
) -> MotionTerm:
    """A candidate."""
    return MotionTerm(identifier, title, equation, sizes, law, source, shape, **where)


def amount(name: str, unit: str, most: float, cost: float = 1.0) -> tuple[Quantity, ...]:
    """A size that cannot be negative."""
    return (Quantity(name, unit, (0.0, most), cost),)


def signed(*names: str, unit: str, most: float = math.inf) -> tuple[Quantity, ...]:
    """Sizes of either sign; of how far a constant is off its data sheet, as far as it may be."""
    return tuple(Quantity(name, unit, (-most, most)) for name in names)


def stack(*columns: Array) -> Array:
    """Columns side by side (n, k)."""
    return np.stack(columns, axis=1)


def torque_of_terms(view: RotorView, parts: Iterable[tuple[MotionTerm, float, Array]]) -> Array:
    """What mechanisms of a shape and amplitudes (a,) each add at the fine samples of a stretch [N m], (n,)."""
    return sum((term.columns_on(view, shape) @ sizes for term, shape, sizes in parts), np.zeros(len(view.speed)))
