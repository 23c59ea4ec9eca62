"""Hum: a force of one frequency whatever the machine does, as of the mains or of a floor that swings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal.windows import hann
from scipy.stats import f

from pmg.pipeline.diagnosis.balance.records.reading import KEPT
from pmg.pipeline.diagnosis.engine.spectral_line import swept
from pmg.pipeline.fit.span import taken_out
from pmg.pipeline.fit.structure import ResidualStructure
from pmg.pipeline.orders.band import emptied, noise_around, periodogram
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.sim.signals import Array

CYCLES = 12
"""Cycles in the longest stretch from which on a line is no slow wave of what the machine did."""

FINER = 4
"""Frequencies that are looked at for each that a stretch tells apart."""

FEWEST = 160
"""Frequencies that must be looked at: fewer say little of the noise about a line."""

TAPERED = 0.5
"""Degrees of freedom of neighbours in the spectrum of tapered rows, over those without a taper."""

WITHIN = 0.7
"""Part of the band that low-pass and decimation leave, up to which frequencies are looked at: near its edge the power
falls too steeply for the noise level to be estimated."""

AS_LONG = 0.5
"""Length of a stretch, over that of the longest, from which on it counts."""

NO_CHANCE = 1e-6
"""Probability of the whole search up to which a frequency is no chance. In synthetic campaigns of other machines the
clearest line of 46 without a cause had 0.3, of 70 with another cause 2e-6 and 4e-4 (ripples over position at a speed
that hardly changes), of eight with a hum 1e-20."""

ALONE = 1e-3
"""Probability of that frequency alone, up to which rows at which the speed changes show it."""

PROGRAMMED = 4.0
"""Force of the model over that of a line, from which on the line is a part of what the machine was made to do: a hum
moves a machine by no more than its own force, or some times that in a loop that resounds."""

REFINED = 64
"""Frequencies to either side, as far as the longest stretch tells apart, at which whole recordings are read."""


def hum_beside(recorded: Recorded, structured: Array, low_pass: float) -> tuple[ResidualStructure, ...]:
    """The hum in what structure (n, k) leaves of a force, in a phase of its own in each recording; empty without any.

    Parameters
    ----------
    recorded : Recorded
        The recordings.
    structured : (n, k) array
        What their force may follow.
    low_pass : float
        Cut-off of their low-pass [Hz].

    Notes
    -----
    It is looked for in rows that are not whitened, as an autoregression takes a line along.
    """
    motion, interval = recorded.motion, recorded.motion.sample_time * recorded.keep_every
    left, _ = taken_out(structured, recorded.force)
    modelled = recorded.thin(motion.modelled[:, None])[:, 0]
    parts, speeds, given = (
        np.split(each, recorded.breaks[1:]) for each in (left, recorded.at_rows(motion.speed), modelled)
    )
    place = _hum_in(parts, speeds, given, interval, WITHIN * min(low_pass, KEPT / interval))
    if place is None:
        return ()
    frequency = _refined(recorded, left, *place)
    phase = REVOLUTION * frequency * motion.time
    waves = recorded.thin(np.stack([np.cos(phase), np.sin(phase)], 1))
    recording = np.searchsorted(recorded.starts, np.arange(len(left)), side="right")
    own = recording[:, None] == np.arange(1, len(recorded.starts) + 1)
    columns = np.hstack([wave[:, None] * own for wave in waves.T])
    return (ResidualStructure("force", "all", (f"a hum of {frequency:.1f} Hz",), columns),)


def _hum_in(
    parts: Sequence[Array], speeds: Sequence[Array], given: Sequence[Array], interval: float, highest: float
) -> tuple[float, float] | None:
    """Frequency of a hum in stretches of a force, each (n,), and what the longest tells apart [Hz]; None without any.

    Parameters
    ----------
    parts, speeds, given : sequence of (n,) array
        What is left of the force in each stretch without a rest, the speed, and the force that the rest of the model
        gives.
    interval : float
        Time from row to row [s].
    highest : float
        Frequency up to which a hum is looked for [Hz].

    Notes
    -----
    At a speed that is kept any order of a turn is a line, so that rows of a changing one must show it as well. What a
    programme leaves that comes again and again are lines at its repeats, where the model gives a force, too.
    """
    longest = max(map(len, parts))
    count = FINER * longest
    places = np.arange(FINER * CYCLES, min(int(highest * count * interval), count // 2) + 1)
    if len(places) < FINER * FEWEST or not any(part.any() for part in parts):
        return None
    counted = [k for k, part in enumerate(parts) if len(part) >= AS_LONG * longest]
    second = max(round(1.0 / interval), 1)
    changing = [parts[k] * swept(uniform_filter1d(speeds[k], second), 1.0 / interval) for k in counted]
    by_chance = _by_chance([parts[k] for k in counted], places, count)
    at = places[[int(np.argmin(by_chance))]]
    if by_chance.min() * len(places) >= NO_CHANCE or _by_chance(changing, at, count)[0] >= ALONE:
        return None
    shown, programmed = (sum(_power(of[k], at, count)[0] for k in counted) for of in (parts, given))
    if programmed > PROGRAMMED**2 * shown:
        return None
    return float(at[0]) / (count * interval), 1.0 / (longest * interval)


def _by_chance(parts: Sequence[Array], places: npt.NDArray[np.int64], count: int) -> Array:
    r"""Probability that noise shows as much at each of some frequencies, of `count` to a cycle a row (m,).

    Notes
    -----
    The power of a line over that of its neighbours follows F with 2 degrees of freedom and those of its level, so
    that the mean of r stretches follows F with r times as many of both, whatever the phases. A Hann taper keeps slow
    waves from reaching others.
    """
    shown = [part for part in parts if part.any()]
    ratio, degrees, stretches = np.zeros(len(places)), np.zeros(len(places)), max(len(shown), 1)
    for part in shown:
        spectrum, lines = periodogram(_tapered(part)[None]), places * len(part) / count
        noise = noise_around(spectrum, emptied(spectrum.shape[1], ()), lines)
        known = np.isfinite(noise.power[0])
        ratio += np.where(known, _power(part, places, count) / np.where(known, noise.power[0], 1.0), 0.0)
        degrees += np.where(known, TAPERED * noise.dof[0], 0.0)
    return np.asarray(f.sf(ratio / stretches, 2 * stretches, np.maximum(degrees, 1.0)))


def _power(part: Array, places: npt.NDArray[np.int64], count: int) -> Array:
    """Squared amplitude of tapered rows (n,) at each of some frequencies, of `count` to a cycle a row (m,)."""
    return np.asarray(np.abs(np.fft.rfft(_tapered(part), count)[places] * 2.0 / len(part)) ** 2)


def _tapered(part: Array) -> Array:
    return np.asarray((part - part.mean()) * hann(len(part), sym=False))


def _refined(recorded: Recorded, left: Array, frequency: float, apart: float) -> float:
    """The frequency at which all rows of each recording, at their times, hold most of a hum."""
    tried = frequency + apart * np.linspace(-1.0, 1.0, 2 * REFINED + 1)
    power = np.zeros(len(tried))
    for rows, time in zip(*(np.split(each, recorded.starts[1:]) for each in (left, recorded.time)), strict=True):
        waves = np.exp(-1j * REVOLUTION * np.multiply.outer(tried, time))
        power += np.abs(waves @ rows) ** 2 / max(len(rows), 1)
    return float(tried[np.argmax(power)])
