"""Blocks of samples as a channel holds them: those that can be used, in one run of the acquisition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.channels import SHARED_CLOCK
from pmg.pipeline.recording.container.file_limits import MISSING
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.layouts.manyblocks import many_blocks
from pmg.pipeline.recording.layouts.wire import SAMPLE_FIELDS

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.channels import ChannelTerms
    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.findings import Findings

    Whole = npt.NDArray[np.int64]

LARGEST_JUMP_S = 3600.0
"""A jump of the sample index over more time than this is a damaged index, not a pause [s]."""
LARGEST_INDEX = 1 << 62
"""Sample indices beyond this are damage; they would not fit into a signed number."""
FEWEST_RESTARTED = 2
"""Blocks that must follow each other after a step back of the index before it is a restart."""
MOST_COMPARED = 64
"""Steps back that are looked into, and blocks after each that are compared: a bound on the work."""
LARGEST_AGREEMENT = 0.5
"""Part of the samples given twice that may agree in a restart; above, the blocks were written twice."""


@dataclass(frozen=True)
class Blocks:
    """Blocks of one channel.

    Parameters
    ----------
    first, counts : (n,) array of int
        Index of the first sample of each block, and how many it holds.
    flags : (n,) array of unsigned int
        What the recorder says of each.
    starts : (n,) array of int
        Where the samples of each begin among the values.
    values : array
        Samples as recorded.
    """

    first: Whole
    counts: Whole
    flags: npt.NDArray[np.uint64]
    starts: Whole
    values: npt.NDArray[Any]

    def __len__(self) -> int:
        return len(self.first)

    @property
    def stops(self) -> Whole:
        """Sample index after the last of each block."""
        return np.asarray(self.first + self.counts)

    def part(self, places: slice | npt.NDArray[Any]) -> Blocks:
        """Some of the blocks."""
        return Blocks(self.first[places], self.counts[places], self.flags[places], self.starts[places], self.values)

    def in_order(self) -> Blocks:
        """The same by the index of their first samples; those with the same one as they came."""
        if np.all(self.first[1:] >= self.first[:-1]):
            return self
        return self.part(np.argsort(self.first, kind="stable"))

    def samples(self, place: int) -> npt.NDArray[Any]:
        """Samples of one block."""
        return self.values[self.starts[place] : self.starts[place] + self.counts[place]]


def read_blocks(topic: Topic, terms: ChannelTerms, findings: Findings) -> Blocks:
    """The blocks that can be read and are of the declared type and clock."""
    size = len(topic.payloads)
    found = many_blocks(topic.payloads)
    kinds = {name: number for number, (name, _, _) in SAMPLE_FIELDS.items()}
    names = {number: name for name, number in kinds.items()}
    typed = np.flatnonzero(found.kind)
    dtype = terms.dtype or (names[int(found.kind[typed[0]])] if len(typed) else "")
    sound = (found.counts > 0) & (found.first < LARGEST_INDEX) & (found.clock == SHARED_CLOCK)
    sound &= (found.kind == kinds.get(dtype, -1)) & (dtype in terms.spec.dtypes)
    faults: dict[str, int] = {}
    allowed = f"'{dtype}' as declared" if dtype in terms.spec.dtypes else " or ".join(terms.spec.dtypes)
    for place in np.flatnonzero(~sound).tolist():
        if place in found.faults:
            text = found.faults[place]
        elif not found.counts[place]:
            text = "no samples"
        elif (kind := names[int(found.kind[place])]) != dtype or dtype not in terms.spec.dtypes:
            text = f"samples of type '{kind}', not {allowed}"
        elif found.first[place] >= LARGEST_INDEX:
            text = f"sample index {found.first[place]}, which no recorder reaches"
        else:
            text = f"clock {found.clock[place]}, not {SHARED_CLOCK}"
        faults[text] = faults.get(text, 0) + 1
    for text, count in faults.items():
        findings.error(
            Code.MESSAGE_MALFORMED,
            topic.name,
            f"{count} of {size} blocks cannot be used: {text}; expected SampleBlocks of "
            f"type '{terms.dtype or SAMPLE_FIELDS[10][0]}'",
            "Their samples are missing. Check the recorder's encoder of this channel.",
            kept=f"the other {np.count_nonzero(sound)} blocks",
            lost=f"{count} blocks",
        )
    counts = np.where(sound, found.counts, 0)
    starts = np.cumsum(counts) - counts
    values = found.values(sound, starts, SAMPLE_FIELDS[kinds[dtype]][1]) if sound.any() else np.empty(0)
    return Blocks(found.first[sound].astype(np.int64), counts[sound], found.flags[sound], starts[sound], values)


def without_strays(blocks: Blocks, topic: Topic, rate_hz: float, findings: Findings) -> Blocks:
    """The largest run of blocks, which are in order, without an impossible jump of the index.

    Jumps that are possible each, but leave out more samples together than a file of its size may, are not.
    """
    most = MISSING.of(topic.file_size)
    limit = min(most, LARGEST_JUMP_S * rate_hz)
    low, high = _largest_run(blocks, limit)
    while _missing(best := blocks.part(slice(low, high))) > most:
        limit /= 2.0
        low, high = _largest_run(blocks, limit)
    if len(best) == len(blocks):
        return blocks
    inside = np.zeros(len(blocks), dtype=np.bool_)
    inside[low:high] = True
    strays = blocks.part(~inside)
    findings.error(
        Code.SAMPLES_ASTRAY,
        topic.name,
        f"{len(strays)} blocks, the first at sample {strays.first[0]}, lie far from the others, or the gaps "
        f"between all leave out more than {most} samples; "
        f"expected indices near {best.first[0]}. They are left out",
        "The index was damaged or the clock reset inside the run: check the recorder.",
        sample_range=(int(strays.first.min()), int(strays.stops.max())),
        kept=f"{best.counts.sum()} samples",
        lost=f"{strays.counts.sum()} samples",
    )
    return best


def _largest_run(blocks: Blocks, limit: float) -> tuple[int, int]:
    """First block of the run of most samples without a jump beyond the limit, and the one after its last."""
    borders = np.flatnonzero(blocks.first[1:] - blocks.stops[:-1] > limit) + 1
    lows, highs = np.concatenate(([0], borders)), np.concatenate((borders, [len(blocks)]))
    largest = int(np.argmax(np.add.reduceat(blocks.counts, lows)))
    return int(lows[largest]), int(highs[largest])


def _missing(blocks: Blocks) -> int:
    """Samples between the first and the last that no block holds, where none overlap."""
    return int(blocks.stops.max() - blocks.first[0] - blocks.counts.sum())


def before_restart(blocks: Blocks, topic: str, findings: Findings) -> Blocks:
    """The blocks, in file order, up to where the index begins anew.

    Notes
    -----
    Blocks may come late, or twice; then they fit or agree. A restart is a step back of the index after which at
    least `FEWEST_RESTARTED` blocks follow each other over samples that are there already with other values. Where
    the second run lies in time nobody says, so the first one is kept, in every channel alike.
    """
    reached = np.maximum.accumulate(blocks.stops)
    back = np.flatnonzero(blocks.first[1:] < reached[:-1] - blocks.counts[1:]) + 1
    for place in back[:MOST_COMPARED].tolist():
        if _anew(blocks.part(slice(place)), blocks.part(slice(place, None)), int(reached[place - 1])):
            rest = blocks.part(slice(place, None))
            findings.error(
                Code.RESTART,
                topic,
                f"the sample index falls from {reached[place - 1]} to {rest.first[0]} and {len(rest)} blocks follow "
                "with other values; expected an index that is never reset inside a run. They are left out",
                "Start a new file with each acquisition.",
                sample_range=(int(rest.first[0]), int(rest.stops.max())),
                kept=f"{blocks.counts[:place].sum()} samples before it",
                lost=f"{rest.counts.sum()} samples after it",
            )
            return blocks.part(slice(place))
    return blocks


def _anew(earlier: Blocks, later: Blocks, reached: int) -> bool:
    """Whether the later blocks are another run than the earlier ones."""
    first, counts = later.first[:MOST_COMPARED], later.counts[:MOST_COMPARED]
    follows = (first[1:] >= first[:-1]) & (first[1:] <= first[:-1] + (1 + MOST_COMPARED) * counts[:-1])
    follows &= first[:-1] < reached
    many = len(first) if follows.all() else int(np.argmin(follows)) + 1
    inside = later.part(np.flatnonzero(first[:many] < reached))
    if len(inside) < FEWEST_RESTARTED:
        return False
    start, stop = int(inside.first[0]), int(inside.stops.max())
    known = np.full(stop - start, np.nan)
    for place in np.flatnonzero((earlier.first < stop) & (earlier.stops > start)).tolist():
        begin = int(earlier.first[place])
        low, high = max(start, begin), min(stop, int(earlier.stops[place]))
        known[low - start : high - start] = earlier.samples(place)[low - begin : high - begin]
    twice = agreed = 0
    for place, begin in enumerate((inside.first - start).tolist()):
        there = known[begin : begin + int(inside.counts[place])]
        twice += int(np.count_nonzero(~np.isnan(there)))
        agreed += int(np.count_nonzero(there == inside.samples(place)))
    return twice > 0 and agreed <= LARGEST_AGREEMENT * twice
