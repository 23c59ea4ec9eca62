"""Single messages of a recording: steps of the sequence, digital lines, clock marks, index pulses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from pmg.pipeline.recording.channels import ENCODING, EVENT_SCHEMAS
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.layouts import wire
from pmg.pipeline.recording.layouts.otherevents import KINDS, read_other
from pmg.pipeline.recording.run import step_setpoints
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.errors import near_miss

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.run_records import Setpoints

Message = TypeVar("Message")

MOVING_PHASES = tuple(each.phase for each in Manoeuvre if each.moves)
PHASES = ("START", "SETTLED", "MEASURE", "END", Manoeuvre.ZERO.phase, *MOVING_PHASES)


@dataclass(frozen=True)
class SequenceStep:
    """Step of the test sequence from a sample on.

    Parameters
    ----------
    sample : int
        Sample index on the shared clock.
    point : str
        Test point.
    phase : str
        One of `PHASES`; ``ZERO``, the phase of a zero check, stands as ``MEASURE``.
    setpoints : Setpoints
        What was asked for.
    """

    sample: int
    point: str
    phase: str
    setpoints: Setpoints


def read_events(
    topics: Mapping[str, Topic], name: str, parse: Callable[[bytes], Message], findings: Findings
) -> tuple[Message, ...]:
    """Messages of a topic in file order; what cannot be read is a finding."""
    topic = topics.get(name)
    if topic is None:
        return ()
    messages: list[Message] = []
    faults: list[str] = []
    if (topic.encoding, topic.schema) != (ENCODING, EVENT_SCHEMAS[name]):
        try:
            read = read_other(topic, KINDS[name])
        except wire.WireError as fault:
            findings.error(
                Code.MESSAGE_ENCODING,
                name,
                f"{topic.count} messages '{topic.schema}' in '{topic.encoding}': {fault}; expected "
                f"'{EVENT_SCHEMAS[name]}' in '{ENCODING}', or its fields in json or cdr",
                "They are left out. Record this topic in one of them.",
                lost=f"{topic.count} messages",
            )
            return ()
        messages.extend(read.messages)
        faults.extend(read.faults)
    else:
        for payload in topic.payloads:
            try:
                messages.append(parse(payload))
            except wire.WireError as fault:
                faults.append(str(fault))
    if faults:
        findings.error(
            Code.MESSAGE_MALFORMED,
            name,
            f"{len(faults)} of {len(topic.payloads)} messages cannot be read ({faults[0]}); expected '{topic.schema}'",
            "They are left out. Check the recorder's encoder of this topic.",
            kept=f"the other {len(messages)} messages",
            lost=f"{len(faults)} messages",
        )
    return tuple(messages)


def read_steps(
    topics: Mapping[str, Topic], findings: Findings, manoeuvre: Manoeuvre = Manoeuvre.STEADY
) -> tuple[SequenceStep, ...]:
    """Steps of the test sequence in the order of their samples; those of a run in motion are judged later."""
    steps: list[SequenceStep] = []
    for raw in read_events(topics, "/test/step", wire.test_step, findings):
        if raw.phase not in PHASES:
            findings.warning(
                Code.STEP_UNKNOWN,
                f"/test/step {raw.point}",
                f"phase '{raw.phase}' at sample {raw.sample}; expected {', '.join(PHASES)}. It is left out",
                near_miss(raw.phase, PHASES),
            )
            continue
        setpoints = step_setpoints(raw.point, raw.setpoint, findings)
        phase = Manoeuvre.STEADY.phase if raw.phase == Manoeuvre.ZERO.phase else raw.phase
        steps.append(SequenceStep(raw.sample, raw.point, phase, setpoints))
    if steps and not manoeuvre.moves and not any(step.phase == "MEASURE" for step in steps):
        findings.error(
            Code.STEP_MISSING,
            "/test/step",
            f"{len(steps)} steps and none of them is MEASURE; expected one for each point",
            "The file gives no point: the sequence was broken off, or the recorder does not write the phase.",
        )
    return tuple(sorted(steps, key=lambda step: step.sample))
