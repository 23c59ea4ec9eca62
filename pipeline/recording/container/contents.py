"""The MCAP container: what a file holds, by topic."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pmg.pipeline.recording.container.gathered import WholeRecords
from pmg.pipeline.recording.container.messages import Messages
from pmg.pipeline.recording.container.source import ShrunkError
from pmg.pipeline.recording.container.walk import walk_records
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from pmg.pipeline.recording.container.records import ChannelRecord
    from pmg.pipeline.recording.findings import Findings


@dataclass(frozen=True)
class Topic:
    """Messages recorded under one topic.

    Parameters
    ----------
    name, encoding, schema : str
        Topic, message encoding, schema name.
    metadata : mapping of str to str
        Metadata of the channel.
    count : int
        Messages seen.
    payloads : Messages
        The messages in file order; empty for a topic that was not wanted.
    definition : (str, bytes)
        Encoding and text of the schema.
    logged : (n,) array of int
        Log time of each message that was kept [ns].
    file_size : int
        Length of the file that it was recorded in [bytes].
    """

    name: str
    encoding: str
    schema: str
    metadata: Mapping[str, str]
    count: int
    payloads: Messages
    definition: tuple[str, bytes] = ("", b"")
    logged: array[int] = field(default_factory=lambda: array("Q"))
    file_size: int = 0


@dataclass(frozen=True)
class Container:
    """Everything that a file holds.

    Parameters
    ----------
    sha256 : str
        Hash of the file; empty when it cannot be read.
    size : int
        Length [bytes].
    topics : mapping of str to Topic
        By name.
    metadata : tuple of (name, mapping)
        Metadata records in file order.
    attachments : tuple of (name, bytes)
        Attachments in file order, those with a wrong CRC left out.
    """

    sha256: str
    size: int
    topics: Mapping[str, Topic]
    metadata: tuple[tuple[str, Mapping[str, str]], ...]
    attachments: tuple[tuple[str, bytes], ...]


def open_container(path: Path, wanted: Callable[[str], bool], findings: Findings) -> Container:
    """Contents of a file; damage is reported and passed over.

    Parameters
    ----------
    path : Path
        The file.
    wanted : callable
        Whether the messages of a topic are kept. The others are only counted.
    findings : Findings
        Receives what is damaged.

    Raises
    ------
    UnusableRecordingError
        When the file cannot be read at all, shrinks while it is read, or is no MCAP file.
    """
    try:
        if path.exists() and not path.is_file():
            raise OSError(f"{'a folder' if path.is_dir() else 'a device, pipe or socket'}, not a regular file")
        with path.open("rb") as stream:
            size = stream.seek(0, 2)
            gathered = WholeRecords(wanted, findings)
            sha256 = walk_records(stream, size, gathered).digest()
            if (left := stream.seek(0, 2)) < size:
                raise ShrunkError(left, size)
    except ShrunkError as fault:
        findings.error(
            Code.UNREADABLE,
            f"byte {fault.end}",
            f"the file came to end here while it was read; expected {fault.size} bytes, as when it was opened",
            "Something writes or shortens it. Wait until that is done, then read the file again.",
            lost="the file",
        )
        raise findings.give_up() from fault
    except OSError as fault:
        reason = fault.strerror or str(fault)
        findings.error(
            Code.UNREADABLE,
            "file",
            f"the system says '{reason}'; expected a readable file",
            "Check the path, the permissions and the disk.",
        )
        raise findings.give_up() from fault
    attachments = tuple((attachment.name, attachment.data) for attachment in gathered.attachments)
    return Container(sha256, size, _topics(gathered, size), tuple(gathered.metadata), attachments)


def _topics(gathered: WholeRecords, size: int) -> dict[str, Topic]:
    """Channels by topic; one topic on channels that contradict each other is a finding."""
    for identity, strangers in sorted(gathered.strangers.items()):
        gathered.findings.error(
            Code.RECORD_LOST,
            f"channel {identity}",
            f"{len(strangers)} messages name a channel that the file does not describe; expected its record first",
            "They cannot be read. The record may have been in a damaged chunk: copy the file again.",
            lost=f"{len(strangers)} messages",
        )
    first: dict[str, ChannelRecord] = {}
    joined: dict[str, list[int]] = {}
    for identity, channel in sorted(gathered.channels.items()):
        known = first.setdefault(channel.topic, channel)
        if _description(gathered, known) == _description(gathered, channel):
            joined.setdefault(channel.topic, []).append(identity)
            continue
        gathered.findings.error(
            Code.CHANNEL_CONFLICT,
            channel.topic,
            f"a second channel {identity} describes it otherwise ({dict(channel.metadata)}); "
            f"expected {dict(known.metadata)}. Its {gathered.counts[identity]} messages are left out",
            "Give each channel of the recorder its own topic.",
        )
    return {topic: _topic(gathered, first[topic], identities, size) for topic, identities in joined.items()}


def _description(gathered: WholeRecords, channel: ChannelRecord) -> tuple[str, str, dict[str, str]]:
    """Encoding, name of the schema and metadata."""
    schema = gathered.schemas.get(channel.schema_id)
    return channel.message_encoding, "" if schema is None else schema.name, dict(channel.metadata)


def _topic(gathered: WholeRecords, channel: ChannelRecord, identities: list[int], size: int) -> Topic:
    """Messages of the channels of one topic, one channel after another."""
    schema = gathered.schemas.get(channel.schema_id)
    payloads = gathered.payloads.pop(identities[0], Messages())
    for identity in identities[1:]:
        payloads.join(gathered.payloads.pop(identity, Messages()))
    times = sum((gathered.logged.pop(identity, array("Q")) for identity in identities), array("Q"))
    return Topic(
        channel.topic,
        *_description(gathered, channel),
        sum(gathered.counts[identity] for identity in identities),
        payloads,
        ("", b"") if schema is None else (schema.encoding, schema.data),
        times,
        size,
    )
