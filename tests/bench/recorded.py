"""Large recordings of layout pmg.v1, written column by column in blocks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from mcap.writer import CompressionType, Writer

from tests.recording.writer import block

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path


@dataclass(frozen=True)
class Column:
    """All samples of one channel.

    Parameters
    ----------
    topic, dtype : str
        Where it goes, and the type of a sample there.
    values : (n,) array
        The samples.
    metadata : mapping
        Of the channel, besides what every channel has.
    """

    topic: str
    dtype: str
    values: np.ndarray[Any, np.dtype[Any]]
    metadata: Mapping[str, str] = field(default_factory=dict)


def record(
    path: Path, columns: Iterable[Column], run: Mapping[str, str], calibration: bytes, rate_hz: float, length: int
) -> None:
    """A recording with zstd and all CRCs, as a recorder writes it.

    Parameters
    ----------
    path : Path
        The file to write.
    columns : iterable of Column
        Channels of one length.
    run : mapping
        The record ``pmg.run``.
    calibration : bytes
        The attachment.
    rate_hz : float
        Sample rate [Hz].
    length : int
        Samples a block.
    """
    held = list(columns)
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True)
        writer.start()
        writer.add_metadata("pmg.run", dict(run))
        writer.add_attachment(0, 0, "calibration.toml", "application/toml", calibration)
        schema = writer.register_schema("pmg.v1.SampleBlock", "protobuf", b"")
        channels = []
        for column in held:
            metadata = {"dtype": column.dtype, "rate_hz": f"{rate_hz:g}", "clock_id": "0", **column.metadata}
            channels.append(writer.register_channel(column.topic, "protobuf", schema, metadata))
        for first in range(0, len(held[0].values), length):
            now = int(first / rate_hz * 1e9)
            for channel, column in zip(channels, held, strict=True):
                message = block(first, column.dtype, column.values[first : first + length])
                writer.add_message(channel, now, message, now)
        writer.finish()  # type: ignore[no-untyped-call]


def counted(side: str, speed: float, rows: int, rate_hz: float, counts_per_rev: int) -> Column:
    """The encoder of a shaft that turns evenly [rad/s]."""
    turns = np.arange(rows) / rate_hz * (speed / (2.0 * np.pi))
    count = np.floor(turns * counts_per_rev).astype(np.int64) % (1 << 32)
    metadata = {"quantity": "count", "unit": "1", "counts_per_rev": str(counts_per_rev), "bits": "32"}
    return Column(f"/daq/encoder_{side}/count", "u32", count.astype(np.uint32), metadata)
