"""Hum: a force of one frequency whatever the machine does, as of the mains or of a floor that swings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import f

from pmg.pipeline.diagnosis.balance.noise_model import whitened_rows
from pmg.pipeline.diagnosis.balance.records.reading import KEPT
from pmg.pipeline.diagnosis.engine.spectral_line import over_neighbours, swept
from pmg.pipeline.fit.structure import ResidualStructure
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.diagnosis.balance.serial import SerialNoise
    from pmg.sim.signals import Array, Mask

CYCLES = 10
"""Cycles in the longest recording from which on a line is no slow wave of what the machine did."""

FINER = 4
"""Frequencies that are looked at for each that a recording tells apart."""

NEIGHBOURS = 100
"""Frequencies, of those that are told apart, to either side of one that say what it has without a hum."""

WITHIN = 0.7
"""Part of the band that low-pass and decimation leave, up to which frequencies are looked at: where power falls steeply
its level is not told."""

AS_LONG = 0.5
"""Length of a recording, over that of the longest, from which on it counts."""

CERTAIN = 1e-10
"""Probability of the whole search up to which a frequency is no chance. Of 46 synthetic campaigns of other machines
without a cause the clearest line had 5e-5; of 70 with a cause that is no hum 6e-13 and 5e-11, ripples over position at
a speed that hardly changes, and 4e-4 the others; of eight with a hum 7e-11 and less."""

MOVING = 1e-3
"""Probability of that frequency alone, up to which it is shown by rows at which the speed changes."""


def _hum_in(parts: Sequence[Array], moving: Sequence[Mask], interval: float, highest: float) -> float | None:
    r"""Frequency [Hz] of a hum in whitened recordings, each (n,), of one interval of time [s]; None without any.

    Parameters
    ----------
    parts : sequence of (n,) array
        The recordings.
    moving : sequence of (n,) array of bool
        Rows at which the speed changes: any order of a turn is a line where it is kept.
    interval : float
        Time from row to row [s].
    highest : float
        Frequency up to which a hum is looked for [Hz].

    Notes
    -----
    The mean of the ratios of `over_neighbours` of r recordings follows F with 2 r degrees of freedom, whatever the
    phases; those below it are :math:`2 r n \ln^2 2`, as a median of n exponential values is off by
    :math:`1/(\sqrt{n} \ln 2)` of itself. Times the frequencies that are looked at, its tail is the probability of the
    whole search.
    """
    longest = max(map(len, parts))
    count = FINER * longest
    first, last = FINER * CYCLES, min(int(highest * count * interval), count // 2) + 1
    if last - first < FINER * NEIGHBOURS:
        return None
    counted = [(part, kept) for part, kept in zip(parts, moving, strict=True) if len(part) >= AS_LONG * longest]

    def shown(rows: Iterable[Array]) -> Array:
        spectra = (np.abs(np.fft.rfft(part, count)) ** 2 for part in rows)
        return np.asarray(np.mean([over_neighbours(power, FINER * NEIGHBOURS) for power in spectra], axis=0))

    def by_chance(ratio: float) -> float:
        below = 2.0 * len(counted) * (2 * NEIGHBOURS + 1) * math.log(2.0) ** 2
        return float(f.sf(ratio, 2 * len(counted), below))

    together = shown(part for part, _ in counted)[first:last]
    at = int(np.argmax(together))
    if by_chance(together[at]) * len(together) >= CERTAIN:
        return None
    where_moving = shown(part * kept for part, kept in counted)[first + at]
    return (first + at) / (count * interval) if by_chance(where_moving) < MOVING else None


def hum_beside(
    recorded: Recorded, noise: SerialNoise, structured: Array, low_pass: float
) -> tuple[ResidualStructure, ...]:
    """The hum in what structure (n, k) leaves of a force, in a phase of its own in each recording; empty without any.

    Parameters
    ----------
    recorded : Recorded
        The recordings.
    noise : SerialNoise
        Whitens their rows.
    structured : (n, k) array
        What their force may follow.
    low_pass : float
        Cut-off of their low-pass [Hz].
    """
    motion = recorded.motion
    interval = motion.sample_time * recorded.keep_every
    _, left = whitened_rows(noise, np.c_[structured, recorded.force])
    speeds, rows = (
        np.split(recorded.at_rows(motion.speed), noise.starts),
        [start - noise.lags for start in noise.starts],
    )
    moving = np.concatenate([swept(speed, 1.0 / interval) for speed in speeds])[noise.lags :]
    frequency = _hum_in(np.split(left, rows), np.split(moving, rows), interval, WITHIN * min(low_pass, KEPT / interval))
    if frequency is None:
        return ()
    phase, own = REVOLUTION * frequency * motion.time, np.equal.outer(motion.first, np.array(motion.starts))
    waves = recorded.thin(np.hstack([np.cos(phase)[:, None] * own, np.sin(phase)[:, None] * own]))
    return (ResidualStructure("force", "all", (f"frequency of {frequency:.1f} Hz",), waves),)
