"""Operating points and grids made by hand, for tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pmg.sim.grid import Grid, OperatingPoints
from pmg.sim.signals import RPM, Array


def points(
    configuration: str,
    sun_rpm: Array | list[float],
    ring_rpm: Array | list[float],
    torque_ring: Array | list[float] | float = 0.0,
    *,
    gear: int = 1,
    drive: str = "sun",
    load_set: Array | float = 0.0,
    started_at: Array | None = None,
) -> OperatingPoints:
    sun, ring = np.asarray(sun_rpm, dtype=float) * RPM, np.asarray(ring_rpm, dtype=float) * RPM
    n = len(sun)
    return OperatingPoints(
        name=np.array([f"P{i}" for i in range(n)], dtype=np.str_),
        configuration=np.full(n, configuration),
        gear=np.full(n, gear),
        drive=np.full(n, drive),
        speed_sun=sun,
        speed_ring=ring,
        torque_ring=np.broadcast_to(np.asarray(torque_ring, dtype=float), (n,)).copy(),
        load_set=np.broadcast_to(np.asarray(load_set, dtype=float), (n,)).copy(),
        started_at=np.full(n, np.nan) if started_at is None else started_at,
        rest_sun=sun == 0.0,
        rest_ring=ring == 0.0,
    )


def joined(*parts: OperatingPoints) -> OperatingPoints:
    columns = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in OperatingPoints.__dataclass_fields__
    }
    columns["name"] = np.array([f"P{i}" for i in range(len(columns["name"]))], dtype=np.str_)
    return OperatingPoints(**columns)


def measured(at: OperatingPoints, torque_sun: Array, torque_ring: Array, u: float = 1e-3) -> Grid:
    n = len(at)
    same = np.full(n, u)
    return Grid(
        origin="measured",
        campaign="made up",
        points=replace(at, torque_ring=torque_ring),
        torque_sun=torque_sun,
        torque_ring=torque_ring,
        within_sun=same,
        within_ring=same,
        u_sun=same,
        u_ring=same,
        common_sun=np.zeros(n),
        common_ring=np.zeros(n),
        accepted=np.ones(n, dtype=bool),
        reason=np.full(n, ""),
    )
