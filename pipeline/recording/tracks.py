"""Torques and angles of both shafts: which of them a recording holds, and whether they belong together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.recording.decode import decode_angle, decode_torque
from pmg.pipeline.recording.events import read_events
from pmg.pipeline.recording.findings import Code, Severity
from pmg.pipeline.recording.layouts import wire
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.frequency import Decoded

COLUMNS = ("torque_sun", "torque_ring", "angle_sun", "angle_ring")
"""Columns of torque and angle, in the order in which they are decoded."""


def decode_tracks(
    topics: dict[str, Topic], calibration: Calibration, findings: Findings
) -> tuple[dict[str, Decoded | None], dict[str, str]]:
    """Torques and angles by column, and why a column is lacking."""
    pulses = {side: read_events(topics, f"/daq/encoder_{side}/index", wire.index_pulse, findings) for side in SIDES}
    tracks: dict[str, Decoded | None] = {}
    lacking: dict[str, str] = {}
    for name in COLUMNS:
        kind, _, side = name.partition("_")
        before = len(findings.gathered)
        if kind == "torque":
            tracks[name] = decode_torque(topics, side, calibration, findings)
        else:
            tracks[name] = decode_angle(topics, side, calibration, pulses[side], findings)
        if tracks[name] is None:
            absent = {f.code for f in findings.gathered[before:] if f.severity is Severity.ERROR} == {
                Code.CHANNEL_MISSING
            }
            lacking[name] = "not recorded" if absent else "not usable"
    return tracks, lacking


def tell_lacking(lacking: Mapping[str, str], findings: Findings) -> None:
    """Name each column that holds nothing, and what that costs."""
    for name, why in lacking.items():
        kind, _, side = name.partition("_")
        others = [each.replace("_", " of the ") for each in COLUMNS if each not in lacking]
        findings.error(
            Code.CHANNEL_MISSING,
            name,
            f"{side} {kind} {why}; expected torque and angle of both shafts",
            "Windows need it and are rejected; the other channels are kept. Mend the recorder, and run these again.",
            kept=", ".join(others),
            lost=f"every window, for want of the {side} {kind}",
        )


def one_rate(decoded: Sequence[Decoded], findings: Findings) -> bool:
    """Whether all have the rate of the first; each that has not is reported."""
    odd = [track for track in decoded if track.rate_hz != decoded[0].rate_hz]
    for track in odd:
        findings.error(
            Code.CHANNEL_VALUE,
            track.topic,
            f"rate_hz {track.rate_hz:g}; expected {decoded[0].rate_hz:g}, as of {decoded[0].topic}",
            "Record torque, encoders and lines at one rate.",
        )
    return not odd


def together(decoded: Sequence[Decoded], findings: Findings) -> bool:
    """Whether any sample is shared by all channels; what lies far apart belongs to no common moment."""
    late, early = max(decoded, key=lambda track: track.first), min(decoded, key=lambda track: track.stop)
    if late.first < early.stop:
        return True
    findings.error(
        Code.SAMPLES_RAGGED,
        late.topic,
        f"it begins at sample {late.first}, and {early.topic} ends at {early.stop}; expected channels over the same "
        "samples",
        "An index or a stamp is damaged, or the channels were recorded one after another.",
        sample_range=(early.stop, late.first),
        lost="the file",
    )
    return False
