"""Channels that are renewed more rarely than they are recorded, as by a slow counter: held, they come late."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.checks.stretches import stretches
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array

FEWEST_RENEWALS = 50
"""Least number of renewals from which a period is taken."""

SPREAD = 1.75
"""Gaps between renewals, over the shortest, that are one period; longer ones hold several, where a value came twice."""

OUT_OF_STEP = 0.01
"""Part of the gaps that may be off a multiple of the period by a sample or more."""

MOST_SAMPLES = 1_000_000
"""Samples of the longest stretch without a gap from which a period is taken."""

LEAST_PERIOD = 1.9
"""Samples from which on a channel counts as held."""


def _renewal_of(values: Array) -> float:
    """Samples from one renewal of a channel (n,) to the next; 1 where it is renewed with every sample.

    A value that is quantised stands still as well where it changes slowly, and a straight command then steps evenly,
    by one step of its resolution each time: neither is held.
    """
    known = stretches(np.isfinite(values))
    if not len(known):
        return 1.0
    start, stop = known[int(np.argmax(known[:, 1] - known[:, 0]))].tolist()
    changes = np.diff(values[start : min(stop, start + MOST_SAMPLES)])
    at = np.flatnonzero(changes)
    gaps, sizes = np.diff(at), np.abs(changes[at])
    if len(gaps) < FEWEST_RENEWALS or float(np.median(sizes)) < SPREAD * float(sizes.min()):
        return 1.0
    shortest = float(np.quantile(gaps, OUT_OF_STEP))
    period = float(np.mean(gaps[(gaps >= shortest) & (gaps <= SPREAD * shortest)]))

    def periods_in_gaps() -> Array:
        return np.maximum(np.round(gaps / period), 1.0)

    for _ in range(2):
        period = float(gaps.sum() / periods_in_gaps().sum())
    off = np.abs(gaps - period * periods_in_gaps())
    return period if period >= LEAST_PERIOD and float(np.mean(off >= 1.0)) <= OUT_OF_STEP else 1.0


def tell_renewals(channel: str, values: Array, step: float, findings: Findings) -> None:
    """Tell that a channel is held from one renewal to the next.

    Parameters
    ----------
    channel : str
        Its name.
    values : (n,) array
        Forces, torques or speeds as recorded.
    step : float
        Time from sample to sample [s].
    findings : Findings
        Receives the period, and by how much the channel comes late on average.
    """
    if (period := _renewal_of(values)) == 1.0:
        return
    late = 0.5 * (period - 1.0) * step
    message = f"it is renewed every {period:.3g} samples ({1e3 * period * step:.3g} ms) and held between"
    do = f"Record it as often as the rest: held, it comes {1e3 * late:.3g} ms late on average, found as a delay."
    findings.warning(Code.CHANNEL_VALUE, channel, message, do)
