"""Candidates in the torque transducer of a shaft."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from pmg.pipeline.diagnosis.balance.library.term import Quantity
from pmg.pipeline.diagnosis.motion.candidates.terms import amount, signed, stack, term
from pmg.pipeline.motion.lag import Lag
from pmg.pipeline.motion.smooth import derivative
from pmg.sim import sources
from pmg.sim.mechanisms.base import Component, LawCovariate

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array


HELD = "held"
"""Form of a delay: a torque that is renewed, or averaged, now and then."""

HELD_AT_MOST = 20e-3
"""Longest delay of a torque that is held [s]. From 12 ms on, the series of its law is off by a tenth and more at 20 Hz;
from 18 ms on, its steps reach into the band of the rows."""

SHORT_LAG = 0.02
"""Longest lag that is made of the torque as shown [s]: of a longer one the noise would be most."""

SHORTER_LAG = 8e-3
"""The same of the second order [s]: a longer one passes for a delay, of 12 ms to three parts in a hundred at 16 ms."""

WHOLE = (Quantity("part", "1", (1.0, 1.0)),)
"""Amplitude of what comes late as a whole."""

MOVES_IN = 10.0
"""Time in which a zero that moves at one time does so [s]."""


def _drifting(course: Array) -> Array:
    """A zero that moves from where it stood at the start."""
    return stack(course, np.ones_like(course))


def _bent(torque: Array) -> Array:
    """A torque, and what bends a line through zero: alike to both sides, and to one more than to the other (n, 3)."""
    return stack(torque, torque * np.abs(torque), torque**2)


def _later(view: RotorView, delay: float) -> Array:
    """A torque less itself that much later, by its values and slopes."""
    shaft = view.shaft
    return shaft.torque - _at(view, delay, shaft.torque, shaft.torque_rate)


def _at(view: RotorView, delay: float, values: Array, slopes: Array) -> Array:
    """Fine samples (n,) of what is later by a delay [s], cubic between samples; the last ones stay."""
    time = view.state.stretch.run.time
    return np.asarray(CubicHermiteSpline(time, values, slopes)(np.minimum(time + delay, time[-1])))


def _unheld(view: RotorView, delay: float) -> Array:
    """A torque less what it was before it was held, or averaged, over twice that time."""
    shaft, part = view.shaft, delay**2 / 6.0
    slope = derivative(shaft.torque_curvature, view.state.stretch.run.fine_rate)
    sharper = shaft.torque - part * shaft.torque_curvature
    return shaft.torque - _at(view, delay, sharper, shaft.torque_rate - part * slope)


def _lagging(view: RotorView, time: float, order: int) -> Array:
    """What lags add to the torque of the model (n, 1).

    Made of the torque as shown, a lag that is long in the band of the rows would multiply its noise.
    """
    torque = stack(view.state.coupling_torque)
    return Lag(view.side, time, order).of(torque, view.state.stretch.run.fine_rate) - torque


def scale_terms(side: str) -> Iterator[MotionTerm]:
    """What a transducer shows in proportion to a torque, its own or the other's, and where that proportion changes."""
    for identifier, size, title, whose, heard in (
        ("torque_gain_error", "gain", "Gain of the transducer", "", (1.0, 0.0)),
        ("torque_crosstalk", "crosstalk", "Crosstalk from the other transducer", ", T of the other", (0.0, 1.0)),
    ):

        def torque(view: RotorView, own: bool = not whose) -> Array:
            return view.shaft.torque if own else view.other.torque

        straight, bends = signed(size, unit="1", most=0.2), signed("curved", "sided", unit="1/(N m)", most=0.1)
        for sizes, law, equation, changes, variant in (
            (straight, lambda v, _, of=torque: stack(of(v)), "k T", "", ""),
            (
                (*straight, *bends),
                lambda v, _, of=torque: _bent(of(v)),
                "k1 T + k2 T |T| + k3 T2",
                " that changes with the torque",
                "curved",
            ),
        ):
            yield term(
                identifier,
                title + changes,
                equation + whose,
                sizes,
                law,
                hears=lambda rate, _, heard=heard: heard,
                shown_held=bool(whose),
                source=sources.GUM,
                follows=(LawCovariate.LOAD,),
                component=Component(f"{side}_torque_transducer"),
                shaft=side,
                variant=variant,
            )


