"""Torques whose noise went through a low-pass, as of an amplifier: it is denser in the band of the rows than above."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from pmg.pipeline.motion.smooth import BAND, bridged
from pmg.pipeline.motion.torque_noise import band_density
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.errors import FitError
from pmg.sim.shafts import per_shaft

if TYPE_CHECKING:
    from pmg.pipeline.motion.smooth import SmoothRun, SmoothShaft

EVEN, SURE = 1.5, 18.0
"""Density in the band over that above it, or the other way round, up to which noise passes for white, and time of zero
checks for which that holds [s]: white noise shows 0.9 to 1.2 then, and more the shorter they are."""

SLOWEST = 5.0
"""Frequency below which a torque at rest shows wander [Hz]."""

NEAR = 3.0 * BAND, 4.5 * BAND, 6.0 * BAND
"""Ends of two stretches next above the band [Hz], by which noise is told where there is no zero check."""

FALLS = 2.0
"""Density of the first of them over that of the second from which on that in the band cannot be told from them. A
low-pass of 100 Hz gives 2.3, one of 150 Hz 1.5."""


def with_noise_of_band(runs: tuple[SmoothRun, ...]) -> tuple[SmoothRun, ...]:
    """The runs with the noise of each torque as dense as it is in the band of the rows, as zero checks show.

    Notes
    -----
    The noise of a run in motion shows above the band alone, where it was told. Behind a low-pass of 100 Hz it is a
    hundred times denser in the band; what is freed from noise by too small a density shows the noise as a cause.

    Raises
    ------
    FitError
        The noise of a torque falls next above the band, and no zero check shows what it is in the band.
    """
    denser = per_shaft(lambda side: _denser(runs, side))

    def in_band(run: SmoothRun, side: str) -> SmoothShaft:
        return replace(run.shafts[side], density=denser[side] * run.shafts[side].density)

    return tuple(replace(run, shafts=per_shaft(partial(in_band, run))) for run in runs)


def _denser(runs: tuple[SmoothRun, ...], side: str) -> float:
    """Density of the noise of a torque in the band over that above it; 1 where it passes for white."""
    records = [(run, bridged(run.run.torque[side]), run.run.rate) for run in runs]
    checks = [record for record in records if record[0].run.manoeuvre is Manoeuvre.ZERO]
    seconds = sum(len(torque) / rate for _, torque, rate in checks)
    above = sum(len(torque) * run.shafts[side].density for run, torque, _ in checks)
    if above > 0.0:
        in_band = sum(len(torque) * band_density(torque, rate, SLOWEST, BAND) for _, torque, rate in checks)
        even = EVEN ** max(1.0, math.sqrt(SURE / seconds))
    else:
        long = [record for record in records if 0.4 * record[2] > NEAR[-1]]
        above = sum(len(torque) * run.shafts[side].density for run, torque, _ in long)
        first, second = (
            sum(len(torque) * band_density(torque, rate, low, high) for _, torque, rate in long)
            for low, high in itertools.pairwise(NEAR)
        )
        if first > FALLS * second > 0.0:
            raise FitError(
                f"torque of the {side}",
                f"noise {first / second:.1f} times as dense at {NEAR[0]:.0f} Hz as at {NEAR[-1]:.0f} Hz, as behind a "
                "low-pass, and no zero check that shows it",
                f"a zero check: the noise below {BAND:.0f} Hz, where the runs move, is told by it",
                "Record one with both drives off, 6 s or longer.",
            )
        in_band, even = first, EVEN
    ratio = in_band / above if above > 0.0 else 1.0
    return 1.0 if 1.0 / even < ratio < even else ratio
