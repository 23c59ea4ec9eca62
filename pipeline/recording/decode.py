"""Channels of one recording turned into torque [N m] and angle [rad] on the shared sample clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording import channels
from pmg.pipeline.recording.checks.encodings import compare_encodings
from pmg.pipeline.recording.checks.pulses import check_pulses
from pmg.pipeline.recording.checks.stretches import pieces, stretches, tell_stretches
from pmg.pipeline.recording.counters import unwrap
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.frequency import (
    Decoded,
    counter_width,
    frequency_from_edges,
    joined_channel,
    recorded_frequency,
)
from pmg.pipeline.recording.join import Blemish
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.channels import ChannelSpec
    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.layouts.wire import IndexPulse

NEAR_HALF = 0.25
"""Part of a counter's range in one sample beyond which its direction is no longer certain."""


def decode_torque(topics: dict[str, Topic], side: str, calibration: Calibration, findings: Findings) -> Decoded | None:
    """Torque of a shaft [N m], from whichever encoding the recording uses; None, with findings, without one.

    Parameters
    ----------
    topics : dict of str to Topic
        Topics of the container. The messages of those that are read are let go.
    side : str
        ``sun`` or ``ring``.
    calibration : Calibration
        Turns frequency into torque.
    findings : Findings
        Receives what is missing or wrong.
    """
    by_edges = (channels.edges(side), channels.edge_ticks(side))
    direct = channels.frequency(side)
    if any(spec.topic in topics for spec in by_edges):
        frequency = frequency_from_edges(topics, *by_edges, findings)
        spare = _spare_frequency(topics, direct, findings)
        if spare is not None and frequency is not None and spare.rate_hz == frequency.rate_hz:
            values, firsts = (frequency.values, spare.values), (frequency.first, spare.first)
            compare_encodings(values, firsts, calibration[side], spare.topic, findings)
    else:
        frequency = recorded_frequency(topics, direct, findings)
    if frequency is None:
        return None
    torque = calibration[side].torque(frequency.values)
    return Decoded(frequency.topic, frequency.first, frequency.rate_hz, torque, frequency.present, frequency.blemishes)


def _spare_frequency(topics: dict[str, Topic], spec: ChannelSpec, findings: Findings) -> Decoded | None:
    """The frequency that was recorded next to the edges, which are used; faults of its own cost nothing."""
    return recorded_frequency(topics, spec, Findings(findings.file)) if spec.topic in topics else None


def decode_angle(
    topics: dict[str, Topic],
    side: str,
    calibration: Calibration,
    pulses: Sequence[IndexPulse],
    findings: Findings,
) -> Decoded | None:
    """Angle of a shaft [rad], unwrapped; None, with findings, where the recording has none.

    Parameters
    ----------
    topics, side, calibration, findings
        As for `decode_torque`.
    pulses : sequence of IndexPulse
        Counts latched once per revolution, against which the count is proven where there are any.
    """
    joined = joined_channel(topics, channels.encoder(side), findings)
    if joined is None:
        return None
    terms, track = joined
    counts_per_rev = calibration.counts_per_rev[side]
    declared = terms.numbers.get("counts_per_rev", counts_per_rev)
    if declared != counts_per_rev:
        findings.error(
            Code.CHANNEL_VALUE,
            terms.spec.topic,
            f"counts_per_rev {declared:g} in the channel's metadata; expected {counts_per_rev}, as in the calibration",
            "One of the two is wrong: count one turn by hand and correct it.",
        )
        return None
    if (bits := counter_width(terms, track, findings)) is None:
        return None
    whole = bool(track.present.all())
    at = None if whole else np.flatnonzero(track.present)
    count, guesses = unwrap(track.values if at is None else track.values[at], at, bits)
    if guesses:
        findings.warning(
            Code.ENCODER_AMBIGUOUS,
            terms.spec.topic,
            f"over {guesses} gaps the {bits}-bit counter may have wrapped another time; expected gaps shorter "
            "than half a wrap",
            "Angles before and after the gap are not comparable; use a wider counter.",
            sample_range=(track.first, track.stop),
            kept="the angle within each side of a gap",
        )
    words = (
        f"turn by more than a quarter of the {bits}-bit counter's range in one sample",
        "less, so that the direction is certain",
        "Use a wider counter or a higher rate. A faulty reading looks like this too.",
    )
    quick = stretches(_quick(count, at, bits))
    found = (quick if at is None else at[quick]) + (1 + track.first)
    tell_stretches(findings.warning, Code.ENCODER_AMBIGUOUS, terms.spec.topic, found, words)
    slips: list[tuple[int, int]] = []
    if pulses:
        where = (np.arange(len(count)) if at is None else at) + track.first
        slips = check_pulses(terms.spec.topic, side, count, where, bits, counts_per_rev, pulses, findings)
    blemishes = track.blemishes + tuple(
        Blemish(terms.spec.topic, Code.ENCODER_SLIPPED, start, stop) for start, stop in slips
    )
    angle = count * (REVOLUTION / counts_per_rev)
    if at is not None:
        known, angle = angle, np.full(len(track.values), np.nan)
        angle[at] = known
    return Decoded(terms.spec.topic, track.first, terms.rate_hz, angle, track.present, blemishes)


def _quick(count: npt.NDArray[np.int64], at: npt.NDArray[np.int64] | None, bits: int) -> npt.NDArray[np.bool_]:
    """Steps between neighbours that leave the direction open."""
    quick = np.zeros(max(0, len(count) - 1), dtype=np.bool_)
    for part in pieces(len(quick)):
        quick[part] = np.abs(np.diff(count[part.start : part.stop + 1])) > NEAR_HALF * float(1 << bits)
        if at is not None:
            quick[part] &= np.diff(at[part.start : part.stop + 1]) == 1
    return quick


def decode_lines(topics: dict[str, Topic], findings: Findings) -> Decoded | None:
    """Masks of the digital inputs; None where the recording has none."""
    if channels.LINES.topic not in topics:
        return None
    joined = joined_channel(topics, channels.LINES, findings)
    if joined is None:
        return None
    terms, track = joined
    return Decoded(terms.spec.topic, track.first, terms.rate_hz, track.values, track.present, track.blemishes)