def lag_terms(side: str) -> Iterator[MotionTerm]:
    """A transducer that follows its torque slowly."""
    transducer = Component(f"{side}_torque_transducer")
    yield term(
        "transducer_bandwidth",
        "First-order lag of the transducer",
        "-tau dT/dt",
        amount("lag", "s", SHORT_LAG),
        lambda v, _: stack(-v.shaft.torque_rate - v.skew * v.shaft.torque_curvature),
        hears=lambda rate, _: (-rate, 0.0),
        mimicked_by=(f"skew_{side}",),
        source=sources.BALANCE,
        component=transducer,
        shaft=side,
    )

    yield term(
        "transducer_bandwidth",
        "Second-order lag of the transducer, short",
        "-tau dT/dt - tau2/4 d2T/dt2",
        WHOLE,
        lambda v, lag: stack(-lag * v.shaft.torque_rate - lag * (v.skew + 0.25 * lag) * v.shaft.torque_curvature),
        hears=lambda rate, lag: (-rate * lag - 0.25 * (rate * lag) ** 2, 0.0),
        mimicked_by=(f"skew_{side}",),
        source=sources.BALANCE,
        shape=Quantity("lag", "s", (1e-3, SHORTER_LAG)),
        between=True,
        component=transducer,
        shaft=side,
        variant="second order, short",
    )

    for order, name, equation in ((1, "first", "T/(1 + tau s) - T"), (2, "second", "T/(1 + tau s/2)^2 - T")):
        yield term(
            "transducer_bandwidth",
            f"{name.capitalize()}-order lag of the transducer, of any size",
            equation,
            WHOLE,
            partial(_lagging, order=order),
            lag_order=order,
            mimicked_by=(f"skew_{side}",),
            source=sources.BALANCE,
            shape=Quantity("lag", "s", (1e-3, 0.1)),
            component=transducer,
            shaft=side,
            variant=f"{name} order",
        )


def delay_terms(side: str) -> Iterator[MotionTerm]:
    """A transducer that shows its torque some time after it was."""
    transducer = Component(f"{side}_torque_transducer")
    yield term(
        "channel_delay",
        "Delay between the channels of torque and angle",
        "T(t) - T(t + d)",
        WHOLE,
        lambda v, delay: stack(_later(v, delay)),
        hears=lambda rate, delay: (1.0 - np.exp(rate * delay), 0.0),
        mimicked_by=(f"skew_{side}",),
        source=sources.BALANCE,
        shape=Quantity("delay", "s", (1e-3, 0.05)),
        component=transducer,
        shaft=side,
    )

    yield term(
        "channel_delay",
        "Torque channel that is renewed, or averaged, over twice its delay (sample and hold)",
        "T(t) - (T - d2/6 d2T/dt2)(t + d)",
        WHOLE,
        lambda v, delay: stack(_unheld(v, delay)),
        hears=lambda rate, delay: (1.0 - np.exp(rate * delay) * (1.0 - (rate * delay) ** 2 / 6.0), 0.0),
        mimicked_by=(f"skew_{side}",),
        source=sources.BALANCE,
        shape=Quantity("delay", "s", (1e-3, HELD_AT_MOST)),
        component=transducer,
        shaft=side,
        variant=HELD,
    )


def zero_terms(side: str) -> Iterator[MotionTerm]:
    """A transducer that does not show zero at rest."""
    transducer = Component(f"{side}_torque_transducer")
    yield term(
        "torque_zero_offset",
        "Zero error of the transducer",
        "T0",
        signed("offset", unit="N m"),
        lambda v, _: stack(np.ones_like(v.speed)),
        source=sources.GUM,
        constants=(f"zero_{side}",),
        component=transducer,
        shaft=side,
    )


def drift_terms(side: str) -> Iterator[MotionTerm]:
    """A transducer whose zero moves over the campaign."""
    transducer = Component(f"{side}_torque_transducer")
    yield term(
        "torque_zero_drift",
        "Zero of the transducer that moved at one time",
        "T0 H(t - t0) + T1",
        signed("step", "start", unit="N m", most=0.5),
        lambda v, when: _drifting(0.5 + 0.5 * np.tanh((v.campaign_time - when * v.history.length) / MOVES_IN)),
        source=sources.GUM,
        shape=Quantity("when", "1", (0.1, 0.95)),
        mimicked_by=(f"zero_{side}",),
        holds=("torque_zero_offset",),
        shown_at_rest=True,
        follows=(LawCovariate.TIME,),
        component=transducer,
        shaft=side,
        variant="step",
    )

    yield term(
        "torque_zero_drift",
        "Zero of the transducer that drifts steadily",
        "T0 t + T1",
        (*signed("drift", unit="N m/s"), *signed("start", unit="N m")),
        lambda v, _: _drifting(v.campaign_time),
        source=sources.GUM,
        mimicked_by=(f"zero_{side}",),
        holds=("torque_zero_offset",),
        shown_at_rest=True,
        follows=(LawCovariate.TIME,),
        component=transducer,
        shaft=side,
        variant="steady",
    )

    yield term(
        "torque_zero_drift",
        "Zero of the transducer that drifts over the campaign",
        "T0 (1 - exp(-t/tau)) + T1",
        signed("drift", "start", unit="N m", most=0.5),
        lambda v, settles: _drifting(1.0 - np.exp(-v.campaign_time / settles)),
        source=sources.GUM,
        shape=Quantity("settles", "s", (60.0, 5000.0)),
        mimicked_by=(f"zero_{side}",),
        holds=("torque_zero_offset",),
        shown_at_rest=True,
        follows=(LawCovariate.TIME,),
        component=transducer,
        shaft=side,
    )
