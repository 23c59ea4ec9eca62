"""A campaign as evidence: its whitened readings, what they may follow, and synthetic campaigns."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.engine.evidence import Evidence
from pmg.pipeline.diagnosis.grid.swings import swings
from pmg.pipeline.fit.noise_floor import repeat_contrasts
from pmg.pipeline.fit.structure import families
from pmg.pipeline.fit.whitening import synthetic_noise, undo

if TYPE_CHECKING:
    import numpy as np

    from pmg.pipeline.diagnosis.grid.candidates import GridProblem
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.fit.structure import ResidualStructure
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.signals import Array, Mask


def broad_and_narrow(problem: GridProblem) -> tuple[tuple[ResidualStructure, ...], tuple[ResidualStructure, ...]]:
    """Smooth structure over the covariates, and the swings in time that are looked at one by one."""
    return families(problem.readings, problem.bench, problem.model), swings(problem.readings)


def both_shafts(readings: Readings) -> tuple[Mask, Mask]:
    """Readings of the sun's transducer, and of the ring's."""
    return readings.sun, ~readings.sun


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
    groups = both_shafts(readings)
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
