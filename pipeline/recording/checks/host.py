"""The times at which the host wrote the messages, against the declared sample rate and start."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.checks.clock import EARLIEST, LATEST
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from array import array
    from collections.abc import Iterable, Mapping

    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.frequency import Decoded
    from pmg.pipeline.recording.run_records import RunInfo
    from pmg.sim.signals import Array

FEWEST_BLOCKS = 5
"""Blocks of a channel from which the times of the first and the last tell a rate."""
SHORTEST_S = 1.0
"""And the time that lies between both [s]."""
RATE_LIMIT = 0.05
"""Part by which the rate of the blocks may be off that of the samples: the host writes when it finds the time."""
EVEN = 3.0
"""Longest time between two blocks over the middle one, up to which they were written as they came."""
TOLD = 0.05
"""Part of the time of the samples below which the log times are none: counts, or those of a later copy."""
REARRANGED = (
    Code.RESTART,
    Code.SAMPLES_DUPLICATE,
    Code.SAMPLES_CONFLICT,
    Code.SAMPLES_ASTRAY,
    Code.SAMPLES_GAP,
    Code.CHUNK_DUPLICATE,
    Code.CHUNK_LOST,
    Code.RECORD_LOST,
    Code.TRUNCATED,
    Code.MESSAGE_MALFORMED,
)
"""Findings after which the messages of a channel are not its samples one after another."""
START_LIMIT_S = 60.0
"""How far the first block may be from the declared start [s]; recorders begin to write within seconds."""


def check_host(
    logged: Mapping[str, array[int]], tracks: Iterable[Decoded], run: RunInfo, holds_all: bool, findings: Findings
) -> None:
    """Hold the log times of the sample channels against rate and start; what contradicts is a finding.

    Parameters
    ----------
    logged : mapping of str to (n,) array of int
        Log time of each message [ns], by topic.
    tracks : iterable of Decoded
        Channels in SI.
    run : RunInfo
        Declares the start.
    holds_all : bool
        Whether the file begins with the start of the run: its first sample is number 0.
    findings : Findings
        Receives what contradicts.

    Notes
    -----
    Log times are never sample times: they jitter by what the host does besides. A clock that was never set
    (before 2000) says nothing of the start.
    """
    starts = []
    for track in tracks:
        times = np.frombuffer(logged[track.topic], dtype=np.uint64).astype(np.float64) * 1e-9
        if not len(times):
            continue
        starts.append(float(times.min()))
        if not any(f.code in REARRANGED for f in findings.gathered):
            _check_rate(times, track, findings)
    if starts and min(starts) >= EARLIEST.timestamp() and holds_all:
        off = min(starts) - run.started_at.timestamp()
        if abs(off) > START_LIMIT_S:
            began = datetime.fromtimestamp(min(min(starts), LATEST.timestamp()), UTC).isoformat(timespec="seconds")
            findings.info(
                Code.START_DISAGREES,
                "started_at",
                f"the host wrote the first block at {began}, {abs(off):.0f} s {'after' if off > 0 else 'before'} the "
                f"declared start {run.started_at.isoformat(timespec='seconds')}; limit {START_LIMIT_S:g} s",
                "Correct started_at or the host's clock: the order of the runs follows started_at.",
            )


def _check_rate(times: Array, track: Decoded, findings: Findings) -> None:
    """Hold the times of the blocks [s] against the rate; blocks that were held back and written together tell none."""
    samples, blocks = track.stop - track.first, len(times)
    meant = samples / track.rate_hz * (blocks - 1) / max(1, blocks)
    if blocks < FEWEST_BLOCKS or meant < SHORTEST_S:
        return
    steps = np.diff(times)
    took = float(times[-1] - times[0])
    if steps.min() <= 0.0 or steps.max() > EVEN * np.median(steps) or not took > TOLD * meant:
        return
    if abs(took - meant) > max(RATE_LIMIT * meant, 2.0 * meant / blocks):
        host = samples * (blocks - 1) / blocks / took
        findings.warning(
            Code.RATE_DISAGREES,
            track.topic,
            f"by the times at which the host wrote its {blocks} blocks the rate is {host:.4g} Hz, declared are "
            f"{track.rate_hz:g} Hz; off by the factor {host / track.rate_hz:.3g}, limit 1 +- {RATE_LIMIT:g}",
            "Correct rate_hz in the recorder: speeds and times are wrong by this factor.",
        )
