"""The constants of a bench fitted to its runs in motion, in the noise that the runs themselves show."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.motion.baseline import start_baseline
from pmg.pipeline.diagnosis.motion.beside import fit_beside
from pmg.pipeline.diagnosis.motion.constants import sheet_of
from pmg.pipeline.diagnosis.motion.noise import row_noise, slow_noise_of
from pmg.pipeline.diagnosis.motion.rows import stretches_of
from pmg.pipeline.motion.smooth import smooth
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.noise import RowNoise
    from pmg.pipeline.motion.run import MovingRun
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array


def fit_constants(runs: tuple[MovingRun, ...], bench: BenchParameters) -> tuple[MotionBaseline, Array, list[RowNoise]]:
    """The baseline of some runs, the covariance (k, k) of its constants, and the noise of each stretch.

    Wander and ripple are what the residuals of a first fit show.
    """
    start = _start(runs, bench)
    noise = [row_noise(start, place) for place in range(len(start.stretches))]
    rough, _ = fit_beside(start, noise, ())
    slow_noise = slow_noise_of(rough, noise)
    noise = [row_noise(rough, place, slow_noise) for place in range(len(start.stretches))]
    before, covariance = fit_beside(rough, noise, ())
    return before, covariance, noise


def _start(runs: tuple[MovingRun, ...], bench: BenchParameters) -> MotionBaseline:
    gears = {run.gear for run in runs if run.manoeuvre.moves}
    if len(gears) != 1:
        came = ", ".join(f"gear {gear}" for gear in sorted(gears)) or "no run"
        raise FitError("diagnosis in motion", came, "runs of one gear", "Diagnose each gear by itself.")
    smoothed = tuple(smooth(run) for run in runs)
    sheet = sheet_of(bench, gears.pop(), tuple(run.name for run in runs if run.coupled))
    return start_baseline(sheet, stretches_of(smoothed))
