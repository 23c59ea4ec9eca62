"""Signals derived from a recording: torques, speeds, powers and flags, as means over equal stretches of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.checks.lines import EMERGENCY_STOP
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.windows.limits import LIMITS
from pmg.pipeline.windows.windows import find_windows
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import RecordingError
from pmg.sim.signals import LOSS_TOTAL, POWER_RING, POWER_SUN, SPEED_RING, SPEED_SUN, TORQUE_RING, TORQUE_SUN

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy.typing as npt

    from pmg.pipeline.recording.read import Recording
    from pmg.pipeline.windows.limits import Steadiness
    from pmg.sim.signals import Array, Mask, Signal

DERIVED = (TORQUE_SUN, TORQUE_RING, SPEED_SUN, SPEED_RING, POWER_SUN, POWER_RING, LOSS_TOTAL)
"""Signals that are written."""

SPAN_S = 0.02
"""Shortest time over which a speed is taken [s]: over one sample at 10 kS/s, one count is 117 rpm."""

FLAGS = {
    "emergency_stop": "the emergency stop is pressed",
    "missing": "a sample of torque or angle is missing",
    "overrun": "the recorder marks lost samples or a restart",
    "saturated": "the recorder marks an input beyond its range",
    "window_accepted": "inside a window that passed every check",
    "window_rejected": "inside a window that failed a check",
    "slipped": "an encoder lost counts against its index pulse",
    "stuck": "a torque stood still, as of a transducer that hangs",
    "shunt": "the shunt of a torque transducer was switched in",
}
"""Flags by name, the first in bit 0, and what each means."""
KINDS = {
    Code.OVERRUN: "overrun",
    Code.RESTART: "overrun",
    Code.SATURATED: "saturated",
    Code.ENCODER_SLIPPED: "slipped",
    Code.STUCK: "stuck",
    Code.SHUNT: "shunt",
}
"""Flag of a stretch that is spoilt, by what spoilt it."""


@dataclass(frozen=True)
class Derived:
    """Signals of a recording over consecutive stretches of time.

    Parameters
    ----------
    rate_hz : float
        Stretches per second [Hz].
    first : int
        Number of the first stretch: stretch k begins k / rate after sample 0.
    span_s : float
        Time over which each speed is taken [s].
    values : mapping of Signal to (n,) array
        In SI; NaN where nothing is known.
    flags : (n,) array of uint32
        Bits of `FLAGS`.
    points : tuple of (point, int, int)
        Windows: name of the test point, first stretch, and the one after the last.
    """

    rate_hz: float
    first: int
    span_s: float
    values: Mapping[Signal, Array]
    flags: npt.NDArray[np.uint32]
    points: tuple[tuple[str, int, int], ...]


def derive(recording: Recording, rate_hz: float | None = None, limits: Steadiness = LIMITS) -> Derived:
    """The signals at a rate, or at that of the samples.

    Parameters
    ----------
    recording : Recording
        In SI.
    rate_hz : float, optional
        Stretches per second [Hz], at most the sample rate.
    limits : Steadiness
        By which windows are found and judged.

    Raises
    ------
    RecordingError
        When the rate is not positive, or above that of the samples.

    Notes
    -----
    A torque is the mean over the samples of its stretch. A speed is the difference of the angles from end to end,
    over the stretch or, where that is shorter, over `SPAN_S` about its middle (at the ends of the recording, over its
    first and last samples). A power is the product of the two. A
    flag is set where it holds in any sample of the stretch.
    """
    rate = recording.rate_hz if rate_hz is None else rate_hz
    if not 0.0 < rate <= recording.rate_hz:
        came, expected = f"{rate:g} Hz", f"a positive rate of at most {recording.rate_hz:g} Hz, that of the samples"
        raise RecordingError(f"{recording.file}: rate", came, expected, "Name a lower rate.")
    first, edges = _edges(recording, rate)
    table = {name: recording.samples[name].to_numpy() for name in recording.samples.columns if name != "lines"}
    span = max(1, int((edges[1:] - edges[:-1]).min()), round(SPAN_S * recording.rate_hz))
    middle = (edges[1:] + edges[:-1]) / 2.0
    values: dict[Signal, Array] = {}
    for torque, speed, power, side in (
        (TORQUE_SUN, SPEED_SUN, POWER_SUN, "sun"),
        (TORQUE_RING, SPEED_RING, POWER_RING, "ring"),
    ):
        values[torque] = _means(table[f"torque_{side}"], edges)
        values[speed] = _speeds(table[f"angle_{side}"], middle, span, recording.rate_hz)
        values[power] = values[torque] * values[speed]
    values[LOSS_TOTAL] = values[POWER_SUN] + values[POWER_RING]
    masks, points = _masks(recording, table, edges, first, limits)
    flags = np.zeros(len(edges) - 1, dtype=np.uint32)
    for bit, name in enumerate(FLAGS):
        flags |= (np.logical_or.reduceat(masks[name], edges[:-1]).astype(np.uint32)) << np.uint32(bit)
    return Derived(rate, first, span / recording.rate_hz, {s: values[s] for s in DERIVED}, flags, points)


def _edges(recording: Recording, rate: float) -> tuple[int, npt.NDArray[np.int64]]:
    """Number of the first whole stretch, and the rows at which each begins, the end after the last next to them."""
    n, start, ratio = recording.samples.height, recording.first_sample, recording.rate_hz / rate
    first, stop = int(np.ceil(start / ratio - 1e-9)), int(np.floor((start + n) / ratio + 1e-9))
    if stop <= first:
        came, do = counted(n, "sample"), "Name a higher rate, or another recording."
        raise RecordingError(recording.file, came, f"at least one stretch of 1/{rate:g} s", do)
    edges = np.ceil(np.arange(first, stop + 1) * ratio - 1e-6).astype(np.int64) - start
    return first, np.minimum(edges, n)


def _means(values: Array, edges: npt.NDArray[np.int64]) -> Array:
    """Means over the known samples of each stretch; NaN where none is known."""
    known = np.isfinite(values)
    sums = np.add.reduceat(np.where(known, values, 0.0)[: edges[-1]], edges[:-1])
    counts = np.add.reduceat(known[: edges[-1]].astype(np.int64), edges[:-1])
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def _speeds(angle: Array, middle: Array, span: int, rate_hz: float) -> Array:
    """Speed about each place [rad/s], from the angles that many samples apart; at the ends, the outermost ones."""
    last = len(angle) - 1
    low = np.clip(np.floor(middle - span / 2.0 + 0.5).astype(np.int64), 0, max(last - span, 0))
    high = np.minimum(low + span, last)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((angle[high] - angle[low]) * rate_hz / (high - low))


def _masks(
    recording: Recording, table: Mapping[str, Array], edges: npt.NDArray[np.int64], first: int, limits: Steadiness
) -> tuple[dict[str, Mask], tuple[tuple[str, int, int], ...]]:
    """Flags sample by sample, and the windows in stretches."""
    n, start = recording.samples.height, recording.first_sample
    masks = {name: np.zeros(n, dtype=np.bool_) for name in FLAGS}
    masks["emergency_stop"] |= _stopped(recording)
    for name in ("torque_sun", "torque_ring", "angle_sun", "angle_ring"):
        masks["missing"] |= ~np.isfinite(table[name])
    for blemish in recording.blemishes:
        masks[KINDS[blemish.code]][max(blemish.start - start, 0) : max(blemish.stop - start, 0)] = True
    points = []
    for window in find_windows(recording, limits):
        low, high = window.first_sample - start, window.stop_sample - start
        masks["window_accepted" if window.accepted else "window_rejected"][max(low, 0) : max(high, 0)] = True
        inside = first + np.flatnonzero((edges[:-1] >= low) & (edges[1:] <= high))
        if len(inside):
            points.append((window.point, int(inside[0]), int(inside[-1]) + 1))
    return {name: mask[: edges[-1]] for name, mask in masks.items()}, tuple(points)


def _stopped(recording: Recording) -> Mask:
    """Whether the emergency stop is pressed at each sample: by the sampled lines, and by the events between them."""
    n, start = recording.samples.height, recording.first_sample
    found = np.asarray((recording.samples["lines"].fill_null(0).to_numpy() & EMERGENCY_STOP) > 0)
    events = recording.line_events
    if not events:
        return found
    begins = np.clip([event.sample - start for event in events], 0, n)
    states = [events[0].mask ^ events[0].changed, *(event.mask for event in events)]
    edges = [0, *begins.tolist(), n]
    for state, low, high in zip(states, edges[:-1], edges[1:], strict=True):
        found[low:high] |= bool(state & EMERGENCY_STOP)
    return found
