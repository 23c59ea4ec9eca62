"""One channel joined from its blocks, and the frequency of a transducer in either of its encodings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.channels import check_channel
from pmg.pipeline.recording.checks.stretches import stretches, tell_stretches
from pmg.pipeline.recording.container.messages import Messages
from pmg.pipeline.recording.counters import WIDEST
from pmg.pipeline.recording.edges import edge_frequency
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.join import Blemish, join_blocks
from pmg.sim.errors import near_miss

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.channels import ChannelSpec, ChannelTerms
    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.edges import EdgeFrequency
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.join import Track

DEFAULT_BITS = 32


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
        Values, NaN where nothing was recorded; of the lines, the masks with `present` next to them.
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


def joined_channel(
    topics: dict[str, Topic], spec: ChannelSpec, findings: Findings
) -> tuple[ChannelTerms, Track] | None:
    """The samples of a channel with its metadata; None, with findings, where none are. Its messages are let go."""
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


def recorded_frequency(topics: dict[str, Topic], spec: ChannelSpec, findings: Findings) -> Decoded | None:
    """The frequency [Hz] as it was recorded; None, with findings, without one."""
    joined = joined_channel(topics, spec, findings)
    if joined is None:
        return None
    terms, track = joined
    whole = bool(track.present.all())
    values = track.values.astype(np.float64, copy=not whole)
    if not whole:
        values[~track.present] = np.nan
    return Decoded(spec.topic, track.first, terms.rate_hz, values, track.present, track.blemishes)


def frequency_from_edges(
    topics: dict[str, Topic], edge_spec: ChannelSpec, tick_spec: ChannelSpec, findings: Findings
) -> Decoded | None:
    """The frequency [Hz] from edges and ticks; None, with findings, where they give none."""
    edges = joined_channel(topics, edge_spec, findings)
    ticks = joined_channel(topics, tick_spec, findings)
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
    widths = counter_width(edge_terms, edge_track, findings), counter_width(tick_terms, tick_track, findings)
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
        Are reported.
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


def counter_width(terms: ChannelTerms, track: Track, findings: Findings) -> int | None:
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
