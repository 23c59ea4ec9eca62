"""Noise of single rows beyond that of all: where a machine sticks, and where an encoder's steps pass the low-pass."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import fftconvolve

from pmg.pipeline.diagnosis.balance.library.term import STEPS
from pmg.pipeline.diagnosis.balance.records.reversals import BEYOND, SOONER, beyond_low_pass
from pmg.pipeline.diagnosis.balance.records.smoothing import kept
from pmg.pipeline.diagnosis.balance.records.standing import rests, stays
from pmg.pipeline.motion.angle_noise import STILL, without_small_waves
from pmg.pipeline.recording.findings import Code, Findings

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.library.term import Motion
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.diagnosis.balance.records.smoothing import Smoother
    from pmg.sim.signals import Array

STICKS = 2.0
"""Time below the speed of rest, over that in which the acceleration on either side passes it, from which on a machine
sticks."""

HELD = 2.0
"""Force between two senses of motion, over the friction there, up to which it may hold the machine: it is a mean over
half a period of the low-pass on either side."""

ROUNDS = 0.05
"""Speed that a low-pass adds where it rounds off a kink, over the change of slope and its period."""

SAMPLED = 0.2
"""Samples by which the turn may be off, as either end of a rest lies between two of them."""

UNSEEN = 0.125
"""Periods of the low-pass by which a rest may begin sooner and end later than the smoothed speed tells."""

OFFSETS = 8
"""Places within a step at which an angle is counted again."""

WHOLE, MOSTLY = 0.1, 0.95
"""Part of a step by which changes may be off whole numbers of steps, and part of the changes that are not off more."""

DITHERED = 0.33
"""Median size of the noise of a position, in steps, from which on it blurs them; steps alone have a quarter."""


def _step_of(position: Array) -> float:
    """Step in which a position (n,) was counted [m, rad]; zero where it shows none."""
    changes = np.abs(np.diff(position))
    changes = changes[changes > 0.0]
    if not len(changes):
        return 0.0
    least = float(changes.min())
    step = float(np.median(changes[changes < 1.5 * least]))
    few = changes[changes < 0.5 / WHOLE * step]
    off = np.abs(few / step - np.round(few / step))
    return step if float(np.mean(off < WHOLE)) >= MOSTLY else 0.0


def noise_of_steps(position: Array, path: Array, smoother: Smoother) -> Array:
    r"""Standard deviation that the steps of an encoder give the acceleration at each sample (n,) [m/s2, rad/s2].

    Parameters
    ----------
    position : (n,) array
        As recorded [m, rad].
    path : (n,) array
        The same after the low-pass.
    smoother : Smoother
        The low-pass.

    Notes
    -----
    What whole steps c are off is white while the speed changes fast. Near standstill, and wherever a sample passes
    nearly a whole number of steps, it is slow: a wave of :math:`|v/c - k f_s|`, which passes the low-pass. The path is
    counted again at several places within a step, and their scatter is averaged over a period of the low-pass. Zero
    where the position shows no steps, or other noise blurs them.

    References
    ----------
    B. Widrow, I. Kollár, 'Quantization Noise', Cambridge University Press (2008), chapters 4 and 17.
    """
    step = _step_of(position)
    if step == 0.0 or float(np.median(np.abs(position - path))) > DITHERED * step:
        return np.zeros_like(path)
    path = without_small_waves(path, STILL * step, smoother.weights_further)
    again = []
    for place in np.arange(OFFSETS) / OFFSETS:
        off = step * (np.floor(path / step + place) - place) - path
        again.append(kept(smoother.slope(smoother.slope(smoother.smooth(off))), smoother.keep_every))
    window = np.hanning(2 * round(0.5 / smoother.cut_off / smoother.step) + 1)
    around = fftconvolve(np.var(again, axis=0), window / window.sum(), mode="same")
    return np.asarray(np.sqrt(np.maximum(around, 0.0)))


@dataclass(frozen=True)
class _Turn:
    """What a machine does where it comes to rest or turns, between two stretches of samples.

    Parameters
    ----------
    may_stick : bool
        Whether it may stay there for longer than the smoothed speed tells.
    size : float
        What may be wrong of the force there [N, N m]: all that holds it, or friction while it has the other sign.
    shifted : float
        Time by which the low-pass moves the change of sign [s]: it rounds off the kink that friction gives the speed.
    """

    may_stick: bool
    size: float
    shifted: float

    @classmethod
    def between(cls, motion: Motion, inertia: float, before: slice, after: slice, smoother: Smoother) -> _Turn:
        """By the friction on either side, and the acceleration there."""
        force, acceleration, h = motion.force, motion.acceleration, motion.sample_time
        fastest = max(float(np.median(np.abs(acceleration[side]))) for side in (before, after))
        friction = [float(np.median(force[side] - inertia * acceleration[side])) for side in (before, after)]
        half = 0.5 * abs(friction[1] - friction[0])
        middle = slice((before.start + before.stop) // 2, (after.start + after.stop) // 2)
        rests = (after.start - before.stop - 2) * h * fastest >= 2.0 * STICKS * motion.rest_speed
        if rests or abs(float(np.mean(force[middle])) - 0.5 * sum(friction)) < HELD * half:
            return cls(True, float(np.abs(force[before.start : after.stop]).max()), UNSEEN / smoother.cut_off)
        kink = 2.0 * half / max(abs(inertia), 1e-300)
        return cls(False, 2.0 * half, kink * ROUNDS / smoother.cut_off / max(fastest, 1e-300))

    def unsure(self, step: float) -> float:
        """Time by which the change of sign may be off [s], at a time from sample to sample."""
        return math.hypot(self.shifted, SAMPLED * step)


def _held(motion: Motion, inertia: float, smoother: Smoother) -> tuple[Array, Array, int]:
    """What may hold a machine at each sample (n,) [N, N m], as far as the low-pass carries it, and how often it sticks.

    It may stick where it comes to rest and the force is no larger than the friction on either side of that, or where it
    rests for longer than the acceleration before and after tells. The turns of one recording are nearly the same, so
    that together they count as one. Where it turns at once, friction changes its sign sooner than the smoothed speed,
    by a time that follows from the kink; that friction is given too (n,) [N, N m].
    """
    stuck, turned, sooner = (np.zeros_like(motion.force) for _ in range(3))
    weights, times = np.abs(kept(smoother.weights, smoother.keep_every)), Counter[tuple[int, int]]()
    beside, reach = round(1.0 / smoother.cut_off / smoother.step), len(weights) // 2
    for first, last in rests(motion):
        begin = int(motion.first[first])
        end = next((start for start in motion.starts if start > first), len(stuck))
        before, after = slice(max(first - beside, begin), first), slice(last, min(last + beside, end))
        if stays(motion, first, last) or before.start == before.stop or after.start == after.stop:
            continue
        turn = _Turn.between(motion, inertia, before, after, smoother)
        longer = round(turn.shifted / motion.sample_time) if turn.may_stick else 0
        inside = slice(max(first - longer, begin), min(last + longer, end))
        around = slice(max(inside.start - reach, begin), min(inside.stop + reach, end))
        per_time = 1.0 / (motion.sample_time * (last - first))
        held, part = (stuck, 1.0) if turn.may_stick else (turned, per_time * turn.unsure(motion.sample_time))
        rest = np.zeros(around.stop - around.start)
        rest[inside.start - around.start : inside.stop - around.start] = part
        held[around] = np.hypot(held[around], turn.size * fftconvolve(rest, weights, mode="same"))
        if turn.may_stick:
            times[begin, end] += 1
        elif inside.stop < end:
            sooner[inside] = per_time * turn.shifted * turn.size * np.sign(motion.speed[inside.stop])
    for (begin, end), count in times.items():
        stuck[begin:end] *= math.sqrt(count)
    return np.hypot(stuck, turned), sooner, times.total()


def with_row_noise(recorded: Recorded, inertia: float, smoother: Smoother) -> Recorded:
    """Recordings with the noise that each row has beside that of all [N, N m], and the channels of `reversals`."""
    motion = recorded.motion
    held, sooner, count = _held(motion, inertia, smoother)
    steps = inertia * motion.besides[STEPS] if STEPS in motion.besides else np.zeros_like(held)
    own = recorded.at_rows(np.hypot(held, steps))
    told = Findings(recorded.name)
    if count:
        message = f"the machine may stick {count} times, briefly or creeping: the samples there count less"
        told.info(Code.SAMPLES_GAP, "time", message, "Nothing to do: what holds it there may be of any size.")
    of_turns = {SOONER: sooner, BEYOND: beyond_low_pass(motion, smoother)}
    motion = replace(motion, besides={**motion.besides, **of_turns})
    return replace(recorded, motion=motion, own_noise=own, findings=(*recorded.findings, *told.listed()))
