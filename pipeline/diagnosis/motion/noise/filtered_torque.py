"""Torques whose noise went through a low-pass, as of an amplifier: it is denser in the band of the rows than above."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.motion.smooth import BAND, above_band, bridged
from pmg.pipeline.motion.torque_noise import band_density, fall_above, white_density
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.errors import FitError
from pmg.sim.shafts import per_shaft

if TYPE_CHECKING:
    from pmg.pipeline.motion.smooth import SmoothRun, SmoothShaft

EVEN = 1.5
"""Density in the band over that above it, or the other way round, up to which noise passes for white. White noise in
three zero checks of 6 s shows 0.9 to 1.2."""

FALLS = 6.0
"""Fall of the density over the frequencies above the band from which on noise is not white: a low-pass of 250 Hz makes
it fall by as much in a record of 1000 samples a second."""


def with_noise_of_band(runs: tuple[SmoothRun, ...]) -> tuple[SmoothRun, ...]:
    """The runs with the noise of each torque as dense as it is in the band of the rows, as zero checks show.

    Notes
    -----
    The noise of a run in motion shows above the band alone, where it was told. Behind a low-pass of 100 Hz it is a
    hundred times denser in the band; what is freed from noise by too small a density shows the noise as a cause.

    Raises
    ------
    FitError
        The noise of a torque falls above the band, and no zero check shows what it is in the band.
    """
    denser = per_shaft(lambda side: _denser(runs, side))

    def in_band(run: SmoothRun, side: str) -> SmoothShaft:
        return replace(run.shafts[side], density=denser[side] * run.shafts[side].density)

    return tuple(replace(run, shafts=per_shaft(partial(in_band, run))) for run in runs)


def _denser(runs: tuple[SmoothRun, ...], side: str) -> float:
    """Density of the noise of a torque in the band over that above it; 1 where it passes for white."""
    checks = [run.run for run in runs if run.run.manoeuvre is Manoeuvre.ZERO and len(run)]
    if not checks:
        falls = [fall_above(bridged(run.run.torque[side]), run.run.rate, above_band) for run in runs]
        if (fall := float(np.median(falls))) > FALLS:
            came = f"noise falling {fall:.0f} times above {3.0 * BAND:.0f} Hz, as behind a low-pass, and no zero check"
            expected = "a zero check, which shows the noise of the torque where the runs move"
            raise FitError(f"torque of the {side}", came, expected, "Record one with both drives off, 6 s or longer.")
        return 1.0
    torques = [(bridged(run.torque[side]), run.rate) for run in checks]
    in_band = sum(band_density(torque, rate, BAND) for torque, rate in torques)
    above = sum(white_density(torque, rate, above_band) for torque, rate in torques)
    ratio = in_band / above if above > 0.0 else 1.0
    return 1.0 if 1.0 / EVEN < ratio < EVEN else ratio
