"""Many small messages of one layout read at once: fields by name, from messages whose bytes stand alike.

A message is taken apart once, slowly, into a template: which bytes say how it is laid out, and where its numbers stand.
All messages of the same length whose layout bytes are the same are then read together.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.container.messages import TOGETHER
from pmg.pipeline.recording.layouts.wire import WireError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import numpy.typing as npt

    from pmg.pipeline.recording.container.messages import Messages

    Bytes = npt.NDArray[np.uint8]
    Places = npt.NDArray[np.int64]

LAYOUT, CONTENT, DIGITS = 0xFF, 0x00, 0x80
"""Bits of a byte that say how a message is laid out: of a tag or a length all, of a number none, of a varint the
highest, which says whether another byte follows."""
MOST_TEMPLATES = 64
"""Layouts tried on the remaining messages of one length; beyond, messages are taken apart one by one."""


@dataclass(frozen=True)
class Leaf:
    """Numbers of one field in a message.

    Parameters
    ----------
    path : str
        Names of the fields down to it, with dots between.
    at : int
        Place of the first byte; -1 for a field that is left out because it is zero.
    form : str
        numpy type of one number; of a varint ``u8``, ``i8``, or ``z8`` where the sign is the lowest bit.
    size : int
        Bytes of a varint; 0 for numbers of fixed width.
    count : int
        Numbers of fixed width that follow each other.
    """

    path: str
    at: int
    form: str
    size: int = 0
    count: int = 1


@dataclass(frozen=True)
class Template:
    """Layout of one message.

    Parameters
    ----------
    data : bytes
        The message.
    mask : bytearray
        For each byte, which of its bits say how the message is laid out.
    leaves : tuple of Leaf
        Its numbers, in the order of the message.
    texts : tuple of (str, int, int)
        Its texts: path, first byte, and the one after the last; only CDR tells them.
    """

    data: bytes
    mask: bytearray
    leaves: tuple[Leaf, ...]
    texts: tuple[tuple[str, int, int], ...] = ()


@dataclass
class Columns:
    """Numbers of many messages by field.

    Parameters
    ----------
    size : int
        Messages.
    counts : dict of str to (size,) array
        How many numbers each message has in a field.
    values : dict of str to array
        The numbers, message after message.
    faults : dict of int to str
        Messages that cannot be read, and why.
    """

    size: int
    counts: dict[str, Places] = field(default_factory=dict)
    values: dict[str, npt.NDArray[Any]] = field(default_factory=dict)
    faults: dict[int, str] = field(default_factory=dict)

    def one(self, path: str) -> npt.NDArray[Any] | None:
        """The number of each sound message in a field; None where some have none or several."""
        counts = self.counts.get(path)
        if counts is None:
            return None
        sound = self.sound()
        return self.values[path] if np.all(counts[sound] == 1) else None

    def sound(self) -> npt.NDArray[np.bool_]:
        """Which messages could be read."""
        mask = np.ones(self.size, dtype=np.bool_)
        mask[list(self.faults)] = False
        return mask


def read_columns(payloads: Messages, template: Callable[[bytes], Template]) -> Columns:
    """Numbers of messages by field.

    Parameters
    ----------
    payloads : Messages
        The messages.
    template : callable
        Takes one message apart; raises `WireError` where it cannot.
    """
    columns = Columns(len(payloads))
    found: dict[str, list[tuple[Places, npt.NDArray[Any]]]] = {}
    known: dict[int, list[Template]] = {}
    tried: dict[int, int] = {}
    for places, data in payloads.by_length(TOGETHER):
        length = data.shape[1]
        forms = known.setdefault(length, [])
        for form in forms:
            places, data = _taken(places, data, form, found)
        while len(places):
            tried[length] = tried.get(length, 0) + 1
            try:
                form = template(data[0].tobytes())
            except WireError as fault:
                columns.faults[int(places[0])] = str(fault)
                places, data = places[1:], data[1:]
                continue
            if tried[length] <= MOST_TEMPLATES:
                forms.append(form)
                places, data = _taken(places, data, form, found)
            else:
                _taken(places[:1], data[:1], form, found)
                places, data = places[1:], data[1:]
    for path in list(found):
        columns.counts[path], columns.values[path] = gathered(len(payloads), found.pop(path))
    return columns


def _taken(
    places: Places, data: Bytes, form: Template, found: dict[str, list[tuple[Places, npt.NDArray[Any]]]]
) -> tuple[Places, Bytes]:
    """Note the numbers of the messages that are laid out as the template, and give the others."""
    alike = _alike(data, form)
    if alike.any():
        whole = bool(alike.all())
        rows, own = (data, places) if whole else (data[alike], places[alike])
        for path, numbers in _numbers(rows, form).items():
            found.setdefault(path, []).append((own, numbers))
        if whole:
            return places[:0], data[:0]
    return places[~alike], data[~alike]


def gathered(size: int, pieces: Sequence[tuple[Places, npt.NDArray[Any]]]) -> tuple[Places, npt.NDArray[Any]]:
    """Numbers of each message in the order of the messages, from pieces of (messages, (m, c) numbers)."""
    counts = np.zeros(size, dtype=np.int64)
    for rows, numbers in pieces:
        counts[rows] = numbers.shape[1]
    starts = np.cumsum(counts) - counts
    values = np.zeros(int(counts.sum()), dtype=np.result_type(*(numbers.dtype for _, numbers in pieces)))
    for rows, numbers in pieces:
        if numbers.shape[1] == 1:
            values[starts[rows]] = numbers[:, 0]
        else:
            values[starts[rows][:, None] + np.arange(numbers.shape[1])] = numbers
    # One for each is what nearly all fields have, and takes no memory.
    return np.broadcast_to(np.int64(1), size) if np.all(counts == 1) else counts, values


def _alike(data: Bytes, form: Template) -> npt.NDArray[np.bool_]:
    """Which messages are laid out as the template."""
    mask = np.frombuffer(form.mask, np.uint8)
    places = np.flatnonzero(mask)
    own = np.frombuffer(form.data, np.uint8)[places] & mask[places]
    return np.asarray(((data[:, places] & mask[places]) == own).all(axis=1))


def _numbers(data: Bytes, form: Template) -> Mapping[str, npt.NDArray[Any]]:
    """Numbers of each field, (messages, numbers), of messages that are laid out alike."""
    parts: dict[str, list[npt.NDArray[Any]]] = {}
    for leaf in form.leaves:
        if leaf.at < 0:
            part = np.zeros((len(data), 1), dtype=_wide(leaf.form))
        elif leaf.size:
            part = _varint(data[:, leaf.at : leaf.at + leaf.size], leaf.form)
        else:
            kind = np.dtype(leaf.form)
            raw = np.ascontiguousarray(data[:, leaf.at : leaf.at + kind.itemsize * leaf.count])
            part = raw.view(kind).reshape(len(data), leaf.count).astype(_wide(leaf.form))
        parts.setdefault(leaf.path, []).append(part)
    return {path: pieces[0] if len(pieces) == 1 else np.hstack(pieces) for path, pieces in parts.items()}


def _wide(form: str) -> np.dtype[Any]:
    """The widest type of a kind: what is wide enough holds each number as it is."""
    kind = form.lstrip("<>")[0]
    return np.dtype({"f": "f8", "i": "i8", "z": "i8", "u": "u8"}[kind])


def _varint(digits: Bytes, form: str) -> npt.NDArray[Any]:
    value = np.zeros(len(digits), dtype=np.uint64)
    for place in range(digits.shape[1]):
        value |= (digits[:, place].astype(np.uint64) & np.uint64(0x7F)) << np.uint64(7 * place)
    if form == "z8":
        value = (value >> np.uint64(1)) ^ (np.uint64(0) - (value & np.uint64(1)))
    return value.astype(_wide(form)).reshape(-1, 1)
