"""Messages of a file by three readers: pmg's pass, the official Python reader, and the official stream reader."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, TypeAlias

from mcap.reader import NonSeekingReader, SeekingReader

from pmg.pipeline.recording.container.gathered import WholeRecords
from pmg.pipeline.recording.container.records import MESSAGE
from pmg.pipeline.recording.container.walk import walk_records
from pmg.pipeline.recording.findings import Finding, Findings, UnusableRecordingError
from pmg.pipeline.recording.read import read_recording

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    import numpy.typing as npt

Messages: TypeAlias = "Counter[tuple[str, bytes]]"
"""How often a file holds each message: topic, and head after the channel's number with payload."""


@dataclass
class Witness(WholeRecords):
    """Notes each message whole, besides."""

    whole: list[tuple[str, bytes]] = field(default_factory=list)

    def keep(self, identity: int, data: memoryview, start: int, stop: int) -> None:
        self.whole.append((self.channels[identity].topic, data[start:stop].tobytes()))
        super().keep(identity, data, start, stop)

    def keep_many(self, identity: int, data: memoryview, spans: list[tuple[int, int]]) -> None:
        self.whole.extend((self.channels[identity].topic, data[start:stop].tobytes()) for start, stop in spans)
        super().keep_many(identity, data, spans)

    def keep_alike(self, identity: int, rows: npt.NDArray[np.uint8]) -> None:
        self.whole.extend((self.channels[identity].topic, row.tobytes()) for row in rows)
        super().keep_alike(identity, rows)


def walked(data: bytes) -> Witness:
    """What pmg's pass gathers; refused files give what was met before."""
    witness = Witness(lambda topic: True, Findings("file"))
    with suppress(UnusableRecordingError):
        walk_records(BytesIO(data), len(data), witness)
    return witness


def kept_by_pmg(data: bytes) -> Messages:
    """Messages that pmg keeps."""
    return Counter((topic, message[2:]) for topic, message in walked(data).whole)


def kept_by_official(data: bytes, *, seeking: bool, checked: bool = True) -> Messages:
    """Messages that an official reader hands out before it ends or raises."""
    kept: Messages = Counter()
    try:
        reader = (SeekingReader if seeking else NonSeekingReader)(BytesIO(data), validate_crcs=checked)
        for _, channel, message in reader.iter_messages(log_time_order=seeking):
            head = MESSAGE.pack(0, message.sequence, message.log_time, message.publish_time)
            kept[channel.topic, head[2:] + message.data] += 1
    except Exception:
        # Whatever it raises, what came before is what a program that uses it has.
        return kept
    return kept


def told(data: bytes) -> tuple[Finding, ...]:
    """All findings that pmg gives on a file, decoding it as far as it goes."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "file.mcap"
        path.write_bytes(data)
        try:
            return read_recording(path).findings
        except UnusableRecordingError as error:
            return error.findings


def records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Place, operation code and end of each record of a whole file."""
    at = 8
    while at + 9 <= len(data) - 8:
        end = at + 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        yield at, data[at], end
        at = end
