"""Whether simulated and measured values agree within a tolerance that was set beforehand, point by point."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim import signals

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.analysis.comparison import Difference, Residuals
    from pmg.sim.bench import BenchParameters, TransducerParameters
    from pmg.sim.signals import Array, Mask, Signal

COMPARED: tuple[tuple[str, Signal], ...] = (
    ("torque_sun", signals.TORQUE_SUN),
    ("torque_ring", signals.TORQUE_RING),
    ("loss_total", signals.LOSS_TOTAL),
    ("efficiency_total", signals.EFFICIENCY_TOTAL),
)
"""Every quantity that is compared: its field in `Residuals`, and its signal."""


class ToleranceState(StrEnum):
    """Agreement of a simulated value with the measured one."""

    WITHIN = "within tolerance"
    OUT = "out of tolerance"
    NOT_COMPARABLE = "not comparable"


def _states(compared: Mask, within: Mask) -> tuple[ToleranceState, ...]:
    return tuple(
        ToleranceState.NOT_COMPARABLE if not known else ToleranceState.WITHIN if inside else ToleranceState.OUT
        for known, inside in zip(compared, within, strict=True)
    )


@dataclass(frozen=True)
class Tolerance:
    """Tolerance of a simulated value about the measured one: the larger of two bounds.

    Parameters
    ----------
    absolute : float
        In SI units, zero or more.
    relative : float
        Part of the measured value, zero or more.
    """

    absolute: float
    relative: float

    def at(self, measured: Array) -> Array:
        """The bound at each measured value."""
        return np.maximum(self.absolute, self.relative * np.abs(measured))


@dataclass(frozen=True)
class Agreement:
    """One quantity over n points.

    Parameters
    ----------
    bound : (n,) array
        Tolerance in SI units; NaN where there is none.
    compared, within : (n,) array of bool
        Points at which both values are known, and those of them that agree.
    rule : str
        The tolerance in words.
    """

    bound: Array
    compared: Mask
    within: Mask
    rule: str

    @property
    def states(self) -> tuple[ToleranceState, ...]:
        """`ToleranceState` of each point."""
        return _states(self.compared, self.within)


@dataclass(frozen=True)
class Agreements:
    """Every compared quantity.

    Parameters
    ----------
    of : dict
        `Agreement` by the name of `COMPARED`.
    """

    of: Mapping[str, Agreement]

    @property
    def compared(self) -> Mask:
        """Points at which any quantity is compared."""
        return np.asarray(np.any([one.compared for one in self.of.values()], axis=0))

    @property
    def within(self) -> Mask:
        """Points at which every quantity that is compared agrees."""
        agreeing = np.all([one.within | ~one.compared for one in self.of.values()], axis=0)
        return np.asarray(self.compared & agreeing)

    @property
    def states(self) -> tuple[ToleranceState, ...]:
        """`ToleranceState` of each point by all that is compared there."""
        return _states(self.compared, self.within)

    @property
    def counts(self) -> dict[str, dict[str, int]]:
        """Points within, out of tolerance and not comparable: over all quantities, as ``points``, and for each."""
        states = {"points": self.states} | {name: one.states for name, one in self.of.items()}
        words = {
            "within": ToleranceState.WITHIN,
            "out": ToleranceState.OUT,
            "not_comparable": ToleranceState.NOT_COMPARABLE,
        }
        return {name: {word: judged.count(state) for word, state in words.items()} for name, judged in states.items()}

    @property
    def description(self) -> str:
        """The count as a sentence."""
        compared = int(self.compared.sum())
        if not compared:
            return "No point can be compared with the simulation."
        left = len(self.compared) - compared
        more = f" ({left} not comparable)" if left else ""
        return f"Simulation within tolerance at {int(self.within.sum())} of {compared} points{more}."


def agreements(
    residuals: Residuals, bench: BenchParameters, given: Mapping[str, Tolerance] | None = None
) -> Agreements:
    """Measured and simulated values judged by their tolerance.

    Parameters
    ----------
    residuals : Residuals
        What is compared.
    bench : BenchParameters
        Data sheets of the transducers.
    given : mapping, optional
        Tolerances that were set, by the names of `COMPARED`.

    Notes
    -----
    Where none was set, a torque may be off by what the transducer's data sheet allows: the larger of its
    non-linearity (of the nominal torque) and its sensitivity tolerance (of the reading). Engaged, the ring torque
    is the simulator's input, so the loss may be off by the sun's bound times its speed, and the efficiency by the
    sun's bound in parts of its torque. Zero checks are not compared: with both shafts at rest nothing is simulated,
    and what they read is the tare. A tolerance says whether a model is good enough for its use; U says whether
    a difference is real. Both are reported.
    """
    set_by_user, running = dict(given or {}), ~residuals.grid.points.zero
    transducers = {"torque_sun": bench.transducer_sun, "torque_ring": bench.transducer_ring}
    of = {
        name: _judged(getattr(residuals, name), *_torque(transducer, set_by_user.get(name)), running)
        for name, transducer in transducers.items()
    }
    sun = of["torque_sun"].bound
    speed = np.abs(residuals.grid.points.speed_sun)
    with np.errstate(divide="ignore", invalid="ignore"):
        derived = {
            "loss_total": (sun * speed, "the sun torque's bound times its speed"),
            "efficiency_total": (
                np.abs(residuals.efficiency_total.measured) * sun / np.abs(residuals.torque_sun.measured),
                "the sun torque's bound in parts of its torque",
            ),
        }
    for name, (bound, rule) in derived.items():
        difference: Difference = getattr(residuals, name)
        chosen = set_by_user.get(name)
        signal = dict(COMPARED)[name]
        if chosen is not None:
            bound, rule = chosen.at(difference.measured), _words(chosen, signal)
        of[name] = _judged(difference, bound, rule, running)
    return Agreements({name: of[name] for name, _ in COMPARED})


def _torque(transducer: TransducerParameters, given: Tolerance | None) -> tuple[Tolerance, str]:
    if given is not None:
        return given, _words(given, signals.TORQUE_SUN)
    sheet = Tolerance(
        float(transducer.nonlinearity) * float(transducer.nominal_torque), float(transducer.sensitivity_tolerance)
    )
    return sheet, f"{_words(sheet, signals.RESIDUAL)}, as the transducer's data sheet"


def _words(tolerance: Tolerance, signal: Signal) -> str:
    unit = f" {signal.display_unit}" if signal.display_unit != "1" else ""
    absolute, relative = f"{signal.display(tolerance.absolute):.3g}{unit}", f"{100 * tolerance.relative:.3g} %"
    return f"the larger of {absolute} and {relative} of the reading"


def _judged(difference: Difference, bound: Tolerance | Array, rule: str, running: Mask) -> Agreement:
    reach = bound.at(difference.measured) if isinstance(bound, Tolerance) else np.asarray(bound)
    compared = running & np.isfinite(difference.value) & np.isfinite(reach)
    return Agreement(
        np.where(compared, reach, np.nan), compared, np.asarray(compared & (np.abs(difference.value) <= reach)), rule
    )
