"""Channels of one recording turned into torque [N m] and angle [rad] on the shared sample clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording import channels
from pmg.pipeline.recording.channels import check_channel
from pmg.pipeline.recording.counters import edge_frequency, unwrap
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.join import join_blocks
from pmg.sim.errors import near_miss
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy.typing as npt

    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.channels import ChannelSpec, ChannelTerms
    from pmg.pipeline.recording.container import Topic
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.join import Blemish, Track
    from pmg.pipeline.recording.wire import IndexPulse

DEFAULT_BITS = 32
INDEX_TOLERANCE = 2
"""Counts by which two index pulses may disagree, besides those of one sample in which the latch may fall."""


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


def decode_torque(
    topics: Mapping[str, Topic], side: str, calibration: Calibration, findings: Findings
) -> Decoded | None:
    """Torque of a shaft [N m], from whichever encoding the recording uses; None, with findings, without one.

    Parameters
    ----------
    topics : mapping of str to Topic
        Topics of the container.
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
    torque = calibration.transducer(side).torque(frequency.values)
    return Decoded(frequency.topic, frequency.first, frequency.rate_hz, torque, frequency.present, frequency.blemishes)


def decode_angle(
    topics: Mapping[str, Topic],
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
    counts_per_rev = calibration.counts_per_rev(side)
    declared = terms.numbers.get("counts_per_rev", counts_per_rev)
    bits = int(terms.numbers.get("bits", DEFAULT_BITS))
    if declared != counts_per_rev:
        findings.error(
            Code.CHANNEL_VALUE,
            terms.spec.topic,
            f"counts_per_rev {declared:g} in the channel's metadata; expected {counts_per_rev}, as in the calibration",
            "One of the two is wrong: count one turn by hand and correct it.",
        )
        return None
    at = np.flatnonzero(track.present)
    if not 1 <= bits <= DEFAULT_BITS or int(track.values[at].max(initial=0)) >> bits:
        findings.error(
            Code.CHANNEL_VALUE,
            terms.spec.topic,
            f"bits '{bits}' with counts up to {int(track.values[at].max(initial=0))}; expected counts that fit "
            f"into the declared width of at most {DEFAULT_BITS} bits",
            "Correct the width of the counter in the recorder.",
        )
        return None
    count, guesses = unwrap(track.values[at], at, bits)
    if guesses:
        findings.warning(
            Code.ENCODER_AMBIGUOUS,
            terms.spec.topic,
            f"over {guesses} gaps the {bits}-bit counter may have wrapped another time; expected gaps shorter "
            "than half a wrap",
            "Angles before and after the gap are not comparable; use a wider counter.",
        )
    _check_pulses(terms.spec.topic, side, count, at + track.first, bits, counts_per_rev, pulses, findings)
    angle = np.full(len(track.values), np.nan)
    angle[at] = count * (REVOLUTION / counts_per_rev)
    return Decoded(terms.spec.topic, track.first, terms.rate_hz, angle, track.present, track.blemishes)


def decode_lines(topics: Mapping[str, Topic], findings: Findings) -> Decoded | None:
    """Masks of the digital inputs; None where the recording has none."""
    if channels.LINES.topic not in topics:
        return None
    joined = _joined(topics, channels.LINES, findings)
    if joined is None:
        return None
    terms, track = joined
    return Decoded(terms.spec.topic, track.first, terms.rate_hz, track.values, track.present, track.blemishes)


def _joined(topics: Mapping[str, Topic], spec: ChannelSpec, findings: Findings) -> tuple[ChannelTerms, Track] | None:
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
    return None if terms is None or track is None else (terms, track)


def _frequency(topics: Mapping[str, Topic], spec: ChannelSpec, findings: Findings) -> Decoded | None:
    joined = _joined(topics, spec, findings)
    if joined is None:
        return None
    terms, track = joined
    values = np.where(track.present, track.values.astype(np.float64), np.nan)
    return Decoded(spec.topic, track.first, terms.rate_hz, values, track.present, track.blemishes)


def _frequency_from_edges(
    topics: Mapping[str, Topic], edge_spec: ChannelSpec, tick_spec: ChannelSpec, findings: Findings
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
    found = edge_frequency(
        edge_track.values[in_edges], tick_track.values[in_ticks], present, edge_terms.rate_hz, timebase
    )
    if found.backward:
        findings.error(
            Code.EDGES_INCONSISTENT,
            tick_spec.topic,
            f"in {found.backward} of {len(present)} samples the edge count or the tick runs backward, or one moves "
            "without the other; expected both to grow together",
            "The torque of this run is not used. Check that both are latched at once, and the time base.",
        )
    elif found.stalled:
        findings.error(
            Code.EDGES_STALLED,
            edge_spec.topic,
            f"no edges in {found.stalled} of {len(present)} samples at a time base of {timebase:g} Hz; expected "
            "edges without pause",
            "The transducer's output stopped, or timebase_hz is wrong: check cable, supply and recorder.",
        )
    if found.drift:
        findings.warning(
            Code.TIMEBASE_DRIFT,
            tick_spec.topic,
            f"the time base runs {found.drift * 1e6:+.1f} ppm off the sample clock; expected one oscillator. "
            "Frequencies are in terms of the time base",
            "Lock the counter's time base to the sample clock.",
        )
    blemishes = edge_track.blemishes + tick_track.blemishes
    return Decoded(edge_spec.topic, first, edge_terms.rate_hz, found.frequency, present, blemishes)


def _check_pulses(
    topic: str,
    side: str,
    count: npt.NDArray[np.int64],
    at: npt.NDArray[np.int64],
    bits: int,
    counts_per_rev: int,
    pulses: Sequence[IndexPulse],
    findings: Findings,
) -> None:
    """Whether every index pulse came at the same place of the revolution: no count lost, none too many."""
    inside = [p for p in pulses if at[0] <= p.sample <= at[-1]]
    if len(inside) < 2:
        return
    modulus = 1 << bits
    places = np.clip(np.searchsorted(at, [p.sample for p in inside]), 0, len(at) - 1)
    near = count[places]
    latched = np.array([p.count for p in inside], dtype=np.int64)
    latched = near + (latched - near + modulus // 2) % modulus - modulus // 2
    half = counts_per_rev // 2
    residue = (latched - latched[0] + half) % counts_per_rev - half
    quickest = int(np.max(np.abs((count[1:] - count[:-1]) // (at[1:] - at[:-1])), initial=0))
    slipped = np.flatnonzero(np.abs(residue) > INDEX_TOLERANCE + quickest)
    if len(slipped):
        findings.warning(
            Code.ENCODER_SLIPPED,
            topic,
            f"from sample {inside[int(slipped[0])].sample} on the count at the index pulse is off by "
            f"{int(residue[slipped[0]]):+d}; expected the same place in each revolution",
            f"The {side} encoder lost or caught counts: check its cable, shield and coupling.",
        )
