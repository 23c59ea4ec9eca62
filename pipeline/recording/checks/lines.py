"""Digital inputs: whether samples and events tell the same, and when the emergency stop was pressed."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.blocks import LARGEST_INDEX
from pmg.pipeline.recording.checks.stretches import NAMED_FAULTS, stretches, tell_stretches
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.frequency import Decoded
    from pmg.pipeline.recording.layouts.wire import LineEvent

EVENTS = "/events/lines"
EMERGENCY_STOP = 1
"""Bit that is set while the emergency stop is pressed."""
SLACK = 1
"""Samples by which an event and the sampled lines may differ: the edge falls between two samples."""


def check_lines(lines: Decoded | None, events: Sequence[LineEvent], findings: Findings) -> None:
    """Tell where events and samples of the digital inputs contradict each other, and the emergency stop.

    Parameters
    ----------
    lines : Decoded, optional
        Sampled masks.
    events : sequence of LineEvent
        Changes, in the order of their samples.
    findings : Findings
        Receives what is found.
    """
    faults = [
        (
            before.sample,
            event.sample + 1,
            f"event at sample {event.sample} changes {before.mask ^ event.mask:#x} and says {event.changed:#x}",
        )
        for before, event in pairwise(events)
        if before.mask ^ event.mask != event.changed
    ]
    if lines is not None and len(lines.values):
        masks = lines.values.astype(np.int64)
        for event in events:
            at = event.sample - lines.first
            near = slice(max(0, at - SLACK), max(0, at + SLACK + 1))
            if lines.present[near].any() and event.mask not in masks[near][lines.present[near]]:
                came = (
                    f"event at sample {event.sample} says {event.mask:#x}, the samples there {int(masks[near][0]):#x}"
                )
                faults.append((event.sample, event.sample + 1, came))
        if events:
            explained = {event.sample + lag for event in events for lag in range(-SLACK, SLACK + 1)}
            steps = np.flatnonzero((np.diff(masks) != 0) & lines.present[1:] & lines.present[:-1]) + 1 + lines.first
            alone = [int(step) for step in steps if int(step) not in explained]
            faults += [(s, s + 1, f"the samples change at {s} without an event") for s in alone]
    for start, stop, what in faults[:NAMED_FAULTS]:
        findings.warning(
            Code.LINES_DISAGREE,
            EVENTS,
            f"{what}; expected events and samples to agree",
            "An event was lost, or a line bounces. Windows are judged by both.",
            sample_range=(start, stop),
            kept="both",
        )
    if len(faults) > NAMED_FAULTS:
        findings.warning(
            Code.LINES_DISAGREE,
            EVENTS,
            f"the same in {len(faults) - NAMED_FAULTS} more places; expected events and samples to agree",
            "An event was lost, or a line bounces. Windows are judged by both.",
            sample_range=(min(f[0] for f in faults[NAMED_FAULTS:]), max(f[1] for f in faults[NAMED_FAULTS:])),
        )
    words = (
        "were taken with the emergency stop pressed",
        "it released",
        "Windows over them are rejected. Look up why in the bench's log.",
    )
    if lines is not None:
        pressed = stretches(((lines.values.astype(np.int64) & EMERGENCY_STOP) > 0) & lines.present) + lines.first
        tell_stretches(findings.info, Code.EMERGENCY_STOP, lines.topic, pressed, words, kept="all samples")
    else:
        ends = [(a.sample, b.sample) for a, b in pairwise(events) if a.mask & EMERGENCY_STOP]
        ends += [(last.sample, last.sample + 1) for last in events[-1:] if last.mask & EMERGENCY_STOP]
        ends = [pair for pair in ends if pair[1] < LARGEST_INDEX]
        found = np.array(ends, dtype=np.int64).reshape(-1, 2)
        tell_stretches(findings.info, Code.EMERGENCY_STOP, EVENTS, found, words, kept="all samples")
