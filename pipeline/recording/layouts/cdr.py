"""ROS 2 messages in CDR, the wire format of DDS: plain CDR of either byte order, by the definitions in the file.

Measured against rosbags 0.11.9: both refuse messages whose lengths are damaged; of a damaged text length rosbags
refuses more. It makes an object of each message and reads 0.1 million messages of one value a second, where those of
one form are read here as one array at 0.8 million. Of blocks of 1000 values it reads 39 thousand, these lines 7.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pmg.pipeline.recording.layouts.layout import CONTENT, Leaf, Template
from pmg.pipeline.recording.layouts.rostypes import PRIMITIVES, MessageField, plain_name, types_of
from pmg.pipeline.recording.layouts.wire import WireError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

HEAD = 4
"""Bytes of the encapsulation: kind of encoding, options."""
KINDS = {0x00: (">", 8), 0x01: ("<", 8), 0x06: (">", 4), 0x07: ("<", 4)}
"""Byte order and largest alignment of plain CDR and plain CDR 2; delimited and parameter lists are not read."""
PADDING = 3
"""Bytes that may follow the last field."""
DEEPEST = 16
"""Messages within messages that are followed."""
MOST_STRUCTS = 1 << 16
"""Longest sequence of messages that is followed."""


def cdr_template(name: str, encoding: str, text: str) -> Callable[[bytes], Template]:
    """Takes ROS 2 messages of a kind apart.

    Parameters
    ----------
    name : str
        Kind of the messages, such as ``std_msgs/msg/Float64``.
    encoding : str
        ``ros2msg`` or ``ros2idl``.
    text : str
        Its definition and those of the messages within it.

    Raises
    ------
    WireError
        When the definitions cannot be understood.
    """
    types = types_of(name, encoding, text)
    own = plain_name(name)
    if own not in types:
        raise WireError(f"the schema does not define message '{own}'")

    def take_apart(data: bytes) -> Template:
        if len(data) < HEAD or data[0] != 0 or data[1] not in KINDS:
            raise WireError(f"encapsulation {data[:2].hex()} is not read; plain CDR is, 0000, 0001, 0006 or 0007")
        order, largest = KINDS[data[1]]
        walk = _Walk(data, types, order, largest)
        walk.mask[2:HEAD] = bytes([CONTENT]) * (HEAD - 2)
        walk.message(own, "", 0)
        if not 0 <= len(data) - walk.at <= PADDING:
            raise WireError(f"{len(data) - walk.at} bytes follow the last field")
        return Template(data, walk.mask, tuple(walk.leaves), tuple(walk.texts))

    return take_apart


@dataclass
class _Walk:
    """A message while it is taken apart: where the walk stands, and what it has found."""

    data: bytes
    types: Mapping[str, tuple[MessageField, ...]]
    order: str
    largest: int
    at: int = HEAD
    mask: bytearray = field(default_factory=bytearray)
    leaves: list[Leaf] = field(default_factory=list)
    texts: list[tuple[str, int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.mask = bytearray(b"\xff" * len(self.data))

    def message(self, name: str, prefix: str, depth: int) -> None:
        """Take the fields of a message."""
        if name not in self.types:
            raise WireError(f"the schema does not define message '{name}'")
        if depth > DEEPEST:
            raise WireError(f"message '{name}' holds messages more than {DEEPEST} deep")
        members = self.types[name]
        if not members:
            self.take(1)
        for member in members:
            self.member(member, prefix + member.name, depth)

    def member(self, member: MessageField, path: str, depth: int) -> None:
        """Take one field."""
        many = self.length(path) if member.many == 0 else member.many
        if member.kind in PRIMITIVES:
            self.numbers(PRIMITIVES[member.kind], path, 1 if many is None else many)
        elif member.kind == "string":
            for _ in range(1 if many is None else self.bounded(many, path)):
                size = self.length(path)
                self.texts.append((path, self.at, self.at + size))
                self.take(size)
        elif member.kind == "wstring":
            raise WireError(f"'{path}' is a wstring, which writers lay out differently; it is not read")
        else:
            for _ in range(1 if many is None else self.bounded(many, path)):
                self.message(member.kind, path + ".", depth + 1)

    def bounded(self, many: int, path: str) -> int:
        """A number of elements that are walked one by one."""
        if many > MOST_STRUCTS:
            raise WireError(f"'{path}' has {many} elements; at most {MOST_STRUCTS} are read")
        return many

    def numbers(self, form: str, path: str, count: int) -> None:
        """Take primitives that follow each other."""
        width = int(form[1])
        if count:
            self.align(width)
        start = self.at
        self.take(width * count)
        self.leaves.append(Leaf(path, start, self.order + form, count=count))

    def length(self, path: str) -> int:
        """Take the length of a text or a sequence."""
        self.align(4)
        start = self.at
        if start + 4 > len(self.data):
            raise WireError(f"the message ends before '{path}'")
        self.at = start + 4
        return int.from_bytes(self.data[start : self.at], "little" if self.order == "<" else "big")

    def align(self, width: int) -> None:
        """Step over the padding before a number."""
        step = min(width, self.largest)
        gap = -(self.at - HEAD) % step
        self.take(gap)

    def take(self, count: int) -> None:
        """Step over bytes that say nothing about the layout."""
        if self.at + count > len(self.data):
            raise WireError(f"the message ends {self.at + count - len(self.data)} bytes early")
        self.mask[self.at : self.at + count] = bytes([CONTENT]) * count
        self.at += count
