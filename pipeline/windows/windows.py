"""Stretches of a recording that may stand for a test point, and why some may not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.run_records import Setpoints
from pmg.pipeline.windows.gaps import holes, lost_end, missing_channels, stem
from pmg.pipeline.windows.limits import LIMITS
from pmg.pipeline.windows.plateaus import plateaus
from pmg.pipeline.windows.reduce import end_to_end_speed
from pmg.pipeline.windows.remarks import near_limits
from pmg.pipeline.windows.steadiness import CHECKS, REST_SPEED, Reason, WindowEvidence, gaps
from pmg.pipeline.windows.window import Window
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    import numpy.typing as npt
    import polars as pl

    from pmg.pipeline.recording.events import SequenceStep
    from pmg.pipeline.recording.read import Recording
    from pmg.pipeline.windows.limits import Steadiness


@dataclass(frozen=True)
class _Stretch:
    """A window before it is judged.

    `stop` is where it ends, None where nobody said; `planned` where it would have ended in a file that lost its end;
    `against` why it can be no test point, whatever its samples say; `remark` what is stated of it in any case.
    """

    point: str
    first: int
    stop: int | None
    setpoints: Setpoints
    planned: int | None = None
    against: str = ""
    remark: str = ""


def find_windows(recording: Recording, limits: Steadiness = LIMITS) -> tuple[Window, ...]:
    """The windows of a recording, accepted or with the reasons against them.

    Parameters
    ----------
    recording : Recording
        A run with one point, or a sequence with test steps.
    limits : Steadiness
        What counts as steady.

    Notes
    -----
    A run whose manoeuvre moves has none. In a sequence, a window lasts from MEASURE to END of the same point; one that
    is never closed lasts to the next START or the end of the file and is rejected. Its set-points are those of the
    step; what the step leaves open stays open. A point without MEASURE, and a gap of `limits.shortest` or more outside
    the windows, in which steps may have been lost, are rejected windows (`pmg.pipeline.windows.gaps`). Without steps, a
    file that names its point is one window, over the samples that all channels share; one that names none is cut into
    plateaus (`pmg.pipeline.windows.plateaus`), each a window with the file's set-points, numbered in the order of time,
    whether it is accepted or not. What lies between plateaus is rejected as changing. Where the file lost its end, the
    last window is held against the length that it would have had, as far as that is known, and says so.
    """
    if recording.run.manoeuvre.moves:
        return ()
    if recording.steps:
        measured = _from_steps(recording.steps)
        spans = [(s.first, _meant(recording, s)) for s in measured]
        lost = holes(recording, spans, round(limits.shortest * recording.rate_hz))
        stretches = [*measured, *(_Stretch(h.point, h.first, h.stop, h.setpoints, against=h.why) for h in lost)]
        return tuple(_judge(recording, stretch, limits) for stretch in sorted(stretches, key=lambda s: s.first))
    whole = _whole(recording)
    found = (whole,) if recording.run.point else _from_plateaus(recording, whole, limits)
    return tuple(_judge(recording, stretch, limits) for stretch in found)


def _from_plateaus(recording: Recording, whole: _Stretch, limits: Steadiness) -> tuple[_Stretch, ...]:
    first, stop = whole.first, whole.stop or whole.first
    part = recording.samples.slice(first - recording.first_sample, stop - first)
    torques = [
        (part[f"torque_{side}"].to_numpy(), recording.calibration[side].nominal_torque)
        for side in SIDES
        if f"torque_{side}" in recording.recorded
    ]
    angles = [part[f"angle_{side}"].to_numpy() for side in SIDES if f"angle_{side}" in recording.recorded]
    found = [(first + start, first + end) for start, end in plateaus(torques, angles, recording.rate_hz, limits)]
    if found in ([], [(first, stop)]):
        return (whole,)
    width = max(2, len(str(len(found))))
    plain = replace(whole, planned=None, remark="")
    levels = [
        replace(plain, point=f"{whole.point}-{number:0{width}d}", first=start, stop=end)
        for number, (start, end) in enumerate(found, 1)
    ]
    if len(found) == 1:
        levels[0] = replace(levels[0], point=whole.point)
    levels[-1] = replace(levels[-1], remark=whole.remark)
    ends, starts = [first, *(end for _, end in found)], [*(start for start, _ in found), stop]
    between = [(a, b) for a, b in zip(ends, starts, strict=True) if b > a]
    changes = [
        replace(plain, point=f"{whole.point}-change-{number:0{width}d}", first=a, stop=b, against=_changing(a, b))
        for number, (a, b) in enumerate(between, 1)
    ]
    return tuple(sorted((*levels, *changes), key=lambda s: s.first))


def _changing(first: int, stop: int) -> str:
    return str(Reason("set-points changing", f"samples {first} to {stop} belong to no plateau"))


def _whole(recording: Recording) -> _Stretch:
    first, stop = recording.first_sample, recording.stop_sample
    known = np.ones(recording.samples.height, dtype=np.bool_)
    for name in recording.recorded:
        known &= np.isfinite(recording.samples[name].to_numpy())
    if known.any():
        first, stop = first + int(np.argmax(known)), stop - int(np.argmax(known[::-1]))
    point = recording.run.point or stem(recording)
    lost = lost_end(recording, first, stop)
    return _Stretch(point, first, stop, recording.run.setpoints, planned=lost.planned, remark=lost.remark)


def _from_steps(steps: tuple[SequenceStep, ...]) -> tuple[_Stretch, ...]:
    stretches = []
    for place, step in enumerate(steps):
        if step.phase != "MEASURE":
            continue
        ends = (s for s in steps[place + 1 :] if s.phase in ("END", "START", "MEASURE"))
        after = next(ends, None)
        closed = after is not None and after.phase == "END" and after.point == step.point
        stop = after.sample if closed and after is not None else None
        stretches.append(_Stretch(step.point, step.sample, stop, step.setpoints))
    return tuple(stretches)


def _meant(recording: Recording, stretch: _Stretch) -> int:
    """Where a stretch ends, whether it was recorded to there or not."""
    later = (s.sample for s in recording.steps if s.phase == "START" and s.sample > stretch.first)
    return stretch.stop if stretch.stop is not None else next(later, recording.stop_sample)


def _judge(recording: Recording, stretch: _Stretch, limits: Steadiness) -> Window:
    end, meant = recording.stop_sample, _meant(recording, stretch)
    first = min(max(stretch.first, recording.first_sample), end)
    stop = max(first, min(meant, end))
    part = recording.samples.slice(first - recording.first_sample, stop - first)
    evidence = WindowEvidence(
        first=first,
        stop=stop,
        closed=stretch.stop is not None,
        meant=(stretch.planned or meant) - stretch.first,
        rate_hz=recording.rate_hz,
        setpoints=stretch.setpoints,
        calibration=recording.calibration,
        torque={side: part[f"torque_{side}"].to_numpy() for side in SIDES},
        angle={side: part[f"angle_{side}"].to_numpy() for side in SIDES},
        lines=_masks(part["lines"]),
        line_events=recording.line_events,
        blemishes=recording.blemishes,
        lacking=recording.lacking,
    )
    checks = (gaps,) if stretch.against else CHECKS
    reasons = tuple(str(r) for check in checks if (r := check(evidence, limits)) is not None)
    against = missing_channels(recording) + ((stretch.against,) if stretch.against else ()) + reasons
    return Window(
        point=stretch.point,
        configuration=recording.run.configuration,
        gear=recording.run.gear,
        drive=recording.run.drive,
        started_at=recording.time_of(first),
        first_sample=first,
        stop_sample=stop,
        setpoints=stretch.setpoints,
        accepted=not against,
        reasons=against
        + ((stretch.remark,) if stretch.remark else ())
        + (() if against else near_limits(evidence, limits)),
        rest_sun=_at_rest(stretch.setpoints.speed_sun, evidence, "sun"),
        rest_ring=_at_rest(stretch.setpoints.speed_ring, evidence, "ring"),
    )


def _masks(lines: pl.Series) -> npt.NDArray[np.uint32]:
    """Masks of the digital inputs, 0 where they were not sampled."""
    if lines.null_count() == len(lines):
        return np.zeros(len(lines), dtype=np.uint32)
    return lines.fill_null(0).to_numpy()


def _at_rest(speed_set: float | None, evidence: WindowEvidence, side: str) -> bool:
    """Whether a shaft is held: by its set-point, or by what was measured where there is none."""
    speed = end_to_end_speed(evidence.angle[side], evidence.rate_hz) if speed_set is None else speed_set
    return abs(speed) < REST_SPEED
