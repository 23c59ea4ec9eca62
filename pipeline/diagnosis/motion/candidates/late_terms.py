"""Candidates that make a torque come late: lags, delays, of one transducer or of both alike."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from pmg.pipeline.diagnosis.balance.library.term import Quantity
from pmg.pipeline.diagnosis.motion.candidates.terms import BOTH, amount, sides_of, stack, term
from pmg.pipeline.motion.lag import BUTTERWORTH, EQUAL_LAGS, FIRST_ORDER, Lag
from pmg.pipeline.motion.smooth import derivative
from pmg.sim import sources
from pmg.sim.mechanisms.base import Component

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array


SHARP = "Butterworth"
"""Form of a low-pass that keeps its band: of the forms of lag it comes nearest to a delay."""

ANGLES = "angles late"
"""Form of a delay: angles that come after their torques, not torques after their angles."""

HELD = "held"
"""Form of a delay: a torque that is renewed, or averaged, now and then."""

HELD_AT_MOST = 20e-3
"""Longest delay of a torque that is held [s]. From 12 ms on, the series of its law is off by a tenth and more at 20 Hz;
from 18 ms on, its steps reach into the band of the rows."""

SHORT_LAG = 0.02
"""Longest lag that is made of the torque as shown [s]: of a longer one the noise would be most."""

SHORTER_LAG = 8e-3
"""The same of the second order [s]: a longer one passes for a delay, of 12 ms to three parts in a hundred at 16 ms."""

TITLES = {
    (False, 1.0): "Delay between the channels of torque and angle",
    (True, 1.0): "Delay of both torques behind their angles",
    (True, -1.0): "Delay of both angles behind their torques",
}
"""Of delays, by whether both shafts have them, and by their sense."""

LAGS = (
    ("First-order lag", "first order", "T/(1 + tau s) - T", FIRST_ORDER),
    ("Second-order lag", "second order", "T/(1 + tau s/2)^2 - T", EQUAL_LAGS),
    ("Second-order low-pass (Butterworth)", SHARP, "T/(1 + tau s + (tau s)^2/2) - T", BUTTERWORTH),
)
"""Lags of any size, the last of them for both transducers: filters of amplifiers are alike, and are of that kind."""

WHOLE = (Quantity("part", "1", (1.0, 1.0)),)
"""Amplitude of what comes late as a whole."""


def _later(view: RotorView, delay: float) -> Array:
    """A torque less itself that much later, by its values and slopes."""
    shaft = view.shaft
    return shaft.torque - _at(view, delay, shaft.torque, shaft.torque_rate)


def _at(view: RotorView, delay: float, values: Array, slopes: Array) -> Array:
    """Fine samples (n,) of what is later by a delay [s], cubic between samples; beyond the ends it stays."""
    time = view.state.stretch.run.time
    return np.asarray(CubicHermiteSpline(time, values, slopes)(np.clip(time + delay, time[0], time[-1])))


def _unheld(view: RotorView, delay: float) -> Array:
    """A torque less what it was before it was held, or averaged, over twice that time."""
    shaft, part = view.shaft, delay**2 / 6.0
    slope = derivative(shaft.torque_curvature, view.state.stretch.run.fine_rate)
    sharper = shaft.torque - part * shaft.torque_curvature
    return shaft.torque - _at(view, delay, sharper, shaft.torque_rate - part * slope)


def _lagging(view: RotorView, time: float, sharpness: float) -> Array:
    """What lags add to the torque of the model (n, 1).

    Made of the torque as shown, a lag that is long in the band of the rows would multiply its noise.
    """
    torque = stack(view.state.coupling_torque)
    return Lag(view.side, time, sharpness).of(torque, view.state.stretch.run.fine_rate) - torque


def lag_terms(side: str) -> Iterator[MotionTerm]:
    """A transducer that follows its torque slowly."""
    yield term(
        "transducer_bandwidth",
        "First-order lag of the transducer",
        "-tau dT/dt",
        amount("lag", "s", SHORT_LAG),
        lambda v, _: stack(-v.shaft.torque_rate - v.skew * v.shaft.torque_curvature),
        hears=lambda rate, _: (-rate, 0.0),
        mimicked_by=_skews(side),
        source=sources.BALANCE,
        component=_transducer(side),
        shaft=side,
    )

    yield term(
        "transducer_bandwidth",
        "Second-order lag of the transducer, short",
        "-tau dT/dt - tau2/4 d2T/dt2",
        WHOLE,
        lambda v, lag: stack(-lag * v.shaft.torque_rate - lag * (v.skew + 0.25 * lag) * v.shaft.torque_curvature),
        hears=lambda rate, lag: (-rate * lag - 0.25 * (rate * lag) ** 2, 0.0),
        mimicked_by=_skews(side),
        source=sources.BALANCE,
        shape=Quantity("lag", "s", (1e-3, SHORTER_LAG)),
        between=True,
        component=_transducer(side),
        shaft=side,
        variant="second order, short",
    )

    yield from _lags_of_any_size(side)


def _lags_of_any_size(place: str) -> Iterator[MotionTerm]:
    """Lags made of the torque of the model."""
    for title, variant, equation, sharpness in LAGS if place == BOTH else LAGS[:2]:
        yield term(
            "transducer_bandwidth",
            f"{title} {_whose(place)}",
            equation,
            WHOLE,
            partial(_lagging, sharpness=sharpness),
            sharpness=sharpness,
            mimicked_by=_skews(place),
            source=sources.BALANCE,
            shape=Quantity("lag", "s", (1e-3, 0.1)),
            component=_transducer(place),
            shaft=place,
            variant=variant,
        )


def delay_terms(side: str) -> Iterator[MotionTerm]:
    """A transducer that shows its torque some time after it was."""
    yield _delay(side)
    yield term(
        "channel_delay",
        "Torque channel that is renewed, or averaged, over twice its delay (sample and hold)",
        "T(t) - (T - d2/6 d2T/dt2)(t + d)",
        WHOLE,
        lambda v, delay: stack(_unheld(v, delay)),
        hears=lambda rate, delay: (1.0 - np.exp(rate * delay) * (1.0 - (rate * delay) ** 2 / 6.0), 0.0),
        mimicked_by=_skews(side),
        source=sources.BALANCE,
        shape=Quantity("delay", "s", (1e-3, HELD_AT_MOST)),
        component=_transducer(side),
        shaft=side,
        variant=HELD,
    )


def common_terms() -> Iterator[MotionTerm]:
    """Both torques come late alike, as through filters of one kind, or both angles do, as from another device."""
    yield from _lags_of_any_size(BOTH)
    yield _delay(BOTH)
    yield _delay(BOTH, sense=-1.0)


def _delay(place: str, sense: float = 1.0) -> MotionTerm:
    """Torques that come after their angles, or, with a `sense` of -1, angles that come after their torques."""
    late = sense > 0.0
    return term(
        "channel_delay",
        TITLES[place == BOTH, sense],
        f"T(t) - T(t {'+' if late else '-'} d)",
        WHOLE,
        lambda v, delay: stack(_later(v, sense * delay)),
        hears=lambda rate, delay: (1.0 - np.exp(sense * rate * delay), 0.0),
        mimicked_by=_skews(place),
        source=sources.BALANCE,
        shape=Quantity("delay", "s", (1e-3, 0.05)),
        component=_transducer(place),
        shaft=place,
        variant="" if late else ANGLES,
        sense=sense,
    )


def _skews(place: str) -> tuple[str, ...]:
    """Constants of the baseline that shift the torque of a shaft, or of both."""
    return tuple(f"skew_{side}" for side in sides_of(place))


def _transducer(place: str) -> Component:
    """That of a shaft; for both, the first of them, which a report marks together with the other one."""
    return Component(f"{sides_of(place)[0]}_torque_transducer")


def _whose(place: str) -> str:
    return "of both transducers" if place == BOTH else "of the transducer"
