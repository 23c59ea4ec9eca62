"""Messages gathered in a pass over the records of a file, by channel."""

from __future__ import annotations

import struct
from array import array
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pmg.pipeline.recording.container.messages import Messages
from pmg.pipeline.recording.container.records import MESSAGE, Attachment, ChannelRecord, RecordError, Schema
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    import numpy.typing as npt

    from pmg.pipeline.recording.findings import Findings

FIELDS_KEY = "pmg.fields"
"""Channel metadata that says which fields of its messages are which topics of the layout."""

LOG_TIME, _LOG_TIME = 6, struct.Struct("<Q")
"""Place of the log time in the head of a message, and its form."""


@dataclass
class WholeRecords:
    """Whole records of a file.

    Parameters
    ----------
    wanted : callable
        Whether the messages of a topic are kept, besides those whose channel names its fields; the others are only
        counted.
    findings : Findings
        Receives what is damaged.
    schemas, channels : dict
        By their number in the file.
    counts : dict of int to int
        Messages of each channel.
    payloads : dict of int to Messages
        Messages of each wanted channel, in file order.
    logged : dict of int to array of int
        Log time [ns] of each of those.
    strangers : dict of int to list of bytes
        Messages, with their head, of channels that are not described so far.
    metadata : list of (str, mapping)
        Metadata records in file order.
    attachments : list of Attachment
        In file order, those with a wrong CRC left out.
    """

    wanted: Callable[[str], bool]
    findings: Findings
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    payloads: dict[int, Messages] = field(default_factory=dict)
    logged: dict[int, array[int]] = field(default_factory=dict)
    strangers: dict[int, list[bytes]] = field(default_factory=dict)
    metadata: list[tuple[str, Mapping[str, str]]] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)

    @property
    def messages(self) -> int:
        """Messages met so far, of whatever channel."""
        return sum(self.counts.values()) + sum(map(len, self.strangers.values()))

    def message(self, data: memoryview, start: int, stop: int) -> None:
        """Take the message that lies between two places of some bytes.

        Raises
        ------
        RecordError
            When it is too short for its own head.
        """
        if stop - start < MESSAGE.size:
            raise RecordError(f"a message has a head of {MESSAGE.size} bytes")
        identity = data[start] | data[start + 1] << 8
        if identity in self.channels:
            self.keep(identity, data, start, stop)
        else:
            self.strangers.setdefault(identity, []).append(data[start:stop].tobytes())

    def keep(self, identity: int, data: memoryview, start: int, stop: int) -> None:
        """Take a message of a channel that is described."""
        self.counts[identity] += 1
        kept = self.payloads.get(identity)
        if kept is not None:
            self.logged[identity].append(_LOG_TIME.unpack_from(data, start + LOG_TIME)[0])
            kept.append(data, start + MESSAGE.size, stop)

    def keep_many(self, identity: int, data: memoryview, spans: list[tuple[int, int]]) -> None:
        """Take messages of a channel that is described, each between two places of some bytes."""
        self.counts[identity] += len(spans)
        if identity in self.payloads:
            self.logged[identity].extend([_LOG_TIME.unpack_from(data, start + LOG_TIME)[0] for start, _ in spans])
            self.payloads[identity].append_many([data[start + MESSAGE.size : stop] for start, stop in spans])

    def keep_alike(self, identity: int, rows: npt.NDArray[np.uint8]) -> None:
        """Take messages of one length of a channel that is described, (n, length) with their heads."""
        self.counts[identity] += len(rows)
        if identity in self.payloads:
            self.logged[identity].frombytes(rows[:, LOG_TIME : LOG_TIME + _LOG_TIME.size].tobytes())
            self.payloads[identity].extend(rows[:, MESSAGE.size :])

    def describe(self, channel: ChannelRecord, at: int) -> None:
        """Take the description of a channel, and with it the messages that came before it.

        A later description that says the same is as good as the first; one that does not is a finding.
        """
        known = self.channels.setdefault(channel.id, channel)
        if channel is known:
            self.counts[channel.id] = 0
            if FIELDS_KEY in channel.metadata or self.wanted(channel.topic):
                self.payloads[channel.id], self.logged[channel.id] = Messages(), array("Q")
        if known != channel:
            self.findings.error(
                Code.CHANNEL_CONFLICT,
                f"record at byte {at}",
                f"it describes channel {channel.id} as {_channel_words(channel)}; "
                f"expected {_channel_words(known)}, as before",
                "The first description is used. Give each channel of the recorder its own number.",
            )
        for data in self.strangers.pop(channel.id, ()):
            self.keep(known.id, memoryview(data), 0, len(data))


def _channel_words(channel: ChannelRecord) -> str:
    return f"'{channel.topic}' of schema {channel.schema_id} with {dict(channel.metadata)}"
