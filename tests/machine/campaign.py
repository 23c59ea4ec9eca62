"""A campaign of a gear that is not the thesis's, with known losses, as recordings."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
from tests.points import joined, points

from pmg.pipeline.recording.write import SimulatedRun, rated_calibration, recording_bytes
from pmg.sim.grid import Configuration, Grid
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.signals import RPM
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.sim.bench import BenchParameters

CORRECTION = 0.85
CURVE = LossCurve((0.0, 0.5, 1.0), np.array([0.02, 0.09, 0.03]), 150.0, 200.0)
SUN_RPM, RING_RPM, LOADS = (150.0, 450.0, 900.0, 1350.0, 1800.0), (60.0, 200.0, 400.0, 680.0), (3.0, 8.0)


def truth_of(bench: BenchParameters) -> Grid:
    """Neutral and engaged points and zero checks of a machine, with their exact torques."""
    sun, ring = (axis.ravel() for axis in np.meshgrid((0.0, *SUN_RPM), (0.0, *RING_RPM), indexing="ij"))
    turning = (sun > 0.0) | (ring > 0.0)
    speed, load = (axis.ravel() for axis in np.meshgrid(SUN_RPM, LOADS, indexing="ij"))
    whole = joined(
        points("zero", np.zeros(2), np.zeros(2)),
        points("neutral", sun[turning], ring[turning]),
        points("engaged", speed, -speed / bench.gear1.ratio, load, load_set=load),
        points("zero", np.zeros(2), np.zeros(2)),
    )
    whole = replace(whole, started_at=np.linspace(1.7e9, 1.7e9 + 30.0 * len(whole), len(whole)))
    box = Gearbox.calibrated(bench, LossModel(CURVE, CURVE, CORRECTION, 2e-2, 2.2e-4, 0.0))
    return steady(box, whole, "other gear")


def write_campaign(grid: Grid, bench: BenchParameters, folder: Path, gear: int = 1) -> None:
    """The recordings of a campaign: 2 s of each point, with noise of 2 mN m, and 0.3 mN m from point to point."""
    folder.mkdir()
    at, rng, n = grid.points, np.random.default_rng(5), 600
    time = np.arange(n) / 300.0
    for i in range(len(at)):
        torque = [t + 3e-4 * rng.standard_normal() + 2e-3 * rng.standard_normal(n) for t in _torques(grid, i)]
        run = SimulatedRun(
            campaign="other gear",
            point=str(at.name[i]),
            configuration=Configuration(str(at.configuration[i])),
            gear=gear,
            started_at=datetime.fromtimestamp(float(at.started_at[i]), tz=UTC),
            drive="sun",
            rate=300.0,
            torque_sun=torque[0],
            torque_ring=torque[1],
            angle_sun=at.speed_sun[i] * time,
            angle_ring=at.speed_ring[i] * time,
            setpoints={
                "sun_speed_set_rpm": round(float(at.speed_sun[i] / RPM), 6),
                "ring_speed_set_rpm": round(float(at.speed_ring[i] / RPM), 6),
                "ring_torque_set_Nm": float(at.load_set[i]),
            },
        )
        (folder / f"{i:03d}.mcap").write_bytes(recording_bytes(run, rated_calibration(bench)))


def _torques(grid: Grid, i: int) -> tuple[float, float]:
    return float(grid.torque_sun[i]), float(grid.torque_ring[i])
