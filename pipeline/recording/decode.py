"""Channels of one recording turned into torque [N m] and angle [rad] on the shared sample clock."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording import channels
from pmg.pipeline.recording.channels import check_channel
from pmg.pipeline.recording.checks.pulses import check_pulses
from pmg.pipeline.recording.checks.stretches import pieces, stretches, tell_stretches
from pmg.pipeline.recording.container.messages import Messages
from pmg.pipeline.recording.counters import WIDEST, unwrap
from pmg.pipeline.recording.edges import edge_frequency
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.join import Blemish, join_blocks
from pmg.sim.errors import near_miss
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.channels import ChannelSpec, ChannelTerms
    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.edges import EdgeFrequency
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.join import Track
    from pmg.pipeline.recording.layouts.wire import IndexPulse

DEFAULT_BITS = 32
NEAR_HALF = 0.25
"""Part of a counter's range in one sample beyond which its direction is no longer certain."""


@dataclass(frozen=True)
class Decoded:
    """One channel in SI.

    Parameters
    ----------
    topic : str
        Where it comes from.
    first : int
        Sample index of the first value.
    rate_hz : float
        Sample rate [Hz].
    values : (n,) array
        Values, NaN where nothing was recorded; of the lines, the masks with `present` beside them.
    present : (n,) array of bool
        Where something was recorded.
    blemishes : tuple of Blemish
        Stretches that the recorder marks as bad.
    """

    topic: str
    first: int
    rate_hz: float
    values: npt.NDArray[Any]
    present: npt.NDArray[np.bool_]
    blemishes: tuple[Blemish, ...]

    @property
    def stop(self) -> int:
        """Sample index after the last value."""
        return self.first + len(self.values)


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
        if direct.topic in topics:
            findings.info(
                Code.CHANNEL_CONFLICT,
                direct.topic,
                "the torque is recorded as frequency and as edges; expected one of them. The edges are used",
                "Nothing is lost.",
            )
        frequency = _frequency_from_edges(topics, *by_edges, findings)
    else:
        frequency = _frequency(topics, direct, findings)
    if frequency is None:
        return None
    torque = calibration[side].torque(frequency.values)
    return Decoded(frequency.topic, frequency.first, frequency.rate_hz, torque, frequency.present, frequency.blemishes)


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
    joined = _joined(topics, channels.encoder(side), findings)
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
    if (bits := _bits(terms, track, findings)) is None:
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
    joined = _joined(topics, channels.LINES, findings)
    if joined is None:
        return None
    terms, track = joined
    return Decoded(terms.spec.topic, track.first, terms.rate_hz, track.values, track.present, track.blemishes)


def _joined(topics: dict[str, Topic], spec: ChannelSpec, findings: Findings) -> tuple[ChannelTerms, Track] | None:
    topic = topics.get(spec.topic)
    if topic is None:
        findings.error(
            Code.CHANNEL_MISSING,
            spec.topic,
            f"the topic is not in the file; expected it, with {spec.quantity} [{spec.unit}]",
            near_miss(spec.topic, topics) if topics else "The file holds no channel at all: check the recorder.",
        )
        return None
    terms = check_channel(topic, spec, findings)
    track = None if terms is None else join_blocks(topic, terms, findings)
    topics[spec.topic] = replace(topic, payloads=Messages())
    return None if terms is None or track is None else (terms, track)


def _frequency(topics: dict[str, Topic], spec: ChannelSpec, findings: Findings) -> Decoded | None:
    joined = _joined(topics, spec, findings)
    if joined is None:
        return None
    terms, track = joined
    whole = bool(track.present.all())
    values = track.values.astype(np.float64, copy=not whole)
    if not whole:
        values[~track.present] = np.nan
    return Decoded(spec.topic, track.first, terms.rate_hz, values, track.present, track.blemishes)


