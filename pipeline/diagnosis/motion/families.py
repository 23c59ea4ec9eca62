"""Kinds of structure that the rows of a rotor are looked at for: what a missing torque may follow."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import null_space

from pmg.pipeline.diagnosis.motion.constants import COGGING_ORDERS, POLE_ORDERS
from pmg.pipeline.diagnosis.motion.view import waves_of
from pmg.pipeline.motion.smooth import derivative
from pmg.sim.shafts import SIDES, other_side

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array

SLOWED, SLOWED_LESS = 51, 21
"""Fine samples over which a covariate is smoothed: a tenth of a second; and, twice, an acceleration before it is
derived twice: once lets through with the wrong sign what is beyond 24 Hz, where most of it is noise of the angle."""

SWINGING = "second derivative of the acceleration"
"""What the torque of a mass on a spring follows beyond its inertia, below its resonance."""

PASSING_TORQUES = (0.03, 0.15)
"""Torques [N m] over which a rotor may change sides in its coupling."""

SLOW = (
    *("speed", "acceleration", "direction", "time in the run", "travel since reversal"),
    *("pole angle", "load and speed"),
)
"""What a missing torque may follow that changes no sooner than a wander, and does not hold it as the torque does."""

OF_TIME = 3
"""Degree of the curve of time that the zero of a transducer may follow over a campaign."""

CURVE_KNOTS = 7
"""Knots of a curve over a covariate."""


def structures(view: RotorView, spans: dict[str, float]) -> dict[str, Array]:
    """Columns (n, k) at the fine samples by what they follow; `spans` is the largest size of each covariate."""
    if view.at_rest:
        return {}
    of_torque = _curve if view.coupled else _bent  # free torques are straight lines of the acceleration
    time = view.state.stretch.run.time / max(float(view.state.stretch.run.time[-1]), 1e-9)
    found = {
        "speed": _curve(view.speed, spans["speed"]),
        "acceleration": _bent(_slowed(view.state.acceleration), spans["acceleration"]),
        "torque": of_torque(_slowed(view.shaft.torque), spans["torque"]),
        SWINGING: swinging(view),
        "direction": np.stack([view.direction**2, view.direction**2 * view.drag], 1),
        "time in the run": np.stack([time, time**2], 1) * view.drag[:, None],
        "time in the campaign": np.stack(
            [wave for k in (1, 2, 3) for wave in (np.cos(np.pi * k * view.campaign_time / spans["campaign"]),)], 1
        ),
        "poles of the gear": waves_of(view, view.side, POLE_ORDERS),
        "orders 5 to 26 of the shaft": waves_of(view, view.side, COGGING_ORDERS),
        "angle of the shaft": waves_of(view, view.side, (1, 2, 3, 4)),
        "travel since reversal": np.stack([view.direction * np.exp(-_travel(view) / w) for w in (0.01, 0.1, 1.0)], 1),
    }
    if not view.coupled:
        found["sign of the torque"] = _play(view)
    else:
        slip = view.state.slip
        found["pole angle"] = _curve(view.state.pole_angle, 1.0)
        found["angle of the other shaft"] = waves_of(view, other_side(view.side), (1, 2))
        found["rate of the pole angle"] = np.tanh(slip)[:, None]
        found["load and speed"] = view.load[:, None] * _curve(view.speed, spans["speed"])
    return found


def zeros_in_time(views: list[RotorView]) -> list[Array]:
    """Columns (n, k) of zeros of the transducers that follow a smooth curve of the time in the campaign."""

    def columns(view: RotorView) -> Array:
        time = 2.0 * view.campaign_time / view.history.length - 1.0
        curve = np.polynomial.legendre.legvander(time, OF_TIME)[:, 1:]
        return np.hstack([curve * (view.side == side) for side in SIDES])

    return [columns(view) for view in views]


def spans_by_kind(views: list[RotorView]) -> dict[tuple[str, bool], dict[str, float]]:
    """Largest size of each covariate over the views of each shaft, in neutral and engaged."""
    kinds = itertools.product(SIDES, (False, True))
    return {kind: _spans_of([view for view in views if (view.side, view.coupled) == kind]) for kind in kinds}


def slow_structures(views: list[RotorView]) -> list[Array]:
    """Columns (n, k) at the fine samples of each view of all that changes slowly, in neutral and then engaged."""
    spans, found, width = spans_by_kind(views), [], {False: 0, True: 0}
    for view in views:
        looked = structures(view, spans[view.side, view.coupled])
        found.append(np.hstack([np.zeros((len(view.speed), 0)), *(looked[name] for name in SLOW if name in looked)]))
        width[view.coupled] = max(width[view.coupled], found[-1].shape[1])
    blocks = []
    for view, columns in zip(views, found, strict=True):
        both = [np.zeros((len(view.speed), width[kind])) for kind in (False, True)]
        both[view.coupled][:, : columns.shape[1]] = columns
        blocks.append(np.hstack(both))
    return blocks


def swinging(view: RotorView, *, smoothed: bool = True) -> Array:
    """Second derivative of the acceleration (n, 1), which is smoothed first or is not, as most of it is noise then."""
    rate, acceleration = view.state.stretch.run.fine_rate, view.state.acceleration
    for _ in range(2 * smoothed):
        acceleration = _slowed(acceleration, SLOWED_LESS)
    return derivative(derivative(acceleration, rate), rate)[:, None]


def _play(view: RotorView) -> Array:
    """Acceleration of a rotor that changes sides with the sign of its torque, sharply and gently (n, 2)."""
    rate, torque = view.state.stretch.run.fine_rate, _slowed(view.shaft.torque)
    sides = (torque / np.hypot(torque, passage) for passage in PASSING_TORQUES)
    return np.stack([derivative(derivative(side, rate), rate) for side in sides], 1)


def _travel(view: RotorView) -> Array:
    """Angle that the motor turned since its sense of rotation last changed [rad]."""
    path = np.cumsum(np.abs(np.diff(view.shaft.angle, prepend=view.shaft.angle[0])))
    sense = np.sign(view.shaft.speed)
    turned = np.r_[True, sense[1:] != sense[:-1]]
    return np.asarray(path - np.maximum.accumulate(np.where(turned, path, 0.0)))


def _spans_of(views: list[RotorView]) -> dict[str, float]:
    """Largest size of each covariate over the views of one kind."""
    moving = [view for view in views if not view.at_rest]
    return {
        "speed": _largest([view.speed for view in moving]),
        "acceleration": _largest([np.percentile(np.abs(_slowed(view.state.acceleration)), [99.0]) for view in moving]),
        "torque": _largest([view.shaft.torque for view in moving]),
        "campaign": _largest([view.campaign_time for view in views]),
    }


def _slowed(values: Array, over: int = SLOWED) -> Array:
    """A quantity at the fine samples without what is faster than `over` of them, as a curve over it needs."""
    weights = np.hanning(over)
    return np.convolve(np.pad(values, over // 2, mode="edge"), weights / weights.sum(), "valid")


def _largest(values: list[Array]) -> float:
    return max((float(np.abs(each).max()) for each in values), default=1.0) or 1.0


def _curve(x: Array, span: float) -> Array:
    """Straight lines between knots over a covariate (n, k)."""
    knots = np.linspace(-span, span, CURVE_KNOTS)
    return np.asarray(
        np.maximum(1.0 - np.abs(np.clip(x, knots[0], knots[-1])[:, None] - knots) / (knots[1] - knots[0]), 0.0)
    )


def _bent(x: Array, span: float) -> Array:
    """The same without the straight line through zero (n, k - 1).

    An inertia is such a line, and what one over a smoothed acceleration leaves of it is mostly noise of the angle.
    """
    return _curve(x, span) @ null_space(np.linspace(-1.0, 1.0, CURVE_KNOTS)[None, :])
