"""Points of a concealed campaign, their order and their times."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.grid import Configuration, OperatingPoints
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

POLE_PAIRS = ((5, 13), (7, 11))
"""Pole pairs of sun and ring of both stages; campaigns engage stage 1, a further test may ask for stage 2."""
RATIO = POLE_PAIRS[0][1] / POLE_PAIRS[0][0]
"""Speed of the sun per speed of the ring with stage 1 engaged, without its sign."""
SUN_RPM = (0, 60, 90, 120, 156, 312, 468, 624, 780, 936, 1092, 1248, 1404, 1560, 1716, 1872)
RING_RPM = (0, 60, 120, 180, 240, 300, 360, 420, 480, 540, 600, 660, 720)
ENGAGED_RPM = SUN_RPM[4:]
LOADS = (0.78, 1.17, 1.56, 1.95)
"""Ring torques asked for when engaged [N m]."""
REVERSED_FLOW = tuple((speed, load) for speed in (312, 780, 1248, 1872) for load in (0.78, 1.56, 1.95))
REVERSED_ROTATION = ((-156, -60), (-468, -240), (-780, -480), (-1248, -720), (-1872, -720), (-312, -360))
REPEATS_NEUTRAL, REPEATS_ENGAGED = 7, 3
ZERO_CHECKS = 5
ORDERS = ("random", "rising", "rising by ring", "falling", "blocks")
DWELL = (30.0, 50.0)
"""Time from one point to the next [s], least and most."""
PAUSE = (180.0, 420.0)
"""Longer pauses, between configurations and at a few other places [s]."""
FIRST_START, STARTS_WITHIN = 1.745e9, 2.5e7
"""Campaigns begin within that many seconds from there [s since 1970, UTC]."""


@dataclass(frozen=True)
class CampaignDesign:
    """A campaign as planned, in the order in which it is run.

    Parameters
    ----------
    at : OperatingPoints
        The points with their set-points as speeds and loads; the ring torque is the load asked for.
    order : str
        ``random``; ``rising`` (sun speed outside, ring speed inside) or ``rising by ring``; ``falling``, as the thesis
        ran its sweeps; ``blocks``: sun speeds shuffled, ring speeds up and down.
    extended : bool
        With repeats, reversed flow, reversed rotation and zero checks.
    one_way : bool
        No point with reversed power flow.
    """

    at: OperatingPoints
    order: str
    extended: bool
    one_way: bool

    @property
    def elapsed(self) -> Array:
        """Time since the first point [s]."""
        return np.asarray(self.at.started_at - self.at.started_at[0])


def draw_design(
    rng: np.random.Generator, *, order: str | None = None, extended: bool = True, one_way: bool = False
) -> CampaignDesign:
    """A campaign of 255 points, or up to 288 when extended, in the order named or a drawn one."""
    chosen = order or str(rng.choice(ORDERS))
    grid_sun, grid_ring = (axis.ravel() for axis in np.meshgrid(SUN_RPM, RING_RPM, indexing="ij"))
    moving = (grid_sun > 0) | (grid_ring > 0)
    neutral = _neutral(grid_sun[moving], grid_ring[moving])
    speed, load = (axis.ravel() for axis in np.meshgrid(np.array(ENGAGED_RPM, dtype=np.float64), LOADS, indexing="ij"))
    engaged = _engaged(speed, load)
    parts = [neutral[_order(neutral, chosen, rng)], engaged[_order(engaged, chosen, rng)]]
    if chosen == "random" and rng.random() < 0.3:
        parts.reverse()
    if extended:
        again = [
            part[np.sort(rng.choice(len(part), n, replace=False))]
            for part, n in ((neutral, REPEATS_NEUTRAL), (engaged, REPEATS_ENGAGED))
        ]
        parts += [_renamed(part[rng.permutation(len(part))], "_rep") for part in again]
        if not one_way:
            back = np.array(REVERSED_FLOW)
            parts.append(_engaged(back[:, 0], -back[:, 1], suffix="_rev", drive="ring"))
        turned = np.array(REVERSED_ROTATION)
        parts.append(_neutral(turned[:, 0], turned[:, 1], suffix="_neg"))
    whole = _joined(parts)
    if extended:
        whole = _with_zero_checks(whole)
    return CampaignDesign(replace(whole, started_at=_times(whole, rng)), chosen, extended, one_way)


def _order(at: OperatingPoints, order: str, rng: np.random.Generator) -> npt.NDArray[np.int64]:
    """Rows of a grid in the order in which they are run; the grid comes sorted by sun speed."""
    rows = np.arange(len(at))
    if order == "random":
        return rng.permutation(rows)
    if order == "falling":
        return rows[::-1]
    if order == "rising":
        return rows
    if order == "rising by ring":
        return np.lexsort((at.speed_sun, np.abs(at.speed_ring)))
    blocks = [rows[at.speed_sun == speed] for speed in rng.permutation(np.unique(at.speed_sun))]
    return np.concatenate([block[:: 1 if i % 2 else -1] for i, block in enumerate(blocks)])


def _times(at: OperatingPoints, rng: np.random.Generator) -> Array:
    """Start of each point [s since 1970, UTC]."""
    gaps = rng.uniform(*DWELL, len(at))
    working = np.where(at.zero, "", at.configuration)
    changed = np.zeros(len(at), dtype=bool)
    changed[1:] = (working[1:] != working[:-1]) & (working[1:] != "") & (working[:-1] != "")
    changed[rng.integers(1, len(at), rng.integers(0, 3))] = True
    gaps[changed] = rng.uniform(*PAUSE, int(changed.sum()))
    return np.round(FIRST_START + rng.uniform(0.0, STARTS_WITHIN) + np.cumsum(gaps), 6)


def _neutral(sun_rpm: npt.NDArray[np.int64], ring_rpm: npt.NDArray[np.int64], suffix: str = "") -> OperatingPoints:
    pairs = zip(sun_rpm, ring_rpm, strict=True)
    names = [f"N_s{sun:+05d}_r{ring:+04d}{suffix}" for sun, ring in pairs]
    sun, ring = (np.asarray(rpm, dtype=np.float64) * RPM for rpm in (sun_rpm, ring_rpm))
    return _points(names, Configuration.NEUTRAL, sun, ring, np.zeros(len(names)), "sun")


def _engaged(sun_rpm: Array, load: Array, suffix: str = "", drive: str = "sun") -> OperatingPoints:
    names = [f"E_s{round(s):+05d}_l{abs(t):.2f}{suffix}" for s, t in zip(sun_rpm, load, strict=True)]
    return _points(names, Configuration.ENGAGED, sun_rpm * RPM, -sun_rpm * RPM / RATIO, load, drive)


def _points(names: list[str], configuration: str, sun: Array, ring: Array, load: Array, drive: str) -> OperatingPoints:
    n = len(names)
    return OperatingPoints(
        name=np.array(names, dtype=np.str_),
        configuration=np.full(n, str(configuration)),
        gear=np.ones(n, dtype=np.int64),
        drive=np.full(n, drive),
        speed_sun=np.asarray(sun, dtype=np.float64),
        speed_ring=np.asarray(ring, dtype=np.float64),
        torque_ring=np.asarray(load, dtype=np.float64),
        load_set=np.asarray(load, dtype=np.float64),
        started_at=np.full(n, np.nan),
        rest_sun=np.asarray(sun == 0.0),
        rest_ring=np.asarray(ring == 0.0),
    )


def _renamed(at: OperatingPoints, suffix: str) -> OperatingPoints:
    return replace(at, name=np.array([f"{name}{suffix}" for name in at.name], dtype=np.str_))


def _joined(parts: list[OperatingPoints]) -> OperatingPoints:
    columns = OperatingPoints.__dataclass_fields__
    return OperatingPoints(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in columns})


def _with_zero_checks(at: OperatingPoints) -> OperatingPoints:
    """Zero checks first, last and evenly in between."""
    nothing = np.zeros(ZERO_CHECKS)
    checks = _points([f"Z_{i}" for i in range(ZERO_CHECKS)], Configuration.ZERO, nothing, nothing, nothing, "sun")
    pieces = np.array_split(np.arange(len(at)), ZERO_CHECKS - 1)
    parts = [part for i, piece in enumerate(pieces) for part in (checks[np.array([i])], at[piece])]
    return _joined([*parts, checks[np.array([ZERO_CHECKS - 1])]])


def ratio_of(at: OperatingPoints) -> Array:
    """Speed of the sun per speed of the ring in the stage of each point, without its sign."""
    (sun_1, ring_1), (sun_2, ring_2) = POLE_PAIRS
    return np.where(at.gear == 1, ring_1 / sun_1, ring_2 / sun_2)


def acting(at: OperatingPoints) -> tuple[Mask, Mask]:
    """Rows in which the reading of sun and ring tells a loss: moving in neutral, and the sun engaged."""
    return (at.neutral & ~at.rest_sun) | at.engaged, at.neutral & ~at.rest_ring
