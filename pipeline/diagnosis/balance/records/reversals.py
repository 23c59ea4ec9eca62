"""What dry friction shows at reversals that no record tells: it is left out of what a search may explain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.term import LAG

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.library.term import Motion
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.diagnosis.balance.records.smoothing import Smoother
    from pmg.sim.signals import Array

SOONER, BEYOND = "sooner", "beyond"
"""Channels of `Motion.besides`: friction that turned sooner than the smoothed speed [N, N m], and what the low-pass of
the motion takes of the sense."""


def beyond_low_pass(motion: Motion, smoother: Smoother) -> Array:
    """What the low-pass of the motion takes of the sense (n,), within each recording."""
    turns = [sense - sense[0] for sense in np.split(motion.sense, motion.starts[1:])]
    return np.concatenate([turned - smoother.smooth(turned) for turned in turns])


def reversals(recorded: Recorded, ways: tuple[float, ...]) -> Array:
    """What dry friction shows in the moments in which it changes its sign (n, k); no column where it never does.

    Parameters
    ----------
    recorded : Recorded
        The recordings.
    ways : tuple of float
        Ways over which a force may rise after a reversal [m, rad].

    Notes
    -----
    Near a reversal a record does not tell when exactly the machine turned, how fast, and what friction was before it
    counted as moving. Friction gives the speed a kink there. The low-pass rounds it off, so that friction changes its
    sign sooner than the smoothed speed; and as the force is not low-passed, it holds what the acceleration has lost.
    Nor does a record tell what rises within a way that the machine passes in one thinned sample. These columns are
    free beside the baseline: no cause is named for what they describe.
    """
    m = recorded.motion
    turned, sense = m.rate(m.direction), m.sense
    at_rest = np.where(np.abs(m.speed) < m.rest_speed, np.sign(m.speed), 0.0)
    besides = [m.besides[name] for name in (SOONER, BEYOND) if name in m.besides]
    turns = np.flatnonzero(np.diff(sense, prepend=sense[:1]))
    passed = np.r_[0.0, m.travel[np.minimum(turns + recorded.keep_every, len(sense) - 1)]]
    since = passed[np.searchsorted(turns, np.arange(len(sense)), side="right")]
    besides += [np.where(since > way, sense * np.exp(-m.travel / way), 0.0) for way in ways if (passed > way).any()]
    columns = [turned, m.rate(turned), at_rest, *besides]
    if LAG in m.references:
        columns += [m.ahead(each, m.references[LAG]) for each in columns]
    found = recorded.thin(np.stack(columns, axis=1))
    return found if found.any() else found[:, :0]
