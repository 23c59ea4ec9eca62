"""The analysis rehearsed: the points of a campaign with readings made up, to see how far the analysis would come."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.design.audit import audit_design
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.calibration import CONSTANTS, USUAL_CORRECTION
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.windows.steadiness import REST_SPEED
from pmg.sim.grid import Configuration, OperatingPoints
from pmg.sim.losscurve import SPEED_REFERENCE_RING, SPEED_REFERENCE_SUN, LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.design.audit import Audit
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.preflight.found import Asked
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid

SEED = 20260103
"""Seed of the noise of made-up readings."""

NOISE = 1e-3
"""Its standard deviation [N m], as a plan reckons with where it names none."""

TYPICAL = LossModel(
    LossCurve((0.0, 0.5, 1.0, 2.0), np.array([0.015, 0.092, 0.030, -0.004]), SPEED_REFERENCE_SUN, SPEED_REFERENCE_SUN),
    LossCurve((0.0, 0.5, 1.0, 2.0), np.array([0.050, 0.283, -0.051, 0.005]), *(2 * (SPEED_REFERENCE_RING,))),
    USUAL_CORRECTION,
    CONSTANTS["b"].typical,
    CONSTANTS["c"].typical,
    0.0,
)
"""Losses of the size that the thesis's neutral grids show: what is concluded depends on the points, not on these."""


def _operating_points(asked: Sequence[Asked]) -> OperatingPoints:
    """Test points as the analysis takes them; a set-point that is not named counts as zero."""

    def column(name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return np.array([getattr(p.setpoints, name) or 0.0 for p in asked], dtype=np.float64)

    configuration = np.array([p.configuration for p in asked], dtype=np.str_)
    speed_sun, speed_ring = column("speed_sun"), column("speed_ring")
    load = np.where(configuration == Configuration.ENGAGED, column("torque_ring"), 0.0)
    return OperatingPoints(
        name=np.array([p.point for p in asked], dtype=np.str_),
        configuration=configuration,
        gear=np.array([p.gear for p in asked], dtype=np.int64),
        drive=np.array([p.drive for p in asked], dtype=np.str_),
        speed_sun=speed_sun,
        speed_ring=speed_ring,
        torque_ring=load,
        load_set=load,
        started_at=np.array([p.started_at for p in asked], dtype=np.float64),
        rest_sun=np.abs(speed_sun) < REST_SPEED,
        rest_ring=np.abs(speed_ring) < REST_SPEED,
    )


def _made_up(asked: Sequence[Asked], bench: BenchParameters) -> Grid:
    """The points with torques of a typical bench and noise: seeded, so the same points give the same readings."""
    at = _operating_points(asked)
    simulated = steady(Gearbox.calibrated(bench, TYPICAL), at)
    rng, noise = np.random.default_rng(SEED), np.full(len(at), NOISE)
    torque_ring = simulated.torque_ring + NOISE * rng.standard_normal(len(at))
    return replace(
        simulated,
        origin="planned",
        campaign=asked[0].campaign if asked else "",
        points=replace(at, torque_ring=torque_ring),
        torque_sun=simulated.torque_sun + NOISE * rng.standard_normal(len(at)),
        torque_ring=torque_ring,
        within_sun=noise,
        within_ring=noise,
        u_sun=noise,
        u_ring=noise,
        accepted=np.array([p.accepted for p in asked], dtype=bool),
        reason=np.full(len(at), ""),
    )


def rehearse(asked: Sequence[Asked], bench: BenchParameters) -> Analysis:
    """Steps that the analysis of these points would reach; the others are in `Analysis.missing`."""
    return analyse(_made_up(asked, bench), AnalysisOptions(), bench)


def audit(analysis: Analysis, bench: BenchParameters) -> Audit | None:
    """Which mechanisms the points would tell apart; None where there is no baseline to take effects about."""
    if analysis.calibration is None or analysis.floor is None:
        return None
    return audit_design(analysis.grid, bench, analysis.calibration.model, analysis.floor)
