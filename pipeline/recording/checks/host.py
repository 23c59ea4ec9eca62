"""The times at which the host wrote the messages, against the declared sample rate and start."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

from pmg.pipeline.recording.checks.clock import EARLIEST
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.frequency import Decoded
    from pmg.pipeline.recording.run_records import RunInfo

FEWEST_BLOCKS = 5
"""Blocks of a channel from which the times of the first and the last tell a rate."""
SHORTEST_S = 1.0
"""And the time that lies between both [s]."""
RATE_LIMIT = 0.05
"""Part by which the rate of the blocks may be off that of the samples: the host writes when it finds the time."""
BUFFERED = 0.2
"""Part of the time of the samples below which blocks were held back and written together: they tell no rate."""
START_LIMIT_S = 60.0
"""How far the first block may be from the declared start [s]; recorders begin to write within seconds."""


def check_host(
    logged: Mapping[str, Topic], tracks: Iterable[Decoded], run: RunInfo, holds_all: bool, findings: Findings
) -> None:
    """Hold the log times of the sample channels against rate and start; what contradicts is a finding.

    Parameters
    ----------
    logged : mapping of str to Topic
        Channels by topic, with the log times of their first and last message.
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
        topic = logged.get(track.topic)
        if topic is None or topic.logged is None:
            continue
        first, last = (1e-9 * time for time in topic.logged)
        starts.append(first)
        _check_rate(topic, track, last - first, findings)
    if starts and min(starts) >= EARLIEST.timestamp() and holds_all:
        off = min(starts) - run.started_at.timestamp()
        if abs(off) > START_LIMIT_S:
            began = datetime.fromtimestamp(min(starts), UTC).isoformat(timespec="seconds")
            findings.warning(
                Code.START_DISAGREES,
                "started_at",
                f"the host wrote the first block at {began}, {abs(off):.0f} s {'after' if off > 0 else 'before'} the "
                f"declared start {run.started_at.isoformat(timespec='seconds')}; limit {START_LIMIT_S:g} s",
                "Correct started_at or the host's clock: the order of the runs follows started_at.",
            )


def _check_rate(topic: Topic, track: Decoded, took: float, findings: Findings) -> None:
    samples, blocks = track.stop - track.first, topic.count
    meant = samples / track.rate_hz * (blocks - 1) / max(1, blocks)
    if blocks < FEWEST_BLOCKS or meant < SHORTEST_S or not took > BUFFERED * meant:
        return
    off = meant / took - 1.0
    if abs(took - meant) > max(RATE_LIMIT * meant, 2.0 * meant / blocks):
        findings.error(
            Code.RATE_DISAGREES,
            track.topic,
            f"the host wrote its {blocks} blocks within {took:.2f} s, at the declared {track.rate_hz:g} Hz they last "
            f"{meant:.2f} s; off by {100 * off:+.0f} %, limit {100 * RATE_LIMIT:g} %",
            "Correct rate_hz in the recorder: speeds and times are wrong by this factor.",
        )
