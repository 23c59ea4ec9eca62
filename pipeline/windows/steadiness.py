"""Checks on a window: each says what speaks against taking it as a steady test point."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.checks.lines import EMERGENCY_STOP
from pmg.pipeline.recording.checks.stretches import stretches
from pmg.pipeline.recording.join import FLAGS
from pmg.pipeline.windows.reduce import end_to_end_speed
from pmg.pipeline.windows.revolutions import batch_means
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION, RPM

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    import numpy.typing as npt

    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.join import Blemish
    from pmg.pipeline.recording.layouts.wire import LineEvent
    from pmg.pipeline.recording.run_records import Setpoints
    from pmg.pipeline.windows.limits import Steadiness
    from pmg.sim.signals import Array

REST_SPEED = 0.5 * RPM
"""Below this a shaft counts as held [rad/s]: half of the finest set-point step of the drives."""
BY_RECORDER = frozenset(code for code, _, _ in FLAGS.values())
"""Marks that a recorder makes; the others are found by the reading."""
FEWEST_MEANS = 5
"""Batches below which a drift cannot be distinguished from noise."""
TRIMMED = 1.6
"""Standard deviation of normal numbers over the root mean square of those that are left without the largest quarter."""


@dataclass(frozen=True)
class Reason:
    """Reason against a window: a stable name, and the numbers."""

    name: str
    detail: str

    def __str__(self) -> str:
        """Name and numbers, with a colon between."""
        return f"{self.name}: {self.detail}"


@dataclass(frozen=True)
class WindowEvidence:
    """Known facts of a window when it is judged.

    Parameters
    ----------
    first, stop : int
        Sample indices.
    closed : bool
        Whether its end was recorded.
    meant : int
        Samples that it was meant to have.
    rate_hz : float
        Sample rate [Hz].
    setpoints : Setpoints
        What was asked for.
    calibration : Calibration
        Transducers and encoders.
    torque, angle : mapping of str to (n,) array
        By shaft [N m], [rad]; NaN where nothing was recorded.
    lines : (n,) array of unsigned int
        Digital inputs; 0 where they were not sampled.
    line_events : sequence of LineEvent
        Changes of the digital inputs over the whole run.
    blemishes : sequence of Blemish
        Stretches that the recorder marks as bad, over the whole run.
    lacking : collection of str
        Channels that the file does not hold, such as ``torque_ring``; no gap of theirs is reported.
    """

    first: int
    stop: int
    closed: bool
    meant: int
    rate_hz: float
    setpoints: Setpoints
    calibration: Calibration
    torque: Mapping[str, Array]
    angle: Mapping[str, Array]
    lines: npt.NDArray[np.uint32]
    line_events: Sequence[LineEvent]
    blemishes: Sequence[Blemish]
    lacking: Collection[str] = ()

    @cached_property
    def batches(self) -> Mapping[str, Array]:
        """Means of the batches of each torque without gaps [N m]."""
        whole = (side for side in SIDES if len(self.torque[side]) > 1 and np.isfinite(self.torque[side]).all())
        return {side: batch_means(self.torque[side], self.angle[side]).means for side in whole}


def _too_short(window: WindowEvidence, limits: Steadiness) -> Reason | None:
    """Less time than a mean needs, or than the test step announces."""
    seconds = (window.stop - window.first) / window.rate_hz
    meant = window.meant / window.rate_hz
    if not window.closed:
        return Reason("window not closed", f"no END follows MEASURE; {seconds:.2f} s were recorded")
    if seconds < max(limits.shortest, limits.completeness * meant):
        planned = window.first + window.meant
        lost = f"; samples {window.stop} to {planned} are missing" if planned > window.stop else ""
        return Reason("window too short", f"{seconds:.2f} s of {max(meant, limits.shortest):.2f} s{lost}")
    return None


def gaps(window: WindowEvidence, _: Steadiness) -> Reason | None:
    """Samples without a value."""
    missing = {
        f"{kind}_{side}": stretches(np.isnan(track[side])) + window.first
        for kind, track in (("torque", window.torque), ("angle", window.angle))
        for side in SIDES
        if f"{kind}_{side}" not in window.lacking
    }
    lost = [f"{_places(found, window)} in {name}" for name, found in missing.items() if len(found)]
    return Reason("samples missing", ", ".join(lost)) if lost else None


def _places(found: npt.NDArray[np.int64], window: WindowEvidence) -> str:
    """Where stretches of samples lie, their ends left out."""
    first, stop, count = int(found[0, 0]), int(found[-1, 1]), int(np.sum(found[:, 1] - found[:, 0]))
    if count == window.stop - window.first:
        return f"all samples, {first} to {stop},"
    return f"samples {first} to {stop}" if len(found) == 1 else f"{count} samples from {first} to {stop}"


def _flagged(window: WindowEvidence, _: Steadiness) -> Reason | None:
    """Blocks that the recorder itself marks as overrun, restarted or saturated."""
    named = _blemished(window, by_recorder=True)
    return Reason("flagged by the recorder", named) if named else None


def _faulty(window: WindowEvidence, _: Steadiness) -> Reason | None:
    """Samples in which the reading found a fault: slips of an encoder, held values, the shunt signal."""
    named = _blemished(window, by_recorder=False)
    return Reason("found faulty", named) if named else None


def _blemished(window: WindowEvidence, *, by_recorder: bool) -> str:
    """Names of the marks that overlap a window, either those of the recorder or those of the reading."""
    marks = (b for b in window.blemishes if _overlaps(b.start, b.stop, window))
    return ", ".join(sorted({f"{b.code.value} on {b.topic}" for b in marks if (b.code in BY_RECORDER) == by_recorder}))


def _emergency_stop(window: WindowEvidence, _: Steadiness) -> Reason | None:
    """Emergency stop pressed at any time in the window."""
    if bool((window.lines & EMERGENCY_STOP).any()):
        place = window.first + int(np.argmax((window.lines & EMERGENCY_STOP) > 0))
        return Reason("emergency stop", f"pressed at sample {place}")
    earlier = [e for e in window.line_events if e.sample <= window.first]
    within = [e for e in window.line_events if window.first < e.sample < window.stop]
    start = earlier[-1].mask if earlier else 0
    if not earlier and window.line_events:
        start = window.line_events[0].mask ^ window.line_events[0].changed
    if start & EMERGENCY_STOP:
        return Reason("emergency stop", "pressed before the window began")
    pressed = [e.sample for e in within if e.mask & EMERGENCY_STOP]
    return Reason("emergency stop", f"pressed at sample {pressed[0]}") if pressed else None


def speed_unsettled(window: WindowEvidence, limits: Steadiness) -> Reason | None:
    """Speed that differs between the halves, or from part to part."""
    for side in SIDES:
        angle = window.angle[side]
        size = len(angle) // limits.parts
        if size < 2:
            continue
        speed = abs(end_to_end_speed(angle, window.rate_hz))
        limit = max(limits.speed_change, limits.speed_change_relative * speed)
        count = REVOLUTION / window.calibration.counts_per_rev[side]
        halves = _speeds(angle, len(angle) // 2, window.rate_hz)
        change = abs(halves[1] - halves[0])
        coarse = limits.counts * count * window.rate_hz
        if change > limit + coarse / (len(angle) // 2):
            return Reason("speed not settled", _rpm(f"{side} halves differ by", change, limit))
        spread = float(np.std(_speeds(angle, size, window.rate_hz)))
        if spread > limit + coarse / size:
            return Reason("speed not settled", _rpm(f"{side} parts scatter by", spread, limit))
    return None


def speed_off(window: WindowEvidence, limits: Steadiness) -> Reason | None:
    """Speed away from its set-point, where there is one."""
    for side, target in (("sun", window.setpoints.speed_sun), ("ring", window.setpoints.speed_ring)):
        speed = end_to_end_speed(window.angle[side], window.rate_hz)
        if target is None or math.isnan(speed):
            continue
        limit = limits.speed_offset + limits.speed_offset_relative * abs(target)
        if abs(speed - target) > limit:
            detail = f"{side} at {speed / RPM:.2f} rpm, set {target / RPM:.2f} rpm"
            return Reason("speed off set-point", f"{detail}, limit {limit / RPM:.2f} rpm")
    return None


def torque_unsettled(window: WindowEvidence, limits: Steadiness) -> Reason | None:
    """Torque that still drifts, steps or strays, beyond noise and beyond what matters."""
    for side, means in window.batches.items():
        if len(means) < FEWEST_MEANS:
            continue
        limit = limits.torque_drift * window.calibration[side].nominal_torque
        for what, change, error in _torque_changes(means):
            if abs(change) > limit and abs(change) > limits.torque_drift_sigmas * error:
                detail = f"{side} {what} {change * 1e3:+.1f} mN m, limit {limit * 1e3:.1f} mN m"
                return Reason("torque not settled", detail)
    return None


def _torque_out_of_range(window: WindowEvidence, limits: Steadiness) -> Reason | None:
    """Torque beyond the nominal range, or a frequency outside the rated band; readings there are bounds."""
    for side in SIDES:
        transducer = window.calibration[side]
        sound = np.isfinite(window.torque[side])
        if not sound.any():
            continue
        torque = window.torque[side] if sound.all() else window.torque[side][sound]
        ends = np.array([torque.min(), torque.max()])
        largest = float(np.max(np.abs(ends)))
        if largest > transducer.nominal_torque:
            detail = f"{side} up to {largest:.3f} N m, nominal {transducer.nominal_torque:g} N m"
            return Reason("torque out of range", detail)
        low, high = sorted(transducer.frequency(ends).tolist())
        if low < limits.frequency_low or high > limits.frequency_high:
            detail = f"{side} at {low:.0f} to {high:.0f} Hz"
            expected = f"{limits.frequency_low:.0f} to {limits.frequency_high:.0f} Hz"
            return Reason("torque out of range", f"{detail}, rated {expected}")
    return None


CHECKS: tuple[Callable[[WindowEvidence, Steadiness], Reason | None], ...] = (
    _too_short,
    gaps,
    _flagged,
    _faulty,
    _emergency_stop,
    speed_unsettled,
    speed_off,
    torque_unsettled,
    _torque_out_of_range,
)
"""Every check that a window must meet."""


def _overlaps(start: int, stop: int, window: WindowEvidence) -> bool:
    return start < window.stop and stop > window.first


def _speeds(angle: Array, size: int, rate_hz: float) -> Array:
    """Speeds of the consecutive parts of that many samples, each from end to end [rad/s]."""
    starts = np.arange(len(angle) // size) * size
    return np.asarray((angle[starts + size - 1] - angle[starts]) * rate_hz / (size - 1))


def _torque_changes(means: Array) -> tuple[tuple[str, float, float], ...]:
    r"""Evidence against one level, in words, with its size and standard error [N m].

    Parameters
    ----------
    means : (b,) array
        Means of consecutive batches [N m]: a tenth of the window each, so that noise is decorrelated and ripple gone.

    Notes
    -----
    A change along a straight line, a difference between the halves, the largest excursion of one batch from the
    median. The noise of a batch is estimated from differences of neighbours without the largest quarter of them,
    which neither a drift, nor a step, nor a batch that strays can hide behind: against the scatter about its own
    straight line, a step in the middle of ten batches is never more than 4.9 standard errors.
    """
    b = len(means)
    differences = np.diff(means)
    sizes = np.sort(np.abs(differences - np.median(differences)))
    kept = sizes[: len(sizes) - max(1, len(sizes) // 4)]
    noise = TRIMMED * math.sqrt(0.5 * float(np.mean(kept**2)))
    place = (np.arange(b) + 0.5) / b - 0.5
    weight = float(np.sum(place**2))
    half = b // 2
    off = means - np.median(means)
    return (
        ("changes over the window by", float(np.sum(place * means)) / weight, noise / math.sqrt(weight)),
        (
            "differs between the halves by",
            float(means[-half:].mean() - means[:half].mean()),
            noise * math.sqrt(2 / half),
        ),
        ("strays in one batch by", float(off[np.argmax(np.abs(off))]), noise),
    )


def _rpm(what: str, value: float, limit: float) -> str:
    return f"{what} {value / RPM:.3f} rpm, limit {limit / RPM:.3f} rpm"
