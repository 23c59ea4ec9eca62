"""Fitted constants of two campaigns, subtracted: constants of the calibration, and loss curves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.campaign_comparison.shared_errors import left_over
from pmg.pipeline.fit.calibration import CONSTANTS
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pmg.pipeline.campaign_comparison.difference import Versus
    from pmg.pipeline.campaign_comparison.shared_errors import Sharing
    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.pipeline.fit.common_errors import CommonErrorSources
    from pmg.sim.losscurve import LossCurve
    from pmg.sim.signals import Array

SPEEDS = 40
"""Speeds at which curves are subtracted."""


@dataclass(frozen=True)
class ConstantDifference:
    """A fitted constant in both campaigns.

    Parameters
    ----------
    name, unit : str
        As the calibration names it, and its SI unit.
    a, b : float
        Values.
    u_a, u_b : float
        Standard uncertainty of each, scatter and transducers; NaN where it was held.
    own, common : float
        Standard uncertainty of B minus A from the scatter of the readings, and from what the transducers leave; NaN
        where the constant was held in a campaign.
    state : str
        ``held`` or ``on its bound``, and in which campaign; empty where it was fitted in both.
    """

    name: str
    unit: str
    a: float
    b: float
    u_a: float
    u_b: float
    own: float
    common: float
    state: str

    @property
    def value(self) -> float:
        """B minus A."""
        return self.b - self.a

    @property
    def u(self) -> float:
        """Standard uncertainty of the difference."""
        return float(np.hypot(self.own, self.common))


@dataclass(frozen=True)
class CurveDifference:
    """The loss curve of a shaft in both campaigns, at rising speeds [rad/s]; torques [N m], (n,) each."""

    shaft: str
    speed: Array
    a: Array
    b: Array
    own: Array
    common: Array

    @property
    def value(self) -> Array:
        """B minus A."""
        return self.b - self.a

    @property
    def u(self) -> Array:
        """Standard uncertainty of the difference."""
        return np.hypot(self.own, self.common)


def constant_differences(versus: Versus) -> tuple[ConstantDifference, ...]:
    """K_corr, damping constants and coefficients of the loss curves; none where a campaign has no calibration."""
    one, other = _fitted(versus)
    if one is None or other is None:
        return ()
    scalars = tuple(CONSTANTS)
    names = [*scalars, *(name for name in one[1].parameters if name in other[1].parameters and name not in scalars)]
    return tuple(_constant(name, one, other, versus.shared) for name in names)


def curve_differences(versus: Versus) -> tuple[CurveDifference, ...]:
    """The loss curves of both shafts up to the lower of the highest speeds of both campaigns."""
    one, other = _fitted(versus)
    if one is None or other is None:
        return ()
    found = []
    for shaft in SIDES:
        curves = [calibration.model.curves[shaft] for calibration, _ in (one, other)]
        speed = np.linspace(0.0, min(curve.speed_limit for curve in curves), SPEEDS + 1)[1:]
        terms = [
            _by_parameter(curve, causes, shaft, speed) for curve, (_, causes) in zip(curves, (one, other), strict=True)
        ]
        own = np.hypot(*(np.linalg.norm(t @ c.root, axis=1) for t, (_, c) in zip(terms, (one, other), strict=True)))
        moved = [t @ c.moved for t, (_, c) in zip(terms, (one, other), strict=True)]
        left = left_over(versus.shared, (one[1].transducers, moved[0]), (other[1].transducers, moved[1]))
        values = [curve.torque(speed) for curve in curves]
        found.append(CurveDifference(shaft, speed, values[0], values[1], own, np.linalg.norm(left, axis=1)))
    return tuple(found)


Fitted = tuple["FittedBaseline", "CommonErrorSources"]


def _fitted(versus: Versus) -> tuple[Fitted | None, Fitted | None]:
    found: list[Fitted | None] = []
    for side in (versus.a, versus.b):
        of = side.analysis
        found.append(None if of.calibration is None or of.causes is None else (of.calibration, of.causes))
    return found[0], found[1]


def _by_parameter(curve: LossCurve, causes: CommonErrorSources, shaft: str, speed: Array) -> Array:
    """Derivatives (n, k) of a curve to all fitted parameters."""
    columns = dict(zip((f"{shaft}[{p:g}]" for p in curve.powers), curve.terms(speed).T, strict=True))
    return np.stack([columns.get(name, np.zeros(len(speed))) for name in causes.parameters], axis=-1)


def _constant(name: str, one: Fitted, other: Fitted, shared: Sharing) -> ConstantDifference:
    values, u, roots, moved, states = [], [], [], [], []
    for label, (calibration, causes) in (("A", one), ("B", other)):
        known = name in causes.parameters
        i = causes.parameters.index(name) if known else 0
        values.append(_value(calibration, name))
        roots.append(float(np.linalg.norm(causes.root[i])) if known else np.nan)
        moved.append(causes.moved[i] if known else np.full(len(causes.transducers), np.nan))
        u.append(float(np.hypot(roots[-1], np.linalg.norm(moved[-1]))))
        if not known:
            states.append(f"held in {label}")
        elif name in calibration.on_bound:
            states.append(f"on its bound in {label}")
    left = left_over(shared, (one[1].transducers, moved[0]), (other[1].transducers, moved[1]))
    unit = CONSTANTS[name].unit if name in CONSTANTS else "N m"
    own, common = float(np.hypot(roots[0], roots[1])), float(np.linalg.norm(left))
    return ConstantDifference(name, unit, values[0], values[1], u[0], u[1], own, common, ", ".join(states))


def _value(calibration: FittedBaseline, name: str) -> float:
    if name in CONSTANTS or name in calibration.names:
        return calibration.value(name)
    shaft, _, power = name.rstrip("]").partition("[")
    curve = calibration.model.curves[shaft]
    return float(curve.coefficients[[f"{p:g}" for p in curve.powers].index(power)])
