"""How steady torques and forward speeds move with the parameters of the mechanisms."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.sim.forward import ForwardSpeeds, torque_slope
from pmg.sim.losscurve import LossCurve
from pmg.sim.mechanisms.base import Torques, nothing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pmg.sim.gearbox import Gearbox
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.mechanisms import Mechanism
    from pmg.sim.signals import Array

_AFFINE = 1e-10
"""Bend over one span, relative to the torques, below which a law is taken as affine in a parameter."""

_SMALL = 1e-4
"""Span of the differences for other laws, relative to the parameter's typical value."""


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of steady torques, one column a parameter.

    Parameters
    ----------
    labels : tuple of str
        ``mechanism.parameter``; ``mechanism.curve[k]`` for coefficient k of a loss curve, under the first mechanism
        that uses it and counting all that do.
    torque_sun, torque_ring : (n, k) array
        Derivatives [N m per unit of the parameter].
    """

    labels: tuple[str, ...]
    torque_sun: Array
    torque_ring: Array


def steady_sensitivity(gearbox: Gearbox, at: OperatingPoints) -> Sensitivity:
    r"""Derivatives of the torques of `pmg.sim.solve.steady` to all parameters.

    Notes
    -----
    A difference quotient of a law that is affine in a parameter is its derivative, whatever the span; all laws of the
    baseline are. A law that bends gets central differences over a small span, inside its bounds. In the engaged gear
    :math:`\partial T_s = \partial\tau_r/i - \partial\tau_s` and the ring torque is given; in neutral
    :math:`\partial T_j = -\partial\tau_j`.
    """
    labels, rates = zip(*_rates(gearbox.mechanisms, at), strict=True) if gearbox.mechanisms else ((), ())
    shape = (len(at), len(labels))
    sun = np.stack([rate.sun for rate in rates], axis=-1) if rates else np.zeros(shape)
    ring = np.stack([rate.ring for rate in rates], axis=-1) if rates else np.zeros(shape)
    engaged = at.engaged[:, None]
    through = np.where(engaged, ring / gearbox.ratio(at)[:, None], 0.0)
    return Sensitivity(labels, through - sun, np.where(engaged, 0.0, -ring))


def forward_sensitivity(gearbox: Gearbox, found: ForwardSpeeds) -> Array:
    r"""Derivatives of the forward sun speeds to all parameters [rad/s per unit], (n, k) in the order of the above.

    Notes
    -----
    Both torques are given, so :math:`\partial\omega_s/\partial p = -(\partial T_s/\partial p)/(\partial T_s/\partial
    \omega_s)`. It grows without bound where the drag stops rising.
    """
    return np.asarray(
        -steady_sensitivity(gearbox, found.points).torque_sun / torque_slope(gearbox, found.points)[:, None]
    )


def _rates(mechanisms: tuple[Mechanism, ...], at: OperatingPoints) -> Iterator[tuple[str, Torques]]:
    curves: dict[int, tuple[str, LossCurve]] = {}
    for mechanism in mechanisms:
        for known in mechanism.parameters():
            value, (low, high) = float(getattr(mechanism, known.name)), known.bounds

            def law(number: float, mechanism: Mechanism = mechanism, name: str = known.name) -> Torques:
                return replace(mechanism, **{name: number}).torque(at)

            span = abs(known.typical)
            yield f"{mechanism.identifier}.{known.name}", _rate(law, value, span, low, high)
        for name, curve in _curves(mechanism):
            curves.setdefault(id(curve), (f"{mechanism.identifier}.{name}", curve))
    for label, curve in curves.values():
        for k in range(len(curve.coefficients)):
            yield f"{label}[{k}]", _curve_rate(mechanisms, curve, k, at)


def _rate(law: Callable[[float], Torques], value: float, span: float, low: float, high: float) -> Torques:
    left, right = max(low, value - span), min(high, value + span)
    first, middle, last = (law(number) for number in (left, 0.5 * (left + right), right))
    bend = max(float(np.abs(a + c - 2.0 * b).max(initial=0.0)) for a, b, c in _sides(first, middle, last))
    size = max(float(np.abs(part).max(initial=0.0)) for triple in _sides(first, middle, last) for part in triple)
    if bend > _AFFINE * size:
        left, right = max(low, value - _SMALL * span), min(high, value + _SMALL * span)
        first, last = law(left), law(right)
    return Torques((last.sun - first.sun) / (right - left), (last.ring - first.ring) / (right - left))


def _sides(*torques: Torques) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    return tuple(part.sun for part in torques), tuple(part.ring for part in torques)


def _curves(mechanism: Mechanism) -> Iterator[tuple[str, LossCurve]]:
    for field in fields(mechanism):
        curve: Any = getattr(mechanism, field.name)
        if isinstance(curve, LossCurve):
            yield field.name, curve


def _curve_rate(mechanisms: tuple[Mechanism, ...], curve: LossCurve, k: int, at: OperatingPoints) -> Torques:
    """Torques are linear in a curve: the rate is that of the curve with coefficient k alone."""
    unit = replace(curve, coefficients=np.eye(len(curve.coefficients))[k])
    total = Torques(nothing(at), nothing(at))
    for mechanism in mechanisms:
        used = [name for name, each in _curves(mechanism) if each is curve]
        if used:
            none = {name: replace(each, coefficients=0.0 * each.coefficients) for name, each in _curves(mechanism)}
            alone = replace(mechanism, **{**none, **dict.fromkeys(used, unit)})
            rest = replace(mechanism, **none)
            plus, minus = alone.torque(at), rest.torque(at)
            total = total + Torques(plus.sun - minus.sun, plus.ring - minus.ring)
    return total
