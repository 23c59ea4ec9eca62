"""Where the moving bench comes to rest at some set-points, with and without mechanisms, next to the measurement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.constants import Control
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.equilibrium import equilibrium
from pmg.sim.dynamics.state import SetPoints
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms import Instrument, Torques
from pmg.sim.mechanisms.instruments import distorted
from pmg.sim.mechanisms.warmth import warmth_at
from pmg.sim.shafts import SIDES
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import true_load

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid, OperatingPoints
    from pmg.sim.mechanisms import Mechanism
    from pmg.sim.signals import Array, Mask


@dataclass(frozen=True)
class SteadyEnd:
    """A torque where the moving bench comes to rest.

    Parameters
    ----------
    point, configuration, shaft : str
        Set-point and transducer.
    measured, u : float
        Reading and its standard uncertainty [N m].
    before, after : float
        What the moving bench shows without and with the mechanisms [N m].
    """

    point: str
    configuration: str
    shaft: str
    measured: float
    u: float
    before: float
    after: float


def extreme_steady_points(
    grid: Grid, bench: BenchParameters, before: tuple[Mechanism, ...], after: tuple[Mechanism, ...]
) -> tuple[SteadyEnd, ...]:
    """Steady ends at set-points spread over the grid: slow and fast in neutral, light and heavy when engaged.

    Parameters
    ----------
    grid : Grid
        Measured grid.
    bench : BenchParameters
        The bench.
    before, after : tuple of Mechanism
        What acts, baseline included.

    Notes
    -----
    The states of the whole drivetrain that do not change, by Newton's method: what a run in time would end at. The
    warmth of each point is that of the campaign's history.
    """
    rows = _spread_over(grid)
    ends: list[SteadyEnd] = []
    shown = [_torques_at_rest(grid.points, rows, bench, mechanisms) for mechanisms in (before, after)]
    for i, row in enumerate(rows):
        neutral = bool(grid.points.neutral[row])
        ends += [
            SteadyEnd(
                str(grid.points.name[row]),
                str(grid.points.configuration[row]),
                shaft,
                float(getattr(grid, f"torque_{shaft}")[row]),
                float(getattr(grid, f"u_{shaft}")[row]),
                *(float(getattr(found, shaft)[i]) for found in shown),
            )
            for shaft in (SIDES if neutral else ("sun",))
        ]
    return tuple(ends)


def _spread_over(grid: Grid) -> npt.NDArray[np.int64]:
    """Rows of set-points at the ends of what was run: two in neutral and two engaged, as far as there are."""
    at = grid.points
    power = np.abs(at.speed_sun) * np.maximum(np.abs(at.torque_ring), 1e-3)
    speeds = np.minimum(np.abs(at.speed_sun), np.abs(at.speed_ring))
    turning = grid.accepted & ~at.rest_sun & ~at.rest_ring
    return np.array([*_ends(speeds, turning & at.neutral), *_ends(power, turning & at.engaged)], dtype=np.int64)


def _ends(size: Array, rows: Mask) -> list[int]:
    chosen = np.flatnonzero(rows)
    if not len(chosen):
        return []
    order = chosen[np.argsort(size[chosen], kind="stable")]
    return list(dict.fromkeys((int(order[0]), int(order[-1]))))


def _torques_at_rest(
    at: OperatingPoints, rows: npt.NDArray[np.int64], bench: BenchParameters, mechanisms: tuple[Mechanism, ...]
) -> Torques:
    """Steady readings of the transducers at those rows [N m]."""
    gearbox = Gearbox(bench, mechanisms)
    faults = tuple(mechanism for mechanism in mechanisms if isinstance(mechanism, Instrument))
    load = true_load(gearbox, at) if faults else at.torque_ring
    loaded = replace(at, torque_ring=load)
    warm = warmth_at(mechanisms, at)
    sun, ring = np.zeros(len(at)), np.zeros(len(at))
    for row in rows:
        neutral = bool(at.neutral[row])
        train = Drivetrain(
            bench,
            mechanisms,
            gear=int(at.gear[row]),
            configuration=Configuration(at.configuration[row]),
            control_sun=Control.SPEED,
            control_ring=Control.SPEED if neutral else Control.TORQUE,
            warmth=warm[row],
        )
        asked = SetPoints(at.speed_sun[row], at.speed_ring[row] if neutral else load[row])
        state = equilibrium(train, asked.sun, asked.ring).state
        moved = train.motion(state, asked)
        sun[row], ring[row] = float(moved.sun.torque_out[0]), float(moved.ring.torque_out[0])
    error_sun, error_ring = distorted(faults, loaded, Torques(sun, ring))
    return Torques((sun + error_sun)[rows], (ring + error_ring)[rows])
