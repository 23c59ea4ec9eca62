"""Samples packed into blocks of the layout; many small blocks made few."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.container.messages import Messages
from pmg.pipeline.recording.layouts.descriptor import protobuf_template
from pmg.pipeline.recording.layouts.layout import read_columns
from pmg.pipeline.recording.layouts.schema import SAMPLE_BLOCK, encode
from pmg.pipeline.recording.layouts.wire import SAMPLE_FIELDS

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.container.contents import Topic

    Places = npt.NDArray[np.int64]

BLOCK = 1000
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
        for start in range(low, high, BLOCK):
            part = values[start : min(start + BLOCK, high)]
            head = {"first_sample": int(index[start]) & 0xFFFF_FFFF_FFFF_FFFF, "flags": int(flag[start])}
            block = encode(SAMPLE_BLOCK, head | {dtype: part})
            made.append(memoryview(block), 0, len(block))
    return made


def repacked(topic: Topic) -> Topic:
    """A topic of many small blocks with few larger ones; what cannot be read stays as it is, behind them."""
    payloads = topic.payloads
    if len(payloads) <= MANY or payloads.size > SMALL * len(payloads):
        return topic
    columns = read_columns(payloads, protobuf_template(SAMPLE_BLOCK))
    kinds = [name for name, _, _ in SAMPLE_FIELDS.values() if len(columns.values.get(name, ()))]
    sound = columns.sound()
    first, clock, flags = (columns.one(name) for name in ("first_sample", "clock_id", "flags"))
    if len(kinds) != 1 or first is None or clock is None or flags is None or clock.any():
        return topic
    counts = columns.counts[kinds[0]][sound]
    if first.max(initial=0) >= 1 << 62 or not counts.all():
        return topic
    made = packed(first.astype(np.int64), counts, kinds[0], columns.values[kinds[0]], flags.astype(np.int64))
    if columns.faults:
        made.join(payload for place, payload in enumerate(payloads) if place in columns.faults)
    return replace(topic, payloads=made)
