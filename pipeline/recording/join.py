"""Blocks of one channel joined by their sample index; what is missing stays missing."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.channels import SHARED_CLOCK
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.wire import SAMPLE_FIELDS, WireError, sample_block

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.channels import ChannelTerms
    from pmg.pipeline.recording.container import Topic
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.wire import SampleBlock
    from pmg.sim.signals import Mask

OVERRUN, RESTART, SATURATED, SIMULATED = 1, 2, 4, 8
LARGEST_JUMP_S = 3600.0
"""A jump of the sample index over more time than this is a damaged index, not a pause [s]."""
LARGEST_JUMP = 50_000_000
"""The same in samples: what fits into memory at the highest rates."""
LARGEST_INDEX = 1 << 62
"""Sample indices beyond this are damage; they would not fit into a signed number."""

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
    """A stretch of samples that the recorder itself marks as bad.

    Parameters
    ----------
    topic : str
        Channel.
    code : Code
        Overrun, restart or saturation.
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
    blocks = _read(topic, terms, findings)
    if not blocks:
        findings.error(
            Code.CHANNEL_MISSING,
            topic.name,
            f"{topic.count} messages give no samples; expected blocks of {' or '.join(terms.spec.dtypes)}",
            "Check that the recorder writes this channel.",
        )
        return None
    blocks = _without_strays(sorted(blocks, key=lambda b: b.first_sample), topic.name, terms.rate_hz, findings)
    first = blocks[0].first_sample
    length = max(b.first_sample + len(b.values) for b in blocks) - first
    values = np.zeros(length, dtype=blocks[0].values.dtype)
    present = np.zeros(length, dtype=np.bool_)
    torn = np.zeros(length, dtype=np.bool_)
    repeated = 0
    filled = 0
    for block in blocks:
        start = block.first_sample - first
        here = slice(start, start + len(block.values))
        if start < filled:
            twice = present[here]
            repeated += int(np.count_nonzero(twice))
            torn[here] |= twice & _differ(values[here], block.values)
        values[here] = block.values
        present[here] = True
        filled = max(filled, start + len(block.values))
    present &= ~torn
    if values.dtype.kind == "f":
        present &= _finite(values, present, topic.name, findings)
    _report(topic.name, first, present, torn, repeated, findings)
    return Track(first, values, present, _blemishes(blocks, topic.name, findings))


def _differ(one: npt.NDArray[Any], other: npt.NDArray[Any]) -> Mask:
    """Where two stretches differ in a bit; NaN equals NaN."""
    bits = np.dtype(f"u{one.dtype.itemsize}")
    return np.asarray(np.ascontiguousarray(one).view(bits) != np.ascontiguousarray(other).view(bits))


def _read(topic: Topic, terms: ChannelTerms, findings: Findings) -> list[SampleBlock]:
    """The blocks that can be read and are of the declared type and clock."""
    blocks: list[SampleBlock] = []
    faults: dict[str, int] = {}
    dtype = terms.dtype
    for payload in topic.payloads:
        try:
            block = sample_block(payload)
        except WireError as fault:
            faults[str(fault)] = faults.get(str(fault), 0) + 1
            continue
        dtype = dtype or block.dtype
        if not len(block.values):
            fault_text = "no samples"
        elif block.dtype != dtype or dtype not in terms.spec.dtypes:
            allowed = f"'{dtype}' as declared" if dtype in terms.spec.dtypes else " or ".join(terms.spec.dtypes)
            fault_text = f"samples of type '{block.dtype}', not {allowed}"
        elif block.first_sample >= LARGEST_INDEX:
            fault_text = f"sample index {block.first_sample}, which no recorder reaches"
        elif block.clock_id != SHARED_CLOCK:
            fault_text = f"clock {block.clock_id}, not {SHARED_CLOCK}"
        else:
            blocks.append(block)
            continue
        faults[fault_text] = faults.get(fault_text, 0) + 1
    for text, count in faults.items():
        findings.error(
            Code.MESSAGE_MALFORMED,
            topic.name,
            f"{count} of {len(topic.payloads)} blocks cannot be used: {text}; expected SampleBlocks of "
            f"type '{terms.dtype or SAMPLE_FIELDS[10][0]}'",
            "Their samples are missing. Check the recorder's encoder of this channel.",
        )
    return blocks


