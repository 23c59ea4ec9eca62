"""The torque map that the published pull-out torques imply."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import BenchError
from pmg.sim.maps.torque_map import TorqueMap

if TYPE_CHECKING:
    from pmg.sim.bench import GearParameters


@dataclass(frozen=True)
class Cogging:
    """Pull of the bare iron poles on one rotor.

    Parameters
    ----------
    amplitude : float
        Torque amplitude [N m].
    order : int or None
        Periods a turn against the carrier; None for the least common multiple of the magnets and the iron poles.
    """

    amplitude: float
    order: int | None = None


def analytic_map(
    gear: GearParameters,
    scale: float = 1.0,
    harmonics: dict[int, float] | None = None,
    cogging_sun: Cogging | None = None,
    cogging_ring: Cogging | None = None,
) -> TorqueMap:
    r"""The map that the published pull-out torques imply.

    Parameters
    ----------
    gear : GearParameters
        Pole pairs and pull-out torques.
    scale : float
        Factor on all torques.
    harmonics : dict of int to float
        Order in the phase, from 2, and torque amplitude relative to the fundamental. The pull-out stays as published.
    cogging_sun, cogging_ring : Cogging
        Pull of the iron poles on each rotor; absent by default, as the source gives none.

    Notes
    -----
    :math:`W = -\hat W\cos\varphi` has pull-outs :math:`p_s\hat W, p_r\hat W, Q\hat W`. The three published values are
    rounded to 0.01 N m; :math:`\hat W` is their least-squares value,
    :math:`\sum p_j\hat T_j/\sum p_j^2`, and meets all three within rounding. The source draws the maps but prints no
    more than their peaks, so the sine is an assumption.
    """
    p_s, p_r = round(gear.pole_pairs_sun), round(gear.pole_pairs_ring)
    poles = np.array([p_s, p_r, p_s + p_r], dtype=np.float64)
    peaks = np.array([gear.pull_out_torque_sun, gear.pull_out_torque_ring, gear.pull_out_torque_carrier], dtype=float)
    peak = float(poles @ peaks / (poles @ poles))
    shape = {1: 1.0, **(harmonics or {})}
    for order, share in shape.items():
        if order < 1 or order != int(order) or not math.isfinite(share) or (order == 1 and share != 1.0):
            raise BenchError(
                "harmonics", f"{{{order}: {share}}}", "orders from 2 and finite shares", "Correct the entry."
            )
    orders = np.array(list(shape), dtype=np.int64)
    cosine = -np.array([share / order for order, share in shape.items()])
    zeros = np.zeros(len(orders))
    plain = TorqueMap(p_s, p_r, p_s * orders, p_r * orders, cosine, zeros, "analytic map")
    coupling = plain.scaled(p_s * peak / plain.pull_out.torque_high)
    m, n, a = [coupling.orders_sun], [coupling.orders_ring], [coupling.cosine]
    for cogging, pairs, on_sun in ((cogging_sun, p_s, 1), (cogging_ring, p_r, 0)):
        if cogging is None:
            continue
        order = math.lcm(2 * pairs, p_s + p_r) if cogging.order is None else cogging.order
        if order < 1 or not math.isfinite(cogging.amplitude):
            raise BenchError("cogging", f"{cogging}", "an order from 1 and a finite amplitude", "Correct the entry.")
        m.append(np.array([order * on_sun]))
        n.append(np.array([order * (1 - on_sun)]))
        a.append(np.array([-cogging.amplitude / order]))
    cosines = np.concatenate(a)
    whole = replace(
        coupling,
        orders_sun=np.concatenate(m),
        orders_ring=np.concatenate(n),
        cosine=cosines,
        sine=np.zeros(len(cosines)),
    )
    return whole.scaled(scale)