def _frequency_from_edges(
    topics: dict[str, Topic], edge_spec: ChannelSpec, tick_spec: ChannelSpec, findings: Findings
) -> Decoded | None:
    edges = _joined(topics, edge_spec, findings)
    ticks = _joined(topics, tick_spec, findings)
    if edges is None or ticks is None:
        return None
    (edge_terms, edge_track), (tick_terms, tick_track) = edges, ticks
    if edge_terms.rate_hz != tick_terms.rate_hz:
        findings.error(
            Code.CHANNEL_VALUE,
            tick_spec.topic,
            f"rate_hz {tick_terms.rate_hz:g}; expected {edge_terms.rate_hz:g}, as of {edge_spec.topic}",
            "Record edges and ticks at one rate.",
        )
        return None
    first, stop = max(edge_track.first, tick_track.first), min(edge_track.stop, tick_track.stop)
    if stop - first < 2:
        findings.error(
            Code.CHANNEL_MISSING,
            tick_spec.topic,
            f"edges and ticks share {max(0, stop - first)} samples; expected both over the whole run",
            "Check that the recorder writes both.",
        )
        return None
    in_edges = slice(first - edge_track.first, stop - edge_track.first)
    in_ticks = slice(first - tick_track.first, stop - tick_track.first)
    present = edge_track.present[in_edges] & tick_track.present[in_ticks]
    timebase = tick_terms.numbers["timebase_hz"]
    widths = _bits(edge_terms, edge_track, findings), _bits(tick_terms, tick_track, findings)
    if widths[0] is None or widths[1] is None:
        return None
    values = edge_track.values[in_edges], tick_track.values[in_ticks]
    found = edge_frequency(*values, present, edge_terms.rate_hz, timebase, (widths[0], widths[1]))
    _tell_edges(found, first, timebase, (edge_spec.topic, tick_spec.topic), findings)
    blemishes = edge_track.blemishes + tick_track.blemishes
    return Decoded(edge_spec.topic, first, edge_terms.rate_hz, found.frequency, present, blemishes)


def _tell_edges(found: EdgeFrequency, first: int, timebase: float, topics: tuple[str, str], findings: Findings) -> None:
    """Say where edges and ticks contradict each other, where the edges pause, and by what the time base drifts.

    Parameters
    ----------
    found : EdgeFrequency
        What came of the counts.
    first : int
        Number of its first sample.
    timebase : float
        Of the ticks [Hz].
    topics : (str, str)
        Of the edges and of the ticks.
    findings : Findings
        Are told.
    """
    edges, ticks = topics
    words = (
        f"of {len(found.frequency)} end a step in which the edge count or the tick runs backward, or one moves "
        "without the other",
        "both to grow together",
        "Check that both are latched at once, and the time base.",
    )
    whole = not np.isfinite(found.frequency).any()
    kept = "no torque of this run" if whole else "the torque before and after"
    wrong = stretches(found.wrong) + first
    tell_stretches(findings.error, Code.EDGES_INCONSISTENT, ticks, wrong, words, kept=kept, lost="{n} steps")
    words = (
        f"of {len(found.frequency)} have no edges at a time base of {timebase:g} Hz",
        "edges without pause",
        "The transducer's output stopped, or timebase_hz is wrong: check cable, supply and recorder.",
    )
    silent = stretches(found.stalled) + first
    tell_stretches(findings.error, Code.EDGES_STALLED, edges, silent, words, lost="{n} samples")
    if found.drift:
        findings.warning(
            Code.TIMEBASE_DRIFT,
            ticks,
            f"the time base runs {found.drift * 1e6:+.1f} ppm off the sample clock; expected one oscillator. "
            "Frequencies are in terms of the time base",
            "Lock the counter's time base to the sample clock.",
        )


def _bits(terms: ChannelTerms, track: Track, findings: Findings) -> int | None:
    """Width of a counter, as declared; None, with a finding, where its readings do not fit."""
    bits = terms.numbers.get("bits", DEFAULT_BITS)
    largest = int((track.values if track.present.all() else track.values[track.present]).max(initial=0))
    if bits == int(bits) and 1 <= bits <= WIDEST and not largest >> int(bits):
        return int(bits)
    findings.error(
        Code.CHANNEL_VALUE,
        terms.spec.topic,
        f"bits '{bits:g}' with counts up to {largest}; expected counts that fit into the declared width of at most "
        f"{WIDEST} bits",
        "Correct the width of the counter in the recorder.",
    )
    return None
