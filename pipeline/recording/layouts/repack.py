"""Samples packed into blocks of the layout; many small blocks made few."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.container.messages import Messages
from pmg.pipeline.recording.layouts.manyblocks import many_blocks
from pmg.pipeline.recording.layouts.schema import SAMPLE_BLOCK, encode
from pmg.pipeline.recording.layouts.wire import SAMPLE_FIELDS

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.container.contents import Topic

    Places = npt.NDArray[np.int64]

BLOCK_SAMPLES = 1000
"""Samples of a block that is made here."""
MANY, SMALL = 256, 64
"""More messages than this, of fewer bytes each on average, are read together."""


def packed(
    first: Places, counts: Places, dtype: str, values: npt.NDArray[Any], flags: Places | None = None
) -> Messages:
    """Blocks of samples that follow each other, in the order in which they came.

    Parameters
    ----------
    first, counts : (n,) array of int
        Index of the first sample of each message, and how many it holds.
    dtype : str
        Sample type of the layout.
    values : array
        Samples, message after message.
    flags : (n,) array of int, optional
        Flags of each message.
    """
    starts = np.cumsum(counts) - counts
    index = np.repeat(first - starts, counts) + np.arange(len(values))
    flag = np.zeros(len(values), dtype=np.int64) if flags is None else np.repeat(flags, counts)
    new = (np.diff(index) != 1) | (np.diff(flag) != 0)
    runs = np.concatenate(([0], np.flatnonzero(new) + 1, [len(values)]))
    made = Messages()
    for low, high in zip(runs[:-1].tolist(), runs[1:].tolist(), strict=True):
        for start in range(low, high, BLOCK_SAMPLES):
            part = values[start : min(start + BLOCK_SAMPLES, high)]
            head = {"first_sample": int(index[start]) & 0xFFFF_FFFF_FFFF_FFFF, "flags": int(flag[start])}
            block = encode(SAMPLE_BLOCK, head | {dtype: part})
            made.append(memoryview(block), 0, len(block))
    return made


def repacked(topic: Topic) -> Topic:
    """A topic of many small blocks with few larger ones, and what cannot be read behind them; the blocks are let go."""
    payloads = topic.payloads
    if len(payloads) <= MANY or payloads.size > SMALL * len(payloads):
        return topic
    found = many_blocks(payloads)
    sound = np.ones(len(payloads), dtype=np.bool_)
    sound[list(found.faults)] = False
    kinds = np.unique(found.kind[sound]).tolist()
    if len(kinds) != 1 or kinds[0] == 0 or found.clock[sound].any() or not found.counts[sound].all():
        return topic
    if found.first[sound].max() >= 1 << 62:
        return topic
    name, dtype, _ = SAMPLE_FIELDS[kinds[0]]
    counts = np.where(sound, found.counts, 0)
    values = found.values(sound, np.cumsum(counts) - counts, dtype)
    first, flags = (column[sound].astype(np.int64) for column in (found.first, found.flags))
    made = packed(first, counts[sound], name, values, flags)
    made.join(payload for _, payload in payloads.those(~sound))
    payloads.let_go()
    return replace(topic, payloads=made)
