"""Many blocks of samples read at once, as far as their bytes stand alike."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.layouts.wire import (
    BYTES,
    FIXED64,
    SAMPLE_FIELDS,
    VARINT,
    WireError,
    sample_block,
    varint,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.container.messages import Bytes, Messages, Places

    Wide = npt.NDArray[np.uint64]

PLAIN = {1 << 3 | BYTES: "", 2 << 3 | FIXED64: "first", 3 << 3 | VARINT: "clock", 4 << 3 | VARINT: "flags"}
"""First bytes of the fields that may come before the samples, in this order, and what they say."""
HUGE = 1 << 22
"""From this size on numpy asks for large pages, which a system hands out faster [bytes]."""
NARROW = 64
"""Blocks of up to so many bytes of samples are laid out many at once."""
PACKED = {number << 3 | BYTES: number for number in SAMPLE_FIELDS}
"""First bytes of packed samples."""


@dataclass(frozen=True)
class _Head:
    """Layout of a block whose samples are its last field.

    Parameters
    ----------
    fixed : list of int
        Places of the bytes that say so.
    at : dict of str to int
        Place of the index of the first sample, the clock and the flags, as far as they are given.
    number : int
        Field of the samples.
    samples : int
        Place of the samples.
    """

    fixed: list[int]
    at: dict[str, int]
    number: int
    samples: int


@dataclass(frozen=True)
class Found:
    """Contents of blocks, each at its place.

    Parameters
    ----------
    first, clock, flags : (n,) array of unsigned int
        Index of the first sample, clock and flags.
    kind, counts : (n,) array of int
        Field of the samples, 0 without any; how many they are.
    faults : dict of int to str
        Blocks that cannot be read, and why.
    pieces : list of (places, (m, k) array of bytes)
        Bytes of the samples of some blocks.
    """

    first: Wide
    clock: Wide
    flags: Wide
    kind: Places
    counts: Places
    faults: dict[int, str] = field(default_factory=dict)
    pieces: list[tuple[Places, Bytes]] = field(default_factory=list)

    def values(self, sound: npt.NDArray[np.bool_], starts: Places, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
        """Samples of the sound blocks, all of one type, each at its start."""
        size = int(self.counts[sound].sum())
        large = HUGE // dtype.itemsize if size * dtype.itemsize > HUGE >> 2 else 0
        values = np.empty(max(size, large), dtype)[:size]
        raw = values.view(np.uint8)
        for places, data in self.pieces:
            kept = sound[places]
            if not kept.all():
                places, data = places[kept], data[kept]
            begin, width = starts[places] * dtype.itemsize, data.shape[1]
            if len(places) and np.all(np.diff(begin) == width):
                raw[begin[0] : begin[0] + data.size].reshape(data.shape)[:] = data
                continue
            if width <= NARROW:
                raw[begin[:, None] + np.arange(width)] = data
                continue
            for at, row in zip(begin.tolist(), data, strict=True):
                raw[at : at + width] = row
        return values


def many_blocks(payloads: Messages) -> Found:
    """Contents of many SampleBlocks."""
    size = len(payloads)
    wide = [np.zeros(size, dtype=np.uint64) for _ in range(3)]
    found = Found(wide[0], wide[1], wide[2], np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64))
    for places, rows in payloads.by_length():
        alike = np.zeros(len(rows), dtype=np.bool_)
        head = _head_of(rows[0].tobytes())
        if head is not None:
            alike = (rows[:, head.fixed] == rows[0, head.fixed]).all(axis=1)
            alike &= (rows[:, [head.at[name] for name in ("clock", "flags") if name in head.at]] < 0x80).all(axis=1)
            _note(found, places[alike], rows if alike.all() else rows[alike], head)
        for row in np.flatnonzero(~alike).tolist():
            _note_one(found, int(places[row]), rows[row].tobytes())
    return found


def _head_of(data: bytes) -> _Head | None:
    """Layout of a block; None unless it is as nearly every writer leaves it.

    That is: each field at most once, in the order of their numbers, the samples in one packed piece up to the end, and
    clock and flags below 128.
    """
    at, last = 0, 0
    fixed: list[int] = []
    said: dict[str, int] = {}
    try:
        while data[at] in PLAIN and data[at] > last:
            name, last = PLAIN[data[at]], data[at]
            fixed.append(at)
            if last & 7 == BYTES:
                length, after = varint(data, at + 1)
                fixed.extend(range(at + 1, after))
                at = after + length
            else:
                said[name] = at + 1
                at += 9 if last & 7 == FIXED64 else 2
        number = PACKED.get(data[at])
        length, samples = varint(data, at + 1)
    except (IndexError, WireError):
        return None
    if number is None or samples + length != len(data) or length % SAMPLE_FIELDS[number][1].itemsize:
        return None
    if any(data[said[name]] >= 0x80 for name in ("clock", "flags") if name in said):
        return None
    fixed.extend(range(at, samples))
    return _Head(fixed, said, number, samples)


def _note(found: Found, places: Places, rows: Bytes, head: _Head) -> None:
    """Note blocks that are laid out alike, (n, length)."""
    if "first" in head.at:
        at = head.at["first"]
        found.first[places] = np.ascontiguousarray(rows[:, at : at + 8]).view("<u8")[:, 0]
    for name, column in (("clock", found.clock), ("flags", found.flags)):
        if name in head.at:
            column[places] = rows[:, head.at[name]]
    found.kind[places] = head.number
    found.counts[places] = (rows.shape[1] - head.samples) // SAMPLE_FIELDS[head.number][1].itemsize
    found.pieces.append((places, rows[:, head.samples :]))


def _note_one(found: Found, place: int, data: bytes) -> None:
    """Note one block, however it is laid out."""
    try:
        block = sample_block(data)
    except WireError as fault:
        found.faults[place] = str(fault)
        return
    found.first[place], found.clock[place], found.flags[place] = block.first_sample, block.clock_id, block.flags
    found.counts[place] = len(block.values)
    if block.dtype:
        found.kind[place] = next(number for number, (name, _, _) in SAMPLE_FIELDS.items() if name == block.dtype)
        raw = np.frombuffer(block.values.tobytes(), dtype=np.uint8)
        found.pieces.append((np.array([place]), raw.reshape(1, -1)))
