"""The locked speed that given motor torques hold: the steady balance, solved for speed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import BenchError
from pmg.sim.losscurve import SPEED_REFERENCE_SUN
from pmg.sim.roots import ROUNDING, rising_root

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.grid import OperatingPoints
    from pmg.sim.maps.torque_map import TorqueMap
    from pmg.sim.signals import Array
    from pmg.sim.steady.gearbox import Gearbox

SPEED_LIMIT = 2.0 * SPEED_REFERENCE_SUN
"""Highest sun speed that is searched by default [rad/s]: twice that of the published campaign."""

_SCAN = 24
"""Steps of the scan that brackets the roots; they widen with speed, where the drag bends less."""

_CREEP = 1e-6
"""Speed at which the drag at rest is read [rad/s]; the mechanisms leave friction of a resting shaft out."""

_STEP = 6e-6
"""Relative step of central differences in speed: the cube root of the rounding, where both errors balance."""


@dataclass(frozen=True)
class ForwardSpeeds:
    """Speeds at which given torques balance the drag.

    Parameters
    ----------
    points : OperatingPoints
        The points with their speeds; the gear is locked and the carrier at rest.
    slope : (n,) array
        Slope of the balancing sun torque with the sun's speed [N m s/rad]; positive: the speed is stable.
    balances : (n,) array of int
        Balances that the scan found up to the limit. One where drag grows with speed; else the speed given is
        the first, which is the one reached from rest.
    """

    points: OperatingPoints
    slope: Array
    balances: npt.NDArray[np.int64]


def _locked(gearbox: Gearbox, at: OperatingPoints, speed_sun: Array) -> OperatingPoints:
    """The points at other sun speeds [rad/s], the ring following through the gear, carrier at rest."""
    turning = speed_sun != 0.0
    return replace(
        at, speed_sun=speed_sun, speed_ring=-speed_sun / gearbox.ratio(at), rest_sun=~turning, rest_ring=~turning
    )


def _balancing_torque(gearbox: Gearbox, at: OperatingPoints) -> Array:
    """Sun torque that holds each engaged point at its speed [N m]; the balance of `pmg.sim.steady.solve.steady`."""
    drag = gearbox.torque(at)
    return np.asarray((at.torque_ring + drag.ring) / gearbox.ratio(at) - drag.sun)


def _pairs(n: int, copies: int) -> npt.NDArray[np.int64]:
    return np.tile(np.arange(n), copies)


def forward(
    gearbox: Gearbox,
    at: OperatingPoints,
    torque_sun: Array,
    speed_limit: float = SPEED_LIMIT,
    maps: dict[int, TorqueMap] | None = None,
) -> ForwardSpeeds:
    r"""Speeds that the given torques of both motors hold; the inverse of `pmg.sim.steady.solve.steady`.

    Parameters
    ----------
    gearbox : Gearbox
        The model.
    at : OperatingPoints
        Engaged points with their ring torques [N m]; their speeds are not read.
    torque_sun : (n,) array
        Torques of the sun motor [N m].
    speed_limit : float
        Highest sun speed to search [rad/s].
    maps : dict of int to TorqueMap
        Maps of the gears; where given, the torque through the coupling must stay below pull-out.

    Raises
    ------
    BenchError
        When a point is not engaged, stalls, finds no balance below the limit, or would slip.

    Notes
    -----
    The torques turn the gear towards the sign of :math:`T_s - T_r/i`. Against that stands the drag
    :math:`D(\omega) = |T_s(\omega) - T_r/i|`, and the speed is where both are equal. Below the drag at rest the gear
    stalls, even where a drag that falls with speed would let it go on once it turned. Above, the first balance
    met from rest is one where drag overtakes torque: it rises there, so it is stable. Where drag grows with speed it
    is the only one. Balances closer together than a step of the scan can go uncounted.
    """
    if not at.engaged.all():
        name = at.name[~at.engaged][0]
        raise BenchError(f"forward speed of {name}", "not engaged", "engaged points", "Choose those rows.")
    given = np.asarray(torque_sun, dtype=np.float64)
    n = len(at)
    if given.shape != (n,) or not (np.isfinite(given).all() and np.isfinite(at.torque_ring).all()):
        raise BenchError(
            "forward speed: torques", f"{given.shape}, some not finite or missing", f"{n} finite", "Check."
        )
    net = given - at.torque_ring / gearbox.ratio(at)
    way = np.where(net < 0.0, -1.0, 1.0)
    speeds = np.concatenate([[_CREEP], speed_limit * (np.arange(1, _SCAN + 1) / _SCAN) ** 1.5])
    tiled = at[_pairs(n, len(speeds))]
    torque = _balancing_torque(gearbox, _locked(gearbox, tiled, np.multiply.outer(speeds, way).ravel()))
    excess = way * (torque.reshape(len(speeds), n) - given)
    _refuse_stall(at, net, excess, speed_limit)
    over = excess >= 0.0
    first = np.argmax(over, axis=0)
    below, above = (excess[rows, np.arange(n)] for rows in (first - 1, first))
    low, high = speeds[first - 1], speeds[first]
    thrice = at[_pairs(n, 3)]

    def missing(magnitude: Array) -> tuple[Array, Array]:
        step = _STEP * magnitude
        speed = np.concatenate([way * magnitude, way * (magnitude - step), way * (magnitude + step)])
        here, left, right = _balancing_torque(gearbox, _locked(gearbox, thrice, speed)).reshape(3, n)
        return way * (here - given), way * (right - left) / (2.0 * step)

    secant = low - below * (high - low) / (above - below)
    rounding = 0.5 * ROUNDING * (np.abs(given) + np.abs(at.torque_ring))
    magnitude, slope = rising_root(missing, low, high, secant, rounding)
    points = _locked(gearbox, at, way * magnitude)
    _refuse_slip(gearbox, points, maps or {})
    return ForwardSpeeds(points, slope, np.count_nonzero(over[1:] != over[:-1], axis=0))


def _refuse_stall(at: OperatingPoints, net: Array, excess: Array, speed_limit: float) -> None:
    stalled = excess[0] >= 0.0
    if stalled.any():
        i = int(np.flatnonzero(stalled)[0])
        raise BenchError(
            f"forward speed of {at.name[i]}",
            f"the motors leave {abs(net[i]):.6g} N m on the sun, the gear stalls",
            f"more than its drag at rest, {abs(net[i]) + excess[0, i]:.6g} N m",
            "Raise the driving torque, or lower the load.",
        )
    endless = (excess < 0.0).all(axis=0)
    if endless.any():
        i = int(np.flatnonzero(endless)[0])
        raise BenchError(
            f"forward speed of {at.name[i]}",
            f"the motors leave {abs(net[i]):.6g} N m on the sun, above the drag up to {speed_limit:.6g} rad/s",
            f"{abs(net[i]) + excess[-1, i]:.6g} N m or less for a speed below that limit",
            "Lower the driving torque, raise the load, or raise the limit if the loss curves reach that far.",
        )


def _refuse_slip(gearbox: Gearbox, points: OperatingPoints, maps: dict[int, TorqueMap]) -> None:
    if not maps:
        return
    through = gearbox.transmitted(points)
    for number, torque_map in maps.items():
        limits = torque_map.pull_out
        beyond = (points.gear == number) & ((through <= limits.torque_low) | (through >= limits.torque_high))
        if beyond.any():
            i = int(np.flatnonzero(beyond)[0])
            raise BenchError(
                f"load of {points.name[i]}",
                f"{through[i]:.6g} N m through the coupling of gear {number}, measured on the sun",
                f"between {limits.torque_low:.6g} and {limits.torque_high:.6g} N m, its pull-out",
                "Lower both torques.",
            )
