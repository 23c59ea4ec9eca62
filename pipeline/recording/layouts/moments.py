"""Where in the record the samples of a message belong: by index, by stamp, or by their order; never by log time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.channels import LARGEST_RATE
from pmg.pipeline.recording.layouts.jsonmessages import TEXT_TIME

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.layouts.layout import Columns
    from pmg.sim.signals import Array

    Places = npt.NDArray[np.int64]

INDEX_FIELDS = ("first_sample", "sample", "sample_index")
STAMP_FIELDS = ("header.stamp", "stamp", "timestamp", "header.timestamp", "time")
SECOND_FIELDS = ("sec", "secs", "seconds")
NANO_FIELDS = ("nanosec", "nsec", "nsecs", "nanos", "nanoseconds")
NS_FIELDS = ("utc_ns", "time_ns", "stamp_ns", "timestamp_ns")
S_FIELDS = ("t", "time_s", "stamp_s", "timestamp_s")
SECOND_NS = 1_000_000_000
LARGEST_S = 9e9
"""Times beyond this do not fit into a signed count of nanoseconds [s]."""
FAR = 2.0**60
"""Steps beyond this are taken as this: what is placed so far away is reported as damage when blocks are joined."""
LARGEST_NS = 2**62 - 1
"""Times and indices beyond this are taken as this, in the year 2116: the difference of two fits a signed integer."""
LATE = 0.45
"""Part of its length by which the stamp of a message may be off."""
ROUGH = 0.2
"""Standard deviation of the fractions of the steps from which on stamps do not tell samples apart; 0.29 at most."""
NICE_DIGITS, NICE = 3, 1e-4
"""Digits of a declared rate, and how near a measured rate must come to such a number to be taken as that."""


@dataclass(frozen=True)
class Moments:
    """Times of the messages of a channel, one entry for each sound message.

    Parameters
    ----------
    index : (n,) array of int or None
        Sample index of the first sample.
    stamp : (n,) array of int or None
        Time of the first sample [ns].
    field : str
        Where it stands; empty when the messages say nothing.
    """

    index: Places | None
    stamp: Places | None
    field: str


def moments_of(columns: Columns) -> Moments:
    """Index or stamps of the messages; an index that never changes is one that nobody fills in."""
    for path in INDEX_FIELDS:
        values = columns.one(path)
        if values is not None and _whole(values) and (len(values) < 2 or np.any(values != values[0])):
            return Moments(_within(values), None, path)
    for stem in STAMP_FIELDS:
        for second in SECOND_FIELDS:
            whole = columns.one(f"{stem}.{second}")
            if whole is not None:
                for nano in NANO_FIELDS:
                    part = columns.one(f"{stem}.{nano}")
                    if part is not None and _whole(whole) and _whole(part):
                        seconds = _within(whole, LARGEST_NS // SECOND_NS)
                        stamp = _within(seconds * SECOND_NS + _within(part, LARGEST_NS // 2))
                        if np.any(stamp != stamp[:1]) or len(stamp) < 2:
                            return Moments(None, stamp, stem)
    for path in (*NS_FIELDS, *(stem + TEXT_TIME for stem in STAMP_FIELDS)):
        values = columns.one(path)
        if values is not None and _whole(values):
            return Moments(None, _within(values), path.removesuffix(TEXT_TIME))
    for path in S_FIELDS:
        values = columns.one(path)
        if values is not None and np.all(np.abs(values) < LARGEST_S):
            return Moments(None, _within(np.rint(values.astype(np.float64) * SECOND_NS)), path)
    return Moments(None, None, "")


def _whole(values: npt.NDArray[Any]) -> bool:
    """Whether all numbers are whole; floating-point ones also, whether they fit into a signed integer."""
    return bool(values.dtype.kind != "f" or np.all((values == np.rint(values)) & (np.abs(values) < FAR)))


def _within(values: npt.NDArray[Any], largest: int = LARGEST_NS) -> Places:
    """Whole numbers as signed integers; those beyond the largest magnitude as that, with their sign."""
    if values.dtype == np.uint64:
        values = np.minimum(values, np.uint64(largest))
    return np.clip(values.astype(np.int64), -largest, largest)


def is_time(path: str) -> bool:
    """Whether a field tells when, not what."""
    stem = path.removesuffix(TEXT_TIME)
    last = stem.rpartition(".")[2]
    timed = any(stem == each or stem.startswith(each + ".") for each in STAMP_FIELDS)
    return timed or stem in (*INDEX_FIELDS, *NS_FIELDS, *S_FIELDS) or last in ("seq", "flags", "clock_id")


def rate_of(stamp: Places, counts: Places) -> float | None:
    """Sample rate by the stamps [Hz]: the median interval, made finer over the whole; None where they tell none."""
    passed, many = np.diff(stamp) / SECOND_NS, counts[:-1]
    sound = (passed > 0.0) & (many > 0)
    if np.count_nonzero(sound) < 2:
        return None
    coarse = 1.0 / float(np.median(passed[sound] / many[sound]))
    unit = float(np.median(many[sound]))
    steps = np.rint(passed * coarse / unit) * unit
    whole = np.concatenate(([0.0], np.cumsum(steps)))
    time = (stamp - stamp[0]) / SECOND_NS
    centred = whole - whole.mean()
    weight = float(np.sum(centred * (time - time.mean())))
    fine = float(np.sum(centred**2)) / weight if weight > 0.0 else 0.0
    if not 0.0 < fine < LARGEST_RATE:
        return None
    nice = float(f"{fine:.{NICE_DIGITS}g}")
    return nice if abs(fine / nice - 1.0) < NICE else fine


def by_stamp(stamp: Places, counts: Places, rate_hz: float, origin: int) -> tuple[Places, bool]:
    """Index of the first sample of each message, and whether the stamps had to give way to the order.

    Notes
    -----
    Each step is rounded on its own, so neither drift nor a fraction of a sample adds up; a message of many samples
    follows the one before it while its stamp is off by less than `LATE` of its length, since what is lost is lost by
    the message. Where the steps are far from whole numbers and yet as many samples came as the time between first and
    last holds, none is missing, and they follow each other in their order.
    """
    first = round(min((int(stamp[0]) - origin) / SECOND_NS * rate_hz, FAR))
    passed = np.diff(stamp) / SECOND_NS * rate_hz
    near = np.abs(passed - counts[:-1]) < LATE * counts[:-1]
    steps = np.where(near, counts[:-1], np.rint(np.clip(passed, -FAR, FAR)).astype(np.int64))
    even = bool(np.array_equal(steps, counts[:-1]))
    in_order = np.concatenate(([0], np.cumsum(counts[:-1])))
    total = float(stamp[-1] - stamp[0]) / SECOND_NS * rate_hz
    rough = len(passed) > 1 and float(np.std(passed - np.rint(passed))) > ROUGH
    if not even and rough and np.all(np.diff(stamp) > 0) and abs(total - float(in_order[-1])) < 0.5:
        return first + in_order, True
    return first + np.concatenate(([0], np.cumsum(steps))), False


def scatter(stamp: Places, rate_hz: float) -> float:
    """Standard deviation of the steps of the stamps [samples]."""
    steps: Array = np.diff(stamp) / SECOND_NS * rate_hz
    return float(np.std(steps))
