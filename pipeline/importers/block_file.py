"""An MCAP file written block by block into a file next to its place, which takes that place when it is whole."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import timedelta
from importlib.metadata import version
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from mcap.writer import CompressionType, Writer

from pmg.pipeline.files.atomic import opened_aside
from pmg.pipeline.recording.channels import ENCODING, SHARED_CLOCK
from pmg.pipeline.recording.layouts.moments import SECOND_NS
from pmg.pipeline.recording.layouts.repack import BLOCK_SAMPLES
from pmg.pipeline.recording.layouts.schema import SAMPLE_BLOCK, descriptor_set, encode
from pmg.pipeline.recording.write import EPOCH

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from datetime import datetime
    from pathlib import Path

    import numpy.typing as npt


@dataclass
class BlockFile:
    """A recording that is being written.

    Parameters
    ----------
    writer : Writer
        The official writer.
    start_ns : int
        Time of sample 0 [ns since 1970, UTC].
    rate_hz : float
        Samples per second [1/s].
    written : dict of str to int
        Samples by topic.
    """

    writer: Any
    start_ns: int
    rate_hz: float
    written: dict[str, int] = field(default_factory=dict)
    _schema: int = 0
    _channels: dict[str, tuple[int, str]] = field(default_factory=dict)

    def add_topic(self, topic: str, metadata: Mapping[str, str]) -> None:
        """Announce a topic of sample blocks; its metadata hold ``dtype``."""
        if not self._schema:
            self._schema = self.writer.register_schema(SAMPLE_BLOCK.full_name, ENCODING, descriptor_set())
        identity = self.writer.register_channel(topic, ENCODING, self._schema, dict(metadata))
        self._channels[topic] = identity, metadata["dtype"]
        self.written[topic] = 0

    def add_json_topic(self, topic: str, name: str, schema: bytes, metadata: Mapping[str, str]) -> int:
        """Announce a topic of JSON messages; gives its number."""
        identity = self.writer.register_schema(name, "jsonschema", schema)
        return int(self.writer.register_channel(topic, "json", identity, dict(metadata)))

    def time_ns(self, sample: float) -> int:
        """Time of a sample [ns since 1970, UTC]."""
        return self.start_ns + round(sample / self.rate_hz * SECOND_NS)

    def write(self, columns: Mapping[str, tuple[npt.NDArray[np.int64], npt.NDArray[Any]]]) -> None:
        """Write samples at increasing indices; where these leap, a new block begins. Blocks go in order of time."""
        pieces = [
            (int(index[low]), topic, low, high) for topic, (index, _) in columns.items() for low, high in _pieces(index)
        ]
        for first, topic, low, high in sorted(pieces):
            identity, dtype = self._channels[topic]
            seconds, nanos = divmod(self.time_ns(first), SECOND_NS)
            head = {"timestamp": {"seconds": seconds, "nanos": nanos}, "first_sample": first, "clock_id": SHARED_CLOCK}
            message = encode(SAMPLE_BLOCK, head | {dtype: columns[topic][1][low:high]})
            taken = self.time_ns(first + high - low)
            self.writer.add_message(identity, taken, message, taken)
            self.written[topic] += high - low

    def write_json(self, identity: int, time_ns: int, message: bytes) -> None:
        """Write one JSON message."""
        self.writer.add_message(identity, time_ns, message, time_ns)


def _pieces(index: npt.NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """Rows of each written block: without a leap, and not too many."""
    if not len(index):
        return
    edges = [0, *(np.flatnonzero(np.diff(index) != 1) + 1).tolist(), len(index)]
    for low, high in pairwise(edges):
        for first in range(low, high, BLOCK_SAMPLES):
            yield first, min(first + BLOCK_SAMPLES, high)


@contextmanager
def block_file(path: Path, started_at: datetime, rate_hz: float) -> Iterator[BlockFile]:
    """A recording to be written; it stands at its place once the block has been left without an error.

    Parameters
    ----------
    path : Path
        Its place; the folder is made if absent, an older file replaced.
    started_at : datetime
        Time of sample 0, aware.
    rate_hz : float
        Samples per second [1/s].
    """
    with opened_aside(path) as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True)
        writer.start(profile="pmg", library=f"pmg {version('pmg-bench')}")
        yield BlockFile(writer, _nanoseconds(started_at), rate_hz)
        writer.finish()  # type: ignore[no-untyped-call]


def _nanoseconds(moment: datetime) -> int:
    """A time as nanoseconds since 1970, without loss [ns]."""
    return (moment - EPOCH) // timedelta(microseconds=1) * 1000