def _without_strays(blocks: list[SampleBlock], topic: str, rate_hz: float, findings: Findings) -> list[SampleBlock]:
    """The largest run of blocks without an impossible jump of the index."""
    runs: list[list[SampleBlock]] = [[blocks[0]]]
    for before, block in pairwise(blocks):
        jump = block.first_sample - before.first_sample - len(before.values)
        if jump > min(LARGEST_JUMP, LARGEST_JUMP_S * rate_hz):
            runs.append([])
        runs[-1].append(block)
    best = max(runs, key=lambda run: sum(len(b.values) for b in run))
    strays = [b for run in runs if run is not best for b in run]
    if strays:
        findings.error(
            Code.SAMPLES_ASTRAY,
            topic,
            f"{len(strays)} blocks, the first at sample {strays[0].first_sample}, lie far from the others; "
            f"expected indices near {best[0].first_sample}. They are left out",
            "The index was damaged or the clock reset inside the run: check the recorder.",
        )
    return best


def _finite(values: npt.NDArray[Any], present: Mask, topic: str, findings: Findings) -> npt.NDArray[np.bool_]:
    finite: npt.NDArray[np.bool_] = np.isfinite(values)
    bad = int(np.count_nonzero(present & ~finite))
    if bad:
        findings.error(
            Code.NOT_FINITE,
            topic,
            f"{bad} samples are NaN or infinite; expected finite numbers. They are treated as missing",
            "Check the input's wiring and the recorder's conversion.",
        )
    return finite


def _report(topic: str, first: int, present: Mask, torn: Mask, repeated: int, findings: Findings) -> None:
    conflicts = int(np.count_nonzero(torn))
    if conflicts:
        findings.error(
            Code.SAMPLES_CONFLICT,
            topic,
            f"{conflicts} samples from {first + int(np.argmax(torn))} on are given twice and differ; "
            "expected one value each. They are treated as missing",
            "Check the recorder: two writers, or an index that was reset.",
            sample_range=_from_to(torn, first),
            kept="the other samples",
            lost=f"{conflicts} samples",
        )
    if repeated > conflicts:
        findings.warning(
            Code.SAMPLES_DUPLICATE,
            topic,
            f"{repeated - conflicts} samples are given twice with the same values; expected each once",
            "Nothing is lost. Check the recorder for repeated blocks.",
        )
    missing = int(np.count_nonzero(~present & ~torn))
    if missing:
        edges = np.diff(np.concatenate(([True], present | torn, [True])).astype(np.int8))
        starts = np.flatnonzero(edges < 0)
        findings.error(
            Code.SAMPLES_GAP,
            topic,
            f"{missing} of {len(present)} samples are missing in {len(starts)} gaps, the first at sample "
            f"{first + int(starts[0])}; expected a record without gaps",
            "Windows over a gap are rejected. Find out why the recorder lost them.",
            sample_range=_from_to(~present & ~torn, first),
            kept=f"{int(np.count_nonzero(present))} samples",
            lost=f"{missing} samples",
        )


def _from_to(mask: Mask, first: int) -> tuple[int, int]:
    """Samples from the first of a mask to its last, the end left out."""
    at = np.flatnonzero(mask)
    return first + int(at[0]), first + int(at[-1]) + 1


def _blemishes(blocks: list[SampleBlock], topic: str, findings: Findings) -> tuple[Blemish, ...]:
    marks: list[Blemish] = []
    for bit, (code, what, do) in FLAGS.items():
        flagged = [b for b in blocks if b.flags & bit]
        marks += [Blemish(topic, code, b.first_sample, b.first_sample + len(b.values)) for b in flagged]
        if flagged:
            findings.error(
                code,
                topic,
                f"{len(flagged)} of {len(blocks)} blocks, the first at sample {flagged[0].first_sample}, are "
                f"flagged: {what}; expected no flag. Windows over them are rejected",
                do,
            )
    if any(b.flags & SIMULATED for b in blocks):
        findings.info(
            Code.SIMULATED,
            topic,
            "blocks are flagged as simulated; expected measured ones in a campaign of the bench",
            "Do not mix them with measurements.",
        )
    return tuple(marks)
