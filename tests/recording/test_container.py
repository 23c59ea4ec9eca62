"""What a file holds by topic: channels that share one, and files that change under the reader."""

from __future__ import annotations

import os
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.container.contents import Container, open_container
from pmg.pipeline.recording.container.source import BLOCK, SMALL, ByteSource, ShrunkError
from pmg.pipeline.recording.container.walk import walk_records
from pmg.pipeline.recording.findings import Findings, UnusableRecordingError

from .damages import base, plain, raw
from .readers import Witness

CHANNELS = st.lists(st.tuples(st.sampled_from("abc"), st.sampled_from(("Hz", "1")), st.integers(0, 4)), max_size=12)
"""Topic, unit and number of messages of each channel of a file, in the order of their numbers."""


class Shrinking(BytesIO):
    """A file of which only a part is left after some reads."""

    def __init__(self, data: bytes, left: int, reads: int) -> None:
        super().__init__(data)
        self.left, self.reads = left, reads

    def read(self, size: int | None = -1, /) -> bytes:
        self.reads -= 1
        if self.reads < 0:
            place = self.tell()
            self.truncate(min(self.left, len(self.getbuffer())))
            self.seek(place)
        return super().read(size)


def walk(stream: BytesIO, size: int) -> Witness:
    witness = Witness(lambda topic: True, Findings("file"))
    walk_records(stream, size, witness)
    return witness


def written(path: Path, channels: list[tuple[str, str, int]]) -> Path:
    """A file of channels; each message names its channel and its place in it."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("s", "protobuf", b"")
        for number, (topic, unit, count) in enumerate(channels):
            channel = writer.register_channel(topic, "protobuf", schema, {"unit": unit})
            for place in range(count):
                writer.add_message(channel, log_time=place, publish_time=place, data=bytes([number, place]))
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def opened(path: Path, wanted: Callable[[str], bool] = lambda topic: True) -> tuple[Container, Findings]:
    findings = Findings(path.name)
    return open_container(path, wanted, findings), findings


@given(CHANNELS)
def test_channels_of_one_topic_are_joined_in_the_order_of_their_numbers(
    tmp_path_factory: pytest.TempPathFactory, channels: list[tuple[str, str, int]]
) -> None:
    container, findings = opened(written(tmp_path_factory.mktemp("file") / "a.mcap", channels))
    first = {topic: unit for topic, unit, _ in reversed(channels)}
    assert list(container.topics) == list(dict.fromkeys(topic for topic, _, _ in channels))
    for name, topic in container.topics.items():
        assert topic.metadata == {"unit": first[name]}
        assert list(topic.payloads) == [
            bytes([number, place])
            for number, (at, unit, count) in enumerate(channels)
            if (at, unit) == (name, first[name])
            for place in range(count)
        ]
        assert topic.count == len(topic.payloads)
    strange = [(topic, count) for topic, unit, count in channels if unit != first[topic]]
    assert {finding.code for finding in findings.listed()} <= {Code.CHANNEL_CONFLICT}
    assert [finding.where for finding in findings.listed()] == [topic for topic, _ in strange]
    for finding, (_, count) in zip(findings.listed(), strange, strict=True):
        assert f"Its {count} messages are left out" in finding.message


@given(st.sampled_from((base, raw, plain)), st.floats(0, 1), st.integers(0, 3))
def test_a_file_that_shrinks_while_it_is_read_is_told_or_was_read_whole(
    make: Callable[[], bytes], part: float, reads: int
) -> None:
    data = make()
    left = round(part * len(data))
    told = None
    try:
        found = walk(Shrinking(data, left, reads), len(data))
    except ShrunkError as fault:
        told = fault.end, fault.size
    if told is None:
        whole = walk(BytesIO(data), len(data))
        assert (found.whole, found.findings.listed()) == (whole.whole, whole.findings.listed())
    else:
        assert told == (left, len(data))


@pytest.mark.parametrize("length", [1, SMALL, SMALL + 1, BLOCK])
def test_a_stretch_that_is_gone_is_never_given_shorter(length: int) -> None:
    data = bytes(2 * BLOCK)
    source = ByteSource(Shrinking(data, BLOCK, 1), len(data))
    assert source.read(0, 9) == bytes(9)
    with pytest.raises(ShrunkError):
        source.read(2 * BLOCK - length, 2 * BLOCK)
    assert source.read(BLOCK - length, BLOCK) == bytes(length)


@pytest.mark.parametrize("make", [base, raw, plain])
@pytest.mark.parametrize("part", [0.0, 0.3, 0.999])
def test_a_recording_that_shrinks_under_the_reader_is_refused_with_a_finding(
    tmp_path: Path, make: Callable[[], bytes], part: float
) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(make())
    size = path.stat().st_size
    left = int(part * size)

    def wanted(topic: str) -> bool:
        os.truncate(path, left)
        return bool(topic)

    with pytest.raises(UnusableRecordingError) as caught:
        opened(path, wanted)
    last = caught.value.findings[-1]
    assert (last.code, last.where) == (Code.UNREADABLE, f"byte {left}")
    assert f"expected {size} bytes" in last.message
    assert caught.value.do == last.do != ""
