"""Clock marks: whether the sample clock and the time of day go together."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.channels import SHARED_CLOCK
from pmg.pipeline.recording.checks.stretches import NAMED_FAULTS
from pmg.pipeline.recording.findings import Code
from pmg.sim.signals import NORMAL_MAD

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.layouts.wire import ClockMark
    from pmg.pipeline.recording.run_records import RunInfo
    from pmg.sim.signals import Array

TOPIC = "/sys/clock"
EARLIEST = datetime(2000, 1, 1, tzinfo=UTC)
"""Times before this are those of a clock that was never set, and counts from 1970."""
LATEST = datetime(2200, 1, 1, tzinfo=UTC)
"""Times after this are damage."""
FARTHEST_S = 3600.0
"""Longest time before and after the record that a mark may lie [s]."""
TOLERANCE_S = 1.0
"""Disagreement of the clock marks with `started_at` that is reported [s]."""
SMALLEST_JUMP_S = 1e-3
"""Smallest step of the time of day against the samples that is reported [s]."""
LARGEST_U_NS = 1e12
"""Uncertainties of a mark beyond this, or below zero, say nothing and are taken as not given [ns]."""
JUMP_SIGMAS = 6.0
"""A jump is also this many standard uncertainties of the marks, and this many of their own scatter."""
DRIFT_NOTED, DRIFT_WRONG = 200e-6, 1e-3
"""Relative drift that no sound oscillator has, and that which makes speeds wrong by as much."""
DRIFT_SIGMAS = 3.0


@dataclass(frozen=True)
class _ClockFit:
    """The sample clock against UTC.

    Parameters
    ----------
    drift : float
        Relative excess of the true sample rate over the declared one; NaN with fewer than two marks.
    u_drift : float
        Its standard uncertainty, from that of the marks and their scatter about the line.
    jumps : tuple of (int, int, float)
        Steps of UTC against the samples: between which samples, and by how much [s].
    """

    drift: float
    u_drift: float
    jumps: tuple[tuple[int, int, float], ...]


def _fit_clock(marks: Sequence[ClockMark], rate_hz: float) -> _ClockFit:
    r"""The sample clock against UTC, from marks in the order of their samples.

    Notes
    -----
    The interval of one sample is the median of the intervals between neighbouring marks, so that a jump does not
    move it. A jump is a step of UTC that this interval does not explain. The drift is the slope of a line through
    the marks, the jumps taken out,

    .. math:: u^2 = \frac{\bar u^2 + s^2}{\sum_k (t_k - \bar t)^2}.
    """
    if len(marks) < 2:
        return _ClockFit(math.nan, math.nan, ())
    sample = np.array([m.sample for m in marks], dtype=np.int64)
    nominal = (sample - sample[0]) / rate_hz
    excess = np.array([m.utc_ns - marks[0].utc_ns for m in marks], dtype=np.int64) * 1e-9 - nominal
    u = np.array([m.u_ns * 1e-9 if 0.0 <= m.u_ns < LARGEST_U_NS else 0.0 for m in marks])
    steps, spans = np.diff(excess), np.diff(nominal)
    apart = spans > 0.0
    slope = float(np.median(steps[apart] / spans[apart])) if np.count_nonzero(apart) > 1 else 0.0
    off = steps - slope * spans
    scatter = NORMAL_MAD * float(np.median(np.abs(off))) if len(off) > 2 else 0.0
    limit = np.maximum(SMALLEST_JUMP_S, JUMP_SIGMAS * np.hypot(np.hypot(u[1:], u[:-1]), scatter))
    limit = np.maximum(limit, (DRIFT_WRONG if len(off) < 3 else 0.0) * spans * 10.0)
    jumped = np.abs(off) > limit
    jumps = tuple((int(sample[k]), int(sample[k + 1]), float(off[k])) for k in np.flatnonzero(jumped))
    calm = excess - np.concatenate(([0.0], np.cumsum(np.where(jumped, off, 0.0))))
    return _ClockFit(*_line(nominal, calm, u), jumps)


def _line(t: Array, excess: Array, u: Array) -> tuple[float, float]:
    """Drift and its standard uncertainty."""
    centred = t - t.mean()
    weight = float(np.sum(centred**2))
    if weight == 0.0:
        return math.nan, math.nan
    slope = float(np.sum(centred * excess)) / weight
    rest = excess - excess.mean() - slope * centred
    variance = float(np.sum(rest**2)) / (len(t) - 2) if len(t) > 2 else 0.0
    return -slope / (1.0 + slope), math.sqrt((float(np.mean(u**2)) + variance) / weight)


def sound_marks(
    marks: Sequence[ClockMark], run: RunInfo, span: tuple[int, int], rate_hz: float, findings: Findings
) -> tuple[ClockMark, ...]:
    """The marks that tell a time of day, in file order; those that do not, jumps and drift become findings.

    Parameters
    ----------
    marks : sequence of ClockMark
        As recorded, of all clocks.
    run : RunInfo
        Says when the run began.
    span : (int, int)
        Sample indices of the record, the end left out.
    rate_hz : float
        Declared sample rate [Hz].
    findings : Findings
        Receives what is wrong.
    """
    if run.started_at < EARLIEST:
        findings.warning(
            Code.CLOCK_UNSET,
            "pmg.run.started_at",
            f"{run.started_at.isoformat()}; expected a time after {EARLIEST.year}",
            "The clock of the recorder's computer was not set: the order of the runs cannot be trusted.",
        )
    kept = tuple(m for m in marks if _tells_time(m, span, rate_hz))
    bad = [m for m in marks if not _tells_time(m, span, rate_hz)]
    if bad:
        findings.error(
            Code.CLOCK_UNSET,
            TOPIC,
            f"{len(bad)} of {len(marks)} marks, the first of sample {bad[0].sample}, {bad[0].utc_ns} ns after 1970, "
            f"tell a time before {EARLIEST.year} or after {LATEST.year}, or lie far from the record; expected the time "
            "of day at samples of the run. They are left out",
            "The clock was not set yet: wait for it before the test begins.",
            sample_range=(min(m.sample for m in bad), max(m.sample for m in bad) + 1),
            kept=f"{len(kept)} marks",
            lost=f"{len(bad)} marks",
        )
    shared = sorted((m for m in kept if m.clock_id == SHARED_CLOCK), key=lambda m: m.sample)
    fit = _fit_clock(shared, rate_hz)
    _tell(fit, rate_hz, (shared[0].sample, shared[-1].sample + 1) if shared else (0, 0), findings)
    offset = mark_offset_s(kept, span[0], rate_hz, run.started_at)
    if offset is not None and abs(offset) > TOLERANCE_S:
        findings.warning(
            Code.CLOCK_DISAGREES,
            TOPIC,
            f"the first sample is {offset:+.3f} s off started_at; expected less than {TOLERANCE_S:g} s. "
            "The clock marks are used",
            "Check the time of the recorder's computer.",
        )
    return kept


def _tells_time(mark: ClockMark, span: tuple[int, int], rate_hz: float) -> bool:
    """Whether a mark pairs a sample near the record with a time of this age; other clocks count other samples."""
    timely = EARLIEST.timestamp() * 1e9 <= mark.utc_ns <= LATEST.timestamp() * 1e9
    far = FARTHEST_S * rate_hz
    return timely and (mark.clock_id != SHARED_CLOCK or span[0] - far <= mark.sample <= span[1] + far)


def _tell(fit: _ClockFit, rate_hz: float, ends: tuple[int, int], findings: Findings) -> None:
    for start, stop, step in fit.jumps[:NAMED_FAULTS]:
        findings.warning(
            Code.CLOCK_JUMP,
            TOPIC,
            f"between samples {start} and {stop} the time of day jumps by {step:+.4f} s against the samples; expected "
            "both to go together",
            "The clock was set during the run, or samples were lost without a gap of the index. Times after it are "
            "by the new time; speeds within the run do not depend on it.",
            sample_range=(start, stop + 1),
            kept="all samples",
        )
    if len(fit.jumps) > NAMED_FAULTS:
        findings.warning(
            Code.CLOCK_JUMP,
            TOPIC,
            f"{len(fit.jumps) - NAMED_FAULTS} more jumps of the time of day; expected none",
            "Treat them as those listed.",
            sample_range=(fit.jumps[NAMED_FAULTS][0], fit.jumps[-1][1] + 1),
        )
    if abs(fit.drift) > max(DRIFT_NOTED, DRIFT_SIGMAS * fit.u_drift):
        wrong = abs(fit.drift) > DRIFT_WRONG
        (findings.error if wrong else findings.warning)(
            Code.CLOCK_DRIFT,
            TOPIC,
            f"the sample clock runs at {rate_hz * (1.0 + fit.drift):.6g} Hz, {fit.drift * 1e6:+.1f} ppm "
            f"(u = {fit.u_drift * 1e6:.1f} ppm) off rate_hz; expected less than {DRIFT_NOTED * 1e6:.0f} ppm",
            "Speeds are in terms of rate_hz and off by as much: correct rate_hz in the recorder.",
            sample_range=ends,
            kept="all samples",
        )


def mark_offset_s(marks: Sequence[ClockMark], sample: int, rate_hz: float, started_at: datetime) -> float | None:
    """Time of a sample after `started_at` by the clock marks [s]; None without marks of the shared clock."""
    shared = sorted((m for m in marks if m.clock_id == SHARED_CLOCK), key=lambda m: m.sample)
    if not shared:
        return None
    mark = max((m for m in shared if m.sample <= sample), key=lambda m: m.sample, default=shared[0])
    start_us = round(started_at.timestamp() * 1e6)
    return (mark.utc_ns // 1000 - start_us) / 1e6 + (sample - mark.sample) / rate_hz
