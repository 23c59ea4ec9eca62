"""What the benchmarks run: the published grid's highest load from rest with a swing, and all 48 points."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pmg.pipeline.fit.loss_fit import THESIS_POWERS_RING, THESIS_POWERS_SUN, fit_losses
from pmg.pipeline.grid.tables import read_published
from pmg.sim.bench import load_bench
from pmg.sim.dynamics.assumptions import Assumptions
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.programme import Programme
from pmg.sim.dynamics.state import STATES
from pmg.sim.dynamics.transient import Task
from pmg.sim.lossmodel import LossModel
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

PUBLISHED = Path(__file__).resolve().parent.parent.parent / "raw" / "published"
START_PHASE = 2.0
EQUAL_ERROR = 1e-4
"""Error over the whole run, relative to the highest speed, at which solvers are compared."""

SPEEDS = [STATES.index(name) for name in ("speed_sun", "speed_ring")]


@dataclass(frozen=True)
class Timed:
    """What a call gave, its wall time and the processor time of all threads [s]."""

    value: object
    wall: float
    cpu: float


def timed(call: Callable[[], object], repeats: int = 1) -> Timed:
    """The quickest of some calls."""
    best: Timed | None = None
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        value = call()
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        if best is None or wall < best.wall:
            best = Timed(value, wall, cpu)
    assert best is not None
    return best


@cache
def steady_grid() -> tuple[Gearbox, Grid]:
    """The 48 published points with the torques that hold them."""
    bench = load_bench()
    grid = read_published(PUBLISHED, bench)
    fits = fit_losses(grid, THESIS_POWERS_SUN, THESIS_POWERS_RING, include_rest=True)
    gearbox = Gearbox.calibrated(bench, LossModel(fits.sun.curve, fits.ring.curve, 0.80, 0.0, 2.22e-4, 0.0))
    at = grid.points[grid.points.engaged]
    table = pd.read_csv(PUBLISHED / "engaged_grid.csv")
    at = replace(at, torque_ring=table.ring_torque_simulation_input_Nm.to_numpy())
    return gearbox, steady(gearbox, at)


@cache
def drivetrain() -> Drivetrain:
    """The bench, engaged, with the losses of the published tables, from a swing at rest."""
    gearbox, _ = steady_grid()
    return Drivetrain(load_bench(), gearbox.mechanisms, Assumptions(start_phase=START_PHASE))


def programmes(i: int) -> tuple[Programme, Programme]:
    """Ramps of one second to the torques of a point."""
    grid = steady_grid()[1]
    torques = float(grid.torque_sun[i]), float(grid.points.torque_ring[i])
    return Programme.ramp(torques[0], 1.0), Programme.ramp(torques[1], 1.0)


def tasks(count: int, duration: float, outputs: int) -> list[Task]:
    """Runs of the points, again and again up to a count."""
    times = np.linspace(0.0, duration, outputs)
    return [Task(drivetrain(), *programmes(i % 48), duration, times=times) for i in range(count)]


def error(found: Array, exact: Array) -> float:
    """Largest error of the speeds over a run, relative to the largest speed."""
    return float(np.abs(found - exact).max() / np.abs(exact).max())
