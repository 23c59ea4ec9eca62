"""A campaign as evidence: its whitened readings, what they may follow, and synthetic campaigns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.evidence import Evidence
from pmg.pipeline.fit.noise_floor import repeat_contrasts
from pmg.pipeline.fit.structure import ResidualStructure, families
from pmg.pipeline.fit.whitening import synthetic_noise, undo
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.candidates import GridProblem
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.signals import Array


SLOWEST = 3
"""Periods in the campaign of the slowest swing; slower ones are trends."""

FASTEST = 36
"""Periods in the campaign of the fastest swing, as far as each holds `POINTS` points."""

POINTS = 4
"""Points in the shortest period."""


def swings(readings: Readings) -> tuple[ResidualStructure, ...]:
    """Sine and cosine of the time of the test, period by period and shaft by shaft; none where it is not known.

    A room's heating, a supply or an amplifier that cycles moves a reading this way whatever the bench does. Each
    period is looked at by itself: together they would leave nothing to tell the noise by.
    """
    at = readings.grid.points
    if not at.ordered:
        return ()
    time = np.asarray(at.started_at[readings.row])
    whole = float(np.ptp(time))
    if whole <= 0.0:
        return ()
    turns = (time - time.min()) / whole
    found = []
    for shaft, mine in readings.of_shaft.items():
        fastest = min(FASTEST, int(mine.sum()) // POINTS)
        for k in range(SLOWEST, fastest + 1):
            angle = REVOLUTION * k * turns
            columns = np.where(mine[:, None], np.c_[np.cos(angle), np.sin(angle)], 0.0)
            found.append(ResidualStructure(f"torque_{shaft}", "all", ("order", f"period_{whole / k:.0f}_s"), columns))
    return tuple(found)


def broad_and_narrow(problem: GridProblem) -> tuple[tuple[ResidualStructure, ...], tuple[ResidualStructure, ...]]:
    """Smooth structure over the covariates, and the swings in time that are looked at one by one."""
    return families(problem.readings, problem.bench, problem.model), swings(problem.readings)


def campaign_evidence(
    problem: GridProblem, floor: NoiseFloor, draws: int, rng: np.random.Generator, own: list[Array] | None = None
) -> Evidence:
    """The evidence of a campaign.

    Parameters
    ----------
    problem : GridProblem
        Its readings about the calibrated baseline.
    floor : NoiseFloor
        Their noise.
    draws : int
        Synthetic campaigns.
    rng : numpy.random.Generator
        Draws them.
    own : list of (m, c) array, optional
        Whitened traces of mechanisms, looked for beside the smooth families.
    """
    readings, white = problem.readings, problem.white
    smooth, narrow = broad_and_narrow(problem)
    repeats, ordinary = repeat_contrasts(readings), readings.configuration != "engaged"
    groups = tuple(readings.of_shaft)
    fitted = readings.torque - undo(white, problem.left)
    return Evidence(
        y=white((readings.torque - problem.predicted)[:, None])[:, 0],
        baseline=white(problem.columns),
        families=[*(white(f.columns) for f in smooth), *(own or ()), *(white(f.columns) for f in narrow)],
        groups=groups,
        null=synthetic_noise(readings, floor, white, draws, rng, fitted=fitted),
        contrasts=tuple(repeats[:, (repeats[mine & ordinary] != 0.0).any(axis=0)] for mine in groups),
        narrow=len(narrow),
        single_rows=True,
    )
