"""Where a recording lost what it should hold: points without a measurement, gaps with steps in them, its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.checks.stretches import stretches
from pmg.pipeline.recording.findings import Code, Severity
from pmg.pipeline.recording.run_records import Setpoints

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.recording.events import SequenceStep
    from pmg.pipeline.recording.findings import Finding
    from pmg.pipeline.recording.read import Recording

LOSSES = (Code.TRUNCATED, Code.CHUNK_LOST, Code.TOO_LARGE, Code.SKIPPED, Code.RECORD_LOST)
"""Findings of the container after which samples may be missing at an end, where no index tells of them."""
GAP = "gap:"
"""Start of the reason of a stretch that lost its samples, and maybe its steps."""


@dataclass(frozen=True)
class Hole:
    """A stretch that should have given a test point and cannot.

    Parameters
    ----------
    point : str
        Test point; where it is not known, the name of the file with ``gap`` and a number.
    first, stop : int
        Sample indices, `stop` left out.
    setpoints : Setpoints
        What was asked for, as far as it is known.
    why : str
        What was lost.
    """

    point: str
    first: int
    stop: int
    setpoints: Setpoints
    why: str


@dataclass(frozen=True)
class LostEnd:
    """Losses of a file of one window after that window.

    Parameters
    ----------
    planned : int or None
        Sample index at which the window would have ended; None where nothing tells.
    remark : str
        What was lost; empty where nothing was.
    """

    planned: int | None
    remark: str


def stem(recording: Recording) -> str:
    """Name of the file without folder and ending."""
    return recording.file.rsplit("/", 1)[-1].removesuffix(".mcap")


def missing_channels(recording: Recording) -> tuple[str, ...]:
    """Why no window of a recording can stand that lacks a torque or an angle; empty where it has all."""
    named = [f"{' '.join(reversed(name.split('_')))} {why}" for name, why in recording.lacking.items()]
    return (f"channel missing: {', '.join(named)}",) if named else ()


def holes(recording: Recording, measured: Sequence[tuple[int, int]], shortest: int) -> tuple[Hole, ...]:
    """Points of a sequence without MEASURE, and gaps outside the windows.

    Parameters
    ----------
    recording : Recording
        A run with test steps.
    measured : sequence of (int, int)
        First sample and the one after the last of each window from MEASURE on.
    shortest : int
        Samples of the shortest gap in which a window may have been lost.

    Notes
    -----
    Steps of one point from START on belong together. Of a point whose START was lost with its MEASURE, and of which an
    END is left, the stretch begins where the steps before it end. A gap is where any channel has no value.
    """
    found = list(_unmeasured(recording))
    known = np.logical_and.reduce([np.isfinite(recording.samples[name].to_numpy()) for name in recording.recorded])
    for first, stop in (*measured, *((hole.first, hole.stop) for hole in found)):
        known[max(0, first - recording.first_sample) : max(0, stop - recording.first_sample)] = True
    gaps = [(a, b) for a, b in (stretches(~known) + recording.first_sample).tolist() if b - a >= shortest]
    for number, (first, stop) in enumerate(gaps, 1):
        why = f"{GAP} samples {first} to {stop} are missing outside any window; a point may be lost with its steps"
        found.append(Hole(f"{stem(recording)}-gap-{number:02d}", first, stop, Setpoints(), why))
    return tuple(found)


def lost_end(recording: Recording, first: int, stop: int) -> LostEnd:
    """Known end of a window that lasts over the whole file, from sample `first` to `stop`.

    Notes
    -----
    Where some channels go on, the window was meant to last as long. Where the recorder counted more messages than were
    read, the same part of the samples is taken to be missing: channels are written in turn. Else nothing tells.
    """
    planned, remarks = None, []
    if stop < recording.stop_sample:
        planned = recording.stop_sample
        remarks.append(f"remark: channels end at sample {stop} and others at {recording.stop_sample}")
    counted = [share for f in recording.findings if f.code is Code.COUNT and (share := _share(f)) is not None]
    if counted:
        columns = recording.recorded
        values = sum(int(np.isfinite(recording.samples[name].to_numpy()).sum()) for name in columns) / len(columns)
        planned = max(planned or 0, first + round(values / counted[0]))
        remarks.append(f"remark: {1.0 - counted[0]:.0%} of the messages that the recorder counted are missing")
    losses = [f for f in recording.findings if f.code in LOSSES and f.severity is Severity.ERROR]
    if losses:
        text = ", ".join(dict.fromkeys(f"{f.code.value} at {f.where}" for f in losses[:2]))
        length = "" if planned else "; how long the window was meant to be is not known"
        remarks.append(f"remark: the file lost data ({text}){length}")
    return LostEnd(planned, "; ".join(remarks))


def _share(finding: Finding) -> float | None:
    """Part of the counted messages that was read; None where none are missing."""
    kept, lost = (int(text.partition(" ")[0] or 0) for text in (finding.kept, finding.lost))
    return kept / (kept + lost) if kept and lost else None


def _unmeasured(recording: Recording) -> Iterator[Hole]:
    """Points of which steps are left, and no MEASURE among them."""
    groups = _together(recording.steps)
    for place, steps in enumerate(groups):
        if any(step.phase == "MEASURE" for step in steps):
            continue
        first, last = steps[0], steps[-1]
        after = groups[place + 1][0].sample if place + 1 < len(groups) else recording.stop_sample
        begin = first.sample
        if first.phase == "END":
            begin = groups[place - 1][-1].sample if place else recording.first_sample
        stop = last.sample if last.phase == "END" else max(after, begin)
        phases = ", ".join(step.phase for step in steps)
        why = f"not measured: samples {begin} to {stop} hold {phases} and no MEASURE"
        why += "; the recording ends there" if stop == recording.stop_sample else ""
        yield Hole(first.point, begin, stop, last.setpoints, why)


def _together(steps: Sequence[SequenceStep]) -> list[list[SequenceStep]]:
    """Steps of one point each, a START beginning a new group."""
    groups: list[list[SequenceStep]] = []
    for step in steps:
        if not groups or step.phase == "START" or step.point != groups[-1][-1].point:
            groups.append([])
        groups[-1].append(step)
    return groups
