"""Phases of the runs in motion of a recording, from its test steps."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from pmg.pipeline.recording.events import MOVING_PHASES
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.store.moving_record import Phase
from pmg.pipeline.windows.gaps import stem

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.recording.events import SequenceStep
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.read import Recording


@dataclass(frozen=True)
class MovingSpan:
    """Stretch of a recording that is one run in motion.

    Parameters
    ----------
    point : str
        Test point.
    phases : tuple of Phase
        At least one, each from where the one before it ends.
    reasons : tuple of str
        Why the run is set aside; empty where its phases are in order.
    """

    point: str
    phases: tuple[Phase, ...]
    reasons: tuple[str, ...] = ()

    @property
    def first_sample(self) -> int:
        """First sample of the first phase."""
        return self.phases[0].first_sample

    @property
    def stop_sample(self) -> int:
        """Sample after the last one of the last phase."""
        return self.phases[-1].stop_sample


def spans(recording: Recording, findings: Findings) -> tuple[MovingSpan, ...]:
    """The runs in motion of a recording, one for each point of its test steps.

    Parameters
    ----------
    recording : Recording
        Its manoeuvre moves.
    findings : Findings
        Receives phases that are missing or out of order.

    Notes
    -----
    Steps of a point are START, the phase of the manoeuvre, maybe among others in motion, and END. Without END the run
    lasts to the next point or the end of the file; without any step, it is the whole file.
    """
    phase = recording.run.manoeuvre.phase
    if not recording.steps:
        point = recording.run.point or stem(recording)
        came = f"no test steps; expected START, {phase} and END"
        findings.warning(Code.PHASE_OPEN, "/test/step", f"{came}. The whole file counts as one run", _DO)
        return (MovingSpan(point, (Phase(phase, recording.first_sample, recording.stop_sample),)),)
    points: dict[str, list[SequenceStep]] = {}
    for step in recording.steps:
        points.setdefault(step.point, []).append(step)
    starts = [steps[0].sample for steps in points.values()]
    ends = [*starts[1:], recording.stop_sample]
    return tuple(_span(recording, steps, end, findings) for steps, end in zip(points.values(), ends, strict=True))


_DO = "Let the test sequence write START, the phase and END with their samples."


def _span(recording: Recording, steps: Sequence[SequenceStep], end: int, findings: Findings) -> MovingSpan:
    """The run of the steps of one point; `end` is where it ends without END."""
    wanted, point, where = recording.run.manoeuvre.phase, steps[0].point, f"/test/step {steps[0].point}"
    names = [step.phase for step in steps if step.phase not in ("START", "SETTLED")]
    moving = [step for step in steps if step.phase in MOVING_PHASES]
    late = any(step.phase == "START" for step in steps[1:])
    body = names[:-1] if names[-1:] == ["END"] else names
    stop = min(steps[-1].sample if body != names else end, recording.stop_sample)
    first = max(moving[0].sample if moving else steps[0].sample, recording.first_sample)
    if late or wanted not in body or any(name not in MOVING_PHASES for name in body) or stop <= first:
        listed = ", ".join(f"{step.phase} at sample {step.sample}" for step in steps)
        findings.error(
            Code.PHASES_WRONG,
            where,
            f"{listed}; expected START, {wanted}, END in this order. The run is set aside",
            _DO,
        )
        stop = max(stop, first)
        return MovingSpan(point, (Phase(wanted, first, stop),), (f"phases out of order: {listed}",))
    if body == names:
        findings.warning(
            Code.PHASE_OPEN,
            where,
            f"no END after {names[-1]}; expected one. The run lasts to sample {stop}",
            "Look up whether the run was broken off; its last samples may be a stop.",
            sample_range=(first, stop),
        )
    borders = [first, *(step.sample for step in moving[1:]), stop]
    return MovingSpan(point, tuple(Phase(s.phase, a, b) for s, (a, b) in zip(moving, pairwise(borders), strict=True)))
