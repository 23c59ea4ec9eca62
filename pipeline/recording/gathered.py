"""What a pass over the records of a file has gathered, by channel."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.records import MESSAGE, Attachment, Channel, RecordError, Schema

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pmg.pipeline.recording.findings import Findings


@dataclass
class Gathered:
    """Whole records of a file.

    Parameters
    ----------
    wanted : callable
        Whether the messages of a topic are kept; the others are only counted.
    findings : Findings
        Receives what is damaged.
    schemas, channels : dict
        By their number in the file.
    counts : dict of int to int
        Messages of each channel.
    payloads : dict of int to list of bytes
        Messages of each wanted channel, in file order.
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
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    payloads: dict[int, list[bytes]] = field(default_factory=dict)
    strangers: dict[int, list[bytes]] = field(default_factory=dict)
    metadata: list[tuple[str, Mapping[str, str]]] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)

    @property
    def messages(self) -> int:
        """Messages met so far, of whatever channel."""
        return sum(self.counts.values()) + sum(map(len, self.strangers.values()))

    def message(self, data: bytes, start: int, stop: int) -> None:
        """Take the message that lies between two places of some bytes.

        Raises
        ------
        RecordError
            When it is too short for its own head.
        """
        if stop - start < MESSAGE.size:
            raise RecordError(f"a message has a head of {MESSAGE.size} bytes")
        identity = data[start] | data[start + 1] << 8
        channel = self.channels.get(identity)
        if channel is None:
            self.strangers.setdefault(identity, []).append(data[start:stop])
        else:
            self.keep(channel, data, start, stop)

    def keep(self, channel: Channel, data: bytes, start: int, stop: int) -> None:
        """Take a message of a channel that is described."""
        self.counts[channel.id] += 1
        if self.wanted(channel.topic):
            self.payloads.setdefault(channel.id, []).append(data[start + MESSAGE.size : stop])

    def describe(self, channel: Channel, at: int) -> None:
        """Take the description of a channel, and with it the messages that came before it.

        A later description that says the same is as good as the first; one that does not is a finding.
        """
        known = self.channels.setdefault(channel.id, channel)
        self.counts.setdefault(channel.id, 0)
        if known != channel:
            self.findings.error(
                Code.CHANNEL_CONFLICT,
                f"record at byte {at}",
                f"it describes channel {channel.id} as {_told(channel)}; expected {_told(known)}, as before",
                "The first description is used. Give each channel of the recorder its own number.",
            )
        for data in self.strangers.pop(channel.id, ()):
            self.keep(known, data, 0, len(data))


def _told(channel: Channel) -> str:
    return f"'{channel.topic}' of schema {channel.schema_id} with {dict(channel.metadata)}"
