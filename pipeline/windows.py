"""Stretches of a recording that may stand for a test point, and why some may not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.limits import LIMITS
from pmg.pipeline.plateaus import plateaus
from pmg.pipeline.recording.run import Setpoints
from pmg.pipeline.reduce import end_to_end_speed
from pmg.pipeline.steadiness import CHECKS, REST_SPEED, SIDES, Evidence

if TYPE_CHECKING:
    from datetime import datetime

    from pmg.pipeline.limits import Steadiness
    from pmg.pipeline.recording import Recording
    from pmg.pipeline.recording.events import Step
    from pmg.sim.grid import Configuration


@dataclass(frozen=True)
class Window:
    """A stretch of samples that was meant as one test point.

    Parameters
    ----------
    point : str
        Test point.
    configuration : Configuration
        Neutral, engaged or zero.
    gear : int
        1 or 2.
    drive : str
        Side that drives when engaged.
    started_at : datetime
        Time of the first sample [UTC].
    first_sample, stop_sample : int
        Sample indices, `stop_sample` left out.
    setpoints : Setpoints
        What was asked for.
    accepted : bool
        Whether every check was met.
    reasons : tuple of str
        Why not, each with its numbers.
    rest_sun, rest_ring : bool
        Shaft held at rest.
    """

    point: str
    configuration: Configuration
    gear: int
    drive: str
    started_at: datetime
    first_sample: int
    stop_sample: int
    setpoints: Setpoints
    accepted: bool
    reasons: tuple[str, ...]
    rest_sun: bool
    rest_ring: bool


@dataclass(frozen=True)
class _Stretch:
    """A window before it is judged; `stop` is where it was meant to end, None where nobody said."""

    point: str
    first: int
    stop: int | None
    setpoints: Setpoints


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
    In a sequence, a window lasts from MEASURE to END of the same point; one that is never closed lasts to the next
    START or the end of the file and is rejected. Its set-points are those of the step; what the step leaves
    open stays open. Without steps, a file that names its point is one window, over the samples that all channels
    share; one that names none is cut into plateaus (`pmg.pipeline.plateaus`), each a window with the file's
    set-points, numbered in the order of time, whether it is accepted or not.
    """
    if recording.steps:
        return tuple(_judge(recording, stretch, limits) for stretch in _from_steps(recording.steps))
    whole = _whole(recording)
    stretches = (whole,) if recording.run.point else _from_plateaus(recording, whole, limits)
    return tuple(_judge(recording, stretch, limits) for stretch in stretches)


def _from_plateaus(recording: Recording, whole: _Stretch, limits: Steadiness) -> tuple[_Stretch, ...]:
    first, stop = whole.first, whole.stop or whole.first
    part = recording.samples.slice(first - recording.first_sample, stop - first)
    torques = [
        (part[f"torque_{side}"].to_numpy(), recording.calibration.transducer(side).nominal_torque) for side in SIDES
    ]
    angles = [part[f"angle_{side}"].to_numpy() for side in SIDES]
    found = plateaus(torques, angles, recording.rate_hz, limits)
    if len(found) < 2:
        return (whole,) if not found else (replace(whole, first=first + found[0][0], stop=first + found[0][1]),)
    width = max(2, len(str(len(found))))
    return tuple(
        replace(whole, point=f"{whole.point}-{number:0{width}d}", first=first + start, stop=first + end)
        for number, (start, end) in enumerate(found, 1)
    )


def _whole(recording: Recording) -> _Stretch:
    known = np.ones(recording.samples.height, dtype=np.bool_)
    for name in ("torque_sun", "torque_ring", "angle_sun", "angle_ring"):
        known &= np.isfinite(recording.samples[name].to_numpy())
    rows = np.flatnonzero(known)
    first = recording.first_sample + int(rows[0]) if len(rows) else recording.first_sample
    stop = recording.first_sample + int(rows[-1]) + 1 if len(rows) else first
    point = recording.run.point or recording.file.rsplit("/", 1)[-1].removesuffix(".mcap")
    return _Stretch(point, first, stop, recording.run.setpoints)


def _from_steps(steps: tuple[Step, ...]) -> tuple[_Stretch, ...]:
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


def _judge(recording: Recording, stretch: _Stretch, limits: Steadiness) -> Window:
    end = recording.stop_sample
    later = (s.sample for s in recording.steps if s.phase == "START" and s.sample > stretch.first)
    meant = stretch.stop if stretch.stop is not None else next(later, end)
    first = min(max(stretch.first, recording.first_sample), end)
    stop = max(first, min(meant, end))
    part = recording.samples.slice(first - recording.first_sample, stop - first)
    evidence = Evidence(
        first=first,
        stop=stop,
        closed=stretch.stop is not None,
        meant=meant - stretch.first,
        rate_hz=recording.rate_hz,
        setpoints=stretch.setpoints,
        calibration=recording.calibration,
        torque={side: part[f"torque_{side}"].to_numpy() for side in ("sun", "ring")},
        angle={side: part[f"angle_{side}"].to_numpy() for side in ("sun", "ring")},
        lines=part["lines"].drop_nulls().to_numpy(),
        line_events=recording.line_events,
        blemishes=recording.blemishes,
    )
    reasons = tuple(str(r) for check in CHECKS if (r := check(evidence, limits)) is not None)
    return Window(
        point=stretch.point,
        configuration=recording.run.configuration,
        gear=recording.run.gear,
        drive=recording.run.drive,
        started_at=recording.time_of(first),
        first_sample=first,
        stop_sample=stop,
        setpoints=stretch.setpoints,
        accepted=not reasons,
        reasons=reasons,
        rest_sun=_at_rest(stretch.setpoints.speed_sun, evidence, "sun"),
        rest_ring=_at_rest(stretch.setpoints.speed_ring, evidence, "ring"),
    )


def _at_rest(speed_set: float | None, evidence: Evidence, side: str) -> bool:
    """Whether a shaft is held: by its set-point, or by what was measured where there is none."""
    speed = end_to_end_speed(evidence.angle[side], evidence.rate_hz) if speed_set is None else speed_set
    return abs(speed) < REST_SPEED
