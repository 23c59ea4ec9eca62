"""Structure that the residual of a regression may follow: families of columns over its covariates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.columns import waves_of
from pmg.pipeline.diagnosis.balance.library.elastic import flights
from pmg.pipeline.diagnosis.balance.library.term import LAG, OUT, TEMPERATURE
from pmg.pipeline.diagnosis.balance.periods import shortest
from pmg.pipeline.fit.structure import ResidualStructure
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.machine.axis import Axis
    from pmg.sim.signals import Array

KNOTS = 7
"""Knots of a smooth curve over a covariate, at its quantiles."""

WAVES = 8
"""Slow waves over position and over time."""

FINE_WAVES = 200
"""Half-waves over the whole travel at most."""

SAMPLES_PER_WAVE = 16
"""Samples of the regression that each of them calls for: more would leave too little to tell the noise by."""

GAPS = 8
"""Gaps that a load may fly across, evenly spaced on a logarithm."""

ORDERS = 24
"""Periods in a turn up to which a force is looked for."""


def _hats(covariate: Array) -> Array:
    """Piecewise linear curve over a covariate (n, knots)."""
    knots = np.unique(np.quantile(covariate, np.linspace(0.0, 1.0, KNOTS)))
    return np.stack([np.interp(covariate, knots, unit) for unit in np.eye(len(knots))], axis=1)


def _waves(covariate: Array, first: int, last: int) -> Array:
    """Cosines over the range of a covariate, of `first` to `last` half-waves (n, last - first + 1)."""
    low, high = float(covariate.min()), float(covariate.max())
    angle = np.pi * (covariate - low) / (high - low)
    return np.cos(np.arange(first, last + 1) * angle[:, None])


def families_of(recorded: Recorded, axis: Axis) -> tuple[ResidualStructure, ...]:
    """Families of structure of a recording; a curve, a wave or a rise each for what a machine's force may follow."""
    m = recorded.motion
    sign = m.direction[:, None]
    slow_place, slow_time = _waves(m.position, 1, WAVES), _waves(m.time, 1, WAVES)
    fine = min(FINE_WAVES, len(recorded.force) // SAMPLES_PER_WAVE)
    rise = np.stack([m.sense * np.exp(-m.travel / length) for length in axis.rises], axis=1)
    drawn = {
        "speed": sign * _hats(np.abs(m.speed)),
        "speed, different in the two directions": _hats(np.abs(m.speed)),
        "position": slow_place,
        "position, changing sign with direction": sign * slow_place,
        "position, fine": _waves(m.position, WAVES + 1, fine),
        "travel since reversal": rise,
        "time": slow_time,
        "time, as friction": np.c_[sign * slow_time[:, :4], m.speed[:, None] * slow_time[:, :4]],
        "rate of the force": m.ahead(m.modelled, m.references.get(LAG, 0.0))[:, None],
    }
    least = max(shortest(recorded), 1e-12)
    turns = [k for k in range(1, ORDERS + 1) if axis.turn / k >= least]
    if turns:
        angle = REVOLUTION / axis.turn * m.position
        waves = np.hstack([waves_of(m, order * angle) for order in turns])
        drawn |= {"angle of a turn": waves, "angle of a turn, changing sign with direction": sign * waves}
    if OUT not in m.besides:
        drawn["time, as a gain of the force"] = m.modelled[:, None] * slow_time[:, :4]
    if OUT in m.besides:
        load = m.besides[OUT]
        drawn |= {
            "transmitted torque": _hats(load),
            "transmitted torque, changing sign with direction": sign * _hats(load),
            "speed times transmitted torque": m.speed[:, None] * _hats(load),
            "rate of the transmitted torque": m.rate(load)[:, None],
        }
    if TEMPERATURE in m.besides:
        drawn["temperature, as friction"] = m.speed[:, None] * _hats(m.besides[TEMPERATURE])
    if len(m.starts) > 1:
        own = np.equal.outer(m.first, np.array(m.starts)).astype(np.float64)
        drawn |= {"recording": own, "recording, changing sign with direction": sign * own}
    if recorded.coasts:
        drawn = {name: drawn[name] for name in drawn if "force" not in name}
    else:
        gaps = np.geomspace(*axis.gaps, GAPS)
        drawn["flight across a gap"] = np.stack([flights(m, float(gap)).mean(axis=1) for gap in gaps], axis=1)
    thin = {name: recorded.thin(columns) for name, columns in drawn.items()}
    if not recorded.coasts:  # its acceleration is all that there is to explain
        thin |= _of_acceleration(recorded)
    return tuple(ResidualStructure("force", "all", (name,), columns) for name, columns in thin.items())


def _of_acceleration(recorded: Recorded) -> dict[str, Array]:
    """Curves over the slow part of the acceleration, beyond what noise makes of an even speed (n, k).

    Noise of the acceleration is in the residual too, as its inertia: left in the curve, it would follow itself.
    """
    m = recorded.motion
    moved = recorded.thin(np.c_[m.acceleration, m.direction])
    slow = recorded.slow(moved[:, 0])
    clear = np.sign(slow) * np.maximum(np.abs(slow) - m.even_acceleration, 0.0)
    turned = moved[:, 1:] * np.abs(clear)[:, None]
    return {"acceleration": _hats(clear), "acceleration, changing sign with direction": turned}
