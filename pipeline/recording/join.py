"""Blocks of one channel joined by their sample index; what is missing stays missing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.blocks import before_restart, read_blocks, without_strays
from pmg.pipeline.recording.checks.stretches import stretches, tell_stretches
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.run import LARGEST_NUMBER

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.blocks import Blocks
    from pmg.pipeline.recording.channels import ChannelTerms
    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Mask

OVERRUN, RESTART, SATURATED, SIMULATED = 1, 2, 4, 8

FLAGS = {
    OVERRUN: (
        Code.OVERRUN,
        "the recorder lost samples before it",
        "Lower the rate, or give it a faster disk.",
    ),
    RESTART: (Code.RESTART, "the acquisition was restarted before it", "Look up why in the bench's log."),
    SATURATED: (
        Code.SATURATED,
        "the input was beyond its range",
        "Use a larger range: values are lower bounds.",
    ),
}
"""Flags that spoil a block: code, what happened, what to do."""


@dataclass(frozen=True)
class Blemish:
    """A stretch of samples that the recorder itself marks as bad, or in which the reading found a fault.

    Parameters
    ----------
    topic : str
        Channel.
    code : Code
        Overrun, restart or saturation; or a slipped encoder, held values, the shunt signal.
    start, stop : int
        Sample indices, `stop` left out.
    """

    topic: str
    code: Code
    start: int
    stop: int


@dataclass(frozen=True)
class Track:
    """Samples of one channel on its clock.

    Parameters
    ----------
    first : int
        Sample index of the first entry.
    values : (n,) array
        As recorded; an arbitrary value where nothing was.
    present : (n,) array of bool
        Where something was.
    blemishes : tuple of Blemish
        Stretches marked bad by the recorder.
    """

    first: int
    values: npt.NDArray[Any]
    present: Mask
    blemishes: tuple[Blemish, ...]

    @property
    def stop(self) -> int:
        """Sample index after the last entry."""
        return self.first + len(self.values)


def join_blocks(topic: Topic, terms: ChannelTerms, findings: Findings) -> Track | None:
    """One track from the blocks of a channel; None, with findings, where there are no samples.

    Parameters
    ----------
    topic : Topic
        The channel's messages, in file order.
    terms : ChannelTerms
        Its metadata.
    findings : Findings
        Receives gaps, repetitions, contradictions and the recorder's own flags.

    Notes
    -----
    A block belongs where its `first_sample` says; the time at which it was written is not looked at. A sample
    that two blocks give differently is trusted from neither.
    """
    blocks = read_blocks(topic, terms, findings)
    if not len(blocks):
        findings.error(
            Code.CHANNEL_MISSING,
            topic.name,
            f"{topic.count} messages give no samples; expected blocks of {' or '.join(terms.spec.dtypes)}",
            "Check that the recorder writes this channel.",
        )
        return None
    blocks = before_restart(blocks, topic.name, findings)
    blocks = without_strays(blocks.in_order(), topic, terms.rate_hz, findings)
    first = int(blocks.first[0])
    values, present = _whole(blocks) or _laid(blocks, topic.name, findings)
    if values.dtype.kind == "f":
        present &= _finite(values, present, first, topic.name, findings)
    if present.all():
        present = np.broadcast_to(np.True_, present.shape)
    return Track(first, values, present, _blemishes(blocks, topic.name, findings))


def _whole(blocks: Blocks) -> tuple[npt.NDArray[Any], Mask] | None:
    """Samples of blocks that follow each other without a gap, as they were read; None for others."""
    apart = (blocks.first[1:] != blocks.stops[:-1]) | (blocks.starts[1:] != blocks.starts[:-1] + blocks.counts[:-1])
    if apart.any():
        return None
    begin = int(blocks.starts[0])
    values = blocks.values[begin : begin + int(blocks.counts.sum())]
    return values, np.ones(len(values), dtype=np.bool_)


def _laid(blocks: Blocks, topic: str, findings: Findings) -> tuple[npt.NDArray[Any], Mask]:
    """Samples of blocks in order, each at its index; what is missing or given twice becomes findings."""
    first = int(blocks.first[0])
    length = int(blocks.stops.max()) - first
    values = np.zeros(length, dtype=blocks.values.dtype)
    present = np.zeros(length, dtype=np.bool_)
    torn = np.zeros(length, dtype=np.bool_)
    again = np.zeros(length, dtype=np.bool_)
    filled = 0
    for place, start in enumerate((blocks.first - first).tolist()):
        given = blocks.samples(place)
        stop = start + len(given)
        here = slice(start, stop)
        if start < filled:
            twice = present[here]
            again[here] |= twice
            torn[here] |= twice & _differ(values[here], given)
        values[here] = given
        present[here] = True
        filled = max(filled, stop)
    lacking = ~present
    present &= ~torn
    _report(topic, first, lacking, torn, again, findings)
    return values, present


def _differ(one: npt.NDArray[Any], other: npt.NDArray[Any]) -> Mask:
    """Where two stretches differ in a bit; NaN equals NaN."""
    bits = np.dtype(f"u{one.dtype.itemsize}")
    return np.asarray(np.ascontiguousarray(one).view(bits) != np.ascontiguousarray(other).view(bits))


def _finite(
    values: npt.NDArray[Any], present: Mask, first: int, topic: str, findings: Findings
) -> npt.NDArray[np.bool_]:
    finite: npt.NDArray[np.bool_] = np.isfinite(values)
    if finite.all() and values.max() <= LARGEST_NUMBER and values.min() >= -LARGEST_NUMBER:
        return finite
    finite &= np.abs(values) <= LARGEST_NUMBER
    words = (
        f"are NaN, infinite or beyond {LARGEST_NUMBER:g}",
        "finite numbers. They are treated as missing",
        "Check the input's wiring and the recorder's conversion.",
    )
    found = stretches(present & ~finite) + first
    tell_stretches(findings.error, Code.NOT_FINITE, topic, found, words, kept="the other samples", lost="{n} samples")
    return finite


def _report(topic: str, first: int, lacking: Mask, torn: Mask, again: Mask, findings: Findings) -> None:
    words = (
        "are given twice and differ",
        "one value each. They are treated as missing",
        "Check the recorder: two writers, or an index that was reset.",
    )
    found, kept, lost = stretches(torn) + first, "the other samples", "{n} samples"
    tell_stretches(findings.error, Code.SAMPLES_CONFLICT, topic, found, words, kept=kept, lost=lost)
    words = (
        "are given twice with the same values",
        "each once",
        "Nothing is lost. Check the recorder for repeated blocks.",
    )
    found = stretches(again & ~torn) + first
    tell_stretches(findings.warning, Code.SAMPLES_DUPLICATE, topic, found, words, kept="all samples")
    words = (
        f"of {len(lacking)} are missing",
        "a record without gaps",
        "Windows over a gap are rejected. Find out why the recorder lost them.",
    )
    found, kept = stretches(lacking) + first, f"{int(np.count_nonzero(~lacking))} samples"
    tell_stretches(findings.error, Code.SAMPLES_GAP, topic, found, words, kept=kept, lost=lost)


def _blemishes(blocks: Blocks, topic: str, findings: Findings) -> tuple[Blemish, ...]:
    marks: list[Blemish] = []
    for bit, (code, what, do) in FLAGS.items():
        flagged = _covered(blocks, bit)
        marks += [Blemish(topic, code, start, stop) for start, stop in flagged.tolist()]
        words = (f"are flagged: {what}", "no flag. Windows over them are rejected", do)
        tell_stretches(findings.error, code, topic, flagged, words, kept="the samples, with a mark")
    simulated = _covered(blocks, SIMULATED)
    if len(simulated):
        findings.info(
            Code.SIMULATED,
            topic,
            "blocks are flagged as simulated; expected measured ones in a campaign of the bench",
            "Do not mix them with measurements.",
            sample_range=(int(simulated[0, 0]), int(simulated[-1, 1])),
        )
    return tuple(marks)


def _covered(blocks: Blocks, bit: int) -> npt.NDArray[np.int64]:
    """Sample indices that blocks with a flag cover, (k, 2), those that touch made one."""
    flagged = blocks.part((blocks.flags & np.uint64(bit)) != 0)
    reached = np.maximum.accumulate(flagged.stops)
    new = np.flatnonzero(flagged.first[1:] > reached[:-1]) + 1
    if not len(flagged):
        return np.empty((0, 2), dtype=np.int64)
    starts, ends = np.concatenate(([0], new)), np.concatenate((new, [len(flagged)])) - 1
    return np.column_stack((flagged.first[starts], reached[ends]))
