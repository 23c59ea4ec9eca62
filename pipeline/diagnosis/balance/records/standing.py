"""Where a machine stands: what holds it there is as large as it needs to be, and tells nothing of its friction."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.findings import Code, Findings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.balance.library.term import Motion
    from pmg.pipeline.recording.findings import Finding
    from pmg.sim.signals import Array, Mask

DWELL = 0.2
"""Time at rest from which on a machine stands [s]; a reversal passes sooner."""

CREEPS = 0.25
"""Mean speed of a stretch over that below which the machine counts as at rest, from which on it creeps."""


RARELY, WIDEST = 0.01, 2.0
"""Part of the samples that noise may take beyond the speed of rest, and how many times as fast it may make them."""


def stands(speed: Array, rest_speed: float) -> bool:
    """Whether all that a speed (n,) shows may be noise, of which few samples exceed the speed of rest."""
    size = np.abs(speed)
    return bool(size.max() <= WIDEST * rest_speed and np.mean(size > rest_speed) <= RARELY)


STEADY_PARTS, PLAIN_CREEP = (5, 10, 20), 4.0
"""Stretches of a speed whose means tell whether it creeps, and how many standard errors the mean of all lies off."""


def mean_speed(speed: Array) -> tuple[float, float]:
    """Mean of a speed (n,) that may be noise, and its standard error: the largest by stretches of several lengths."""
    errors = []
    for count in STEADY_PARTS:
        means = np.array([part.mean() for part in np.array_split(speed, count)])
        errors.append(float(means.std(ddof=1)) / math.sqrt(count))
    return float(speed.mean()), max(errors)


def rests(motion: Motion) -> Iterator[tuple[int, int]]:
    """First sample of each stretch below the speed of rest, and the one after its last, within each recording.

    A reversal that passes it from one sample to the next is a stretch of one.
    """
    slow = np.abs(motion.speed) < motion.rest_speed
    slow[:-1] |= np.sign(motion.speed[:-1]) * np.sign(motion.speed[1:]) < 0.0
    begins = np.r_[True, slow[1:] != slow[:-1]]
    begins[list(motion.starts)] = True
    edges = [*np.flatnonzero(begins).tolist(), len(slow)]
    return ((first, last) for first, last in itertools.pairwise(edges) if slow[first])


def stays(motion: Motion, first: int, last: int) -> bool:
    """Whether a machine stands in a rest, and neither turns there nor creeps."""
    long = (last - first) * motion.sample_time >= DWELL
    return long and abs(float(motion.speed[first:last].mean())) < CREEPS * motion.rest_speed


def moves(motion: Motion, spoilt: int) -> Mask:
    """Samples (n,) that tell of friction: those at which the machine does not stand; all where none would be left.

    Parameters
    ----------
    motion : Motion
        Of one recording, or several one after the other.
    spoilt : int
        Samples before and after a rest into which filters carry what holds the machine there.
    """
    found, recording = np.ones(len(motion.speed), dtype=np.bool_), motion.first
    for first, last in rests(motion):
        if stays(motion, first, last):
            near = slice(max(first - spoilt, 0), last + spoilt)
            found[near] &= recording[near] != recording[first]
    return found if found.any() else ~found


def rest_findings(names: str, motion: Motion, used: Mask) -> tuple[Finding, ...]:
    """What is said of rests that are left out; nothing without any."""
    count = int(np.sum(np.diff(np.r_[True, used].astype(np.int8)) == -1))
    if not count:
        return ()
    findings = Findings(names)
    rest = motion.sample_time * float(np.sum(~used))
    message = f"the machine stands for {rest:.3g} s in all ({count} times): left out of the fit"
    findings.info(Code.SAMPLES_GAP, "time", message, "Nothing to do: what holds it there may be of any size.")
    return findings.listed()
