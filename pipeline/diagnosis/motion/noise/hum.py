"""Hum: a missing torque of one frequency whatever the speed, as of the mains or of a resonance that no model has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import binom

from pmg.pipeline.diagnosis.engine.spectral_line import over_neighbours, swept
from pmg.pipeline.motion.smooth import BAND
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.sim.signals import Array

SLOWEST = 1.5
"""Lowest frequency that is looked at [Hz]; what is slower may be wander or a manoeuvre."""

STEP = 1.0 / 60.0
"""Step from frequency to frequency [Hz]: half the resolution of a run of 30 s."""

ABOUT = 1.0
"""Frequencies to either side [Hz] whose median power is what a frequency has without a hum; the last ones in the band
of the rows, where noise is no longer even, are not looked at."""

LEAST = 3
"""Stretches that must show it at least; half of them where there are more."""

CERTAIN = 1e-6
"""Probability of the whole search up to which a frequency is no chance: far below what is usual, as orders of a turn
that are swept over leave the power less even than noise does."""

LONG = 5.0
"""Time that rows at which the speed changes must fill [s]."""


def hums_of(stretches: Sequence[RotorRows], white: Sequence[Array]) -> dict[str, float]:
    r"""Frequency [Hz] of a hum in the balance of each rotor that has one.

    Parameters
    ----------
    stretches : sequence of RotorRows
        Of a campaign.
    white : sequence of (n,) array
        What the balance of each leaves, whitened.

    Returns
    -------
    dict of str to float
        By side.

    Notes
    -----
    With q the ratio of `over_neighbours` at a frequency that half of the stretches exceed, h of r, chance makes h or
    more exceed it by the binomial law of r and :math:`e^{-q}`: times the frequencies that are looked at, that is the
    probability of the whole search. A few runs with a resonance or a line of their own make no hum, and orders of a
    turn make none, as rows at which the speed is kept do not count.
    """
    frequencies = np.arange(SLOWEST, BAND - 2.0 * ABOUT, STEP)
    found = {}
    for side in SIDES:
        of_side = []
        for stretch, left in zip(stretches, white, strict=True):
            if stretch.side != side or stretch.at_rest:
                continue
            turning = swept(stretch.of_rows(stretch.shaft.speed), stretch.run.row_rate)
            if turning.sum() >= LONG * stretch.run.row_rate:
                of_side.append(_shown(stretch, left * turning, frequencies))
        half = max((len(of_side) + 1) // 2, LEAST)
        if len(of_side) < half:
            continue
        exceeded = np.sort(of_side, axis=0)[-half]
        by_chance = float(binom.sf(half - 1, len(of_side), np.exp(-exceeded.max())))
        if by_chance * len(SIDES) * len(frequencies) < CERTAIN:
            found[side] = float(frequencies[np.argmax(exceeded)])
    return found


def _shown(stretch: RotorRows, white: Array, frequencies: Array) -> Array:
    """Power (f,) of whitened rows at each frequency, over what its neighbours have."""
    whole = np.zeros(len(stretch.rows))
    whole[stretch.rows] = white
    count = round(stretch.run.row_rate / STEP)
    folded = np.pad(whole, (0, -len(whole) % count)).reshape(-1, count).sum(axis=0)
    shown = over_neighbours(np.abs(np.fft.rfft(folded)) ** 2, round(ABOUT / STEP))
    return np.asarray(np.interp(frequencies, np.fft.rfftfreq(count, 1.0 / stretch.run.row_rate), shown))
