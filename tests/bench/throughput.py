"""`./pmgw bench throughput`: samples a second, read by pmg, by the official reader, and as zstd alone would allow.

A second table sets the whole `pmg ingest` beside them, and pyarrow reading what it wrote (`tests/bench/peers.txt`). A
sample is one value of one channel. A layout is a function in `LAYOUTS` that says what a recorder writes; one more line
there is one more row of the table.
Every contestant reads each file in a process of its own, so that peak memory is its own too.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import re
import resource
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import zstandard
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from pmg.pipeline.recording.blocks import read_blocks
from pmg.pipeline.recording.channels import SPECS, check_channel
from pmg.pipeline.recording.container.contents import open_container
from pmg.pipeline.recording.findings import Findings
from pmg.pipeline.recording.layouts.convert_topics import convert_topics
from pmg.pipeline.recording.layouts.wire import _double, fields, sample_block
from pmg.pipeline.recording.read import read_recording
from tests.bench.ingests import whole
from tests.bench.recorded import Column, counted, record
from tests.recording.foreign import single
from tests.recording.writer import CALIBRATION, COUNTS_PER_REV, FIELDS, NULL_HZ, RUN, TIMEBASE_HZ

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from pmg.pipeline.recording.container.contents import Topic

RATE_HZ = 10_000.0
SEED = 20260502
LAST_DOUBLE = struct.Struct("<d")
REPEATS, LEAST_S, MOST_S = 5, 1.0, 8.0
"""Readings of each file in one process, for how long they go on at least, and after which none is begun [s]; the least
time counts, but the memory of the first."""
TIMES = ("processor", "wall")
"""Times that are reported. pmg hashes the file on a second thread: that costs processor time and no wall time, as long
as a second processor is free. The others run on one thread, so their two times are the same."""


def _angles(rows: int) -> Iterator[Column]:
    for side, speed in (("sun", 63.0), ("ring", -24.0)):
        yield counted(side, speed, rows, RATE_HZ, COUNTS_PER_REV)


def _frequency(rows: int, side: str, rng: np.random.Generator) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Output of a transducer with noise and ripple [Hz]."""
    ripple = 50.0 * np.sin(2.0 * np.pi * 90.0 * np.arange(rows) / RATE_HZ)
    return np.asarray(NULL_HZ[side] + 800.0 + ripple + 5.0 * rng.standard_normal(rows), dtype=np.float64)


def frequencies(dtype: str, decimals: int = 2) -> Callable[[int, np.random.Generator], Iterator[Column]]:
    """Torque as the frequency of each sample, in steps as a counter gives it; more decimals compress less."""

    def columns(samples: int, rng: np.random.Generator) -> Iterator[Column]:
        rows = samples // 4
        for side in ("sun", "ring"):
            metadata = {"quantity": "frequency", "unit": "Hz"}
            values = np.round(_frequency(rows, side, rng), decimals).astype(FIELDS[dtype][1])
            yield Column(f"/daq/torque_{side}/frequency", dtype, values, metadata)
        yield from _angles(rows)

    return columns


def edges(samples: int, rng: np.random.Generator) -> Iterator[Column]:
    """Torque as counted edges and the time of the last of them."""
    rows = samples // 6
    for side in ("sun", "ring"):
        phase = np.cumsum(_frequency(rows, side, rng)) / RATE_HZ
        count = np.floor(phase)
        period = 1.0 / (np.gradient(phase) * RATE_HZ)
        last = np.arange(rows) / RATE_HZ - (phase - count) * period
        ticks = np.round((last + 1.0) * TIMEBASE_HZ).astype(np.int64) % (1 << 32)
        plain = {"unit": "1", "bits": "32"}
        counting, ticking = {"quantity": "count"}, {"quantity": "tick", "timebase_hz": str(TIMEBASE_HZ)}
        yield Column(f"/daq/torque_{side}/edges", "u32", count.astype(np.uint32), plain | counting)
        yield Column(f"/daq/torque_{side}/edge_ticks", "u32", ticks.astype(np.uint32), plain | ticking)
    yield from _angles(rows)


LAYOUTS: Mapping[str, Callable[[int, np.random.Generator], Iterator[Column]]] = {
    "frequency f64": frequencies("f64"),
    "f64, all bits noisy": frequencies("f64", decimals=16),
    "frequency f32": frequencies("f32"),
    "edges and ticks": edges,
}


def single_samples(path: Path, encoding: str, samples: int) -> None:
    """A recording of the first layout with one sample a message, the channels in turn."""
    columns = list(frequencies("f64")(samples, np.random.default_rng(SEED)))
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True)
        writer.start()
        writer.add_metadata("pmg.run", dict(RUN))
        writer.add_attachment(0, 0, "calibration.toml", "application/toml", CALIBRATION.encode())
        held = []
        for column in columns:
            metadata = {"dtype": column.dtype, "rate_hz": f"{RATE_HZ:g}", "clock_id": "0", **column.metadata}
            other = single(column.values, 0, RATE_HZ, encoding, metadata)
            schema = writer.register_schema(*other.schema)
            channel = writer.register_channel(column.topic, other.encoding, schema, dict(other.metadata))
            held.append((channel, other.messages))
        for place in range(len(held[0][1])):
            now = int(place / RATE_HZ * 1e9)
            for channel, messages in held:
                writer.add_message(channel, now, messages[place], now)
        writer.finish()  # type: ignore[no-untyped-call]


SINGLE = ("block", "scalar", "cdr", "json")
"""Encodings of one sample a message; a twentieth of the samples is written, so that the table is done in a minute."""
SINGLE_PART = 20


DECODED: Mapping[str, Callable[[bytes], Any]] = {
    "pmg.v1.SampleBlock": lambda data: sample_block(data).values,
    "pmg.v1.Scalar": lambda data: [_double(*each) for each in fields(data) if each[0] == 3],
    "bench_msgs/msg/Reading": lambda data: [LAST_DOUBLE.unpack_from(data, len(data) - LAST_DOUBLE.size)[0]],
    "bench.Reading": lambda data: [json.loads(data)["value"]],
}
"""What the official reader hands out made into numbers, by the name of the schema."""


def by_zstd(path: Path) -> Callable[[], int]:
    """Nothing but the expansion of the chunks; gives their bytes."""
    with path.open("rb") as stream:
        chunks = [record for record in StreamReader(stream, emit_chunks=True).records if isinstance(record, Chunk)]
    expand = zstandard.ZstdDecompressor().decompress
    return lambda: sum(len(expand(chunk.data, max_output_size=chunk.uncompressed_size)) for chunk in chunks)


def by_official(path: Path) -> Callable[[], int]:
    """The official reader with its CRCs on, each block a numpy array by pmg's own decoder; gives the bytes of those."""

    def read() -> int:
        with path.open("rb") as stream:
            found: dict[str, list[Any]] = {}
            for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
                assert schema is not None
                found.setdefault(channel.topic, []).append(DECODED[schema.name](message.data))
        return sum(np.concatenate(blocks).nbytes for blocks in found.values())

    return read


def by_blocks(path: Path) -> Callable[[], int]:
    """The same work by pmg: chunks and CRCs, the hash of the file, blocks to numpy arrays; gives their bytes."""

    def read() -> int:
        findings = Findings(path.name)
        topics = convert_topics(open_container(path, lambda topic: True, findings).topics, findings)
        return sum(_values(topic, findings).nbytes for topic in topics.values() if topic.name in SPECS)

    return read


def _values(topic: Topic, findings: Findings) -> np.ndarray[Any, np.dtype[Any]]:
    """All samples of a channel."""
    terms = check_channel(topic, SPECS[topic.name], findings)
    assert terms is not None
    return read_blocks(topic, terms, findings).values


def by_pmg(path: Path) -> Callable[[], int]:
    """The file as torque and angle with every finding; gives the bytes of the samples."""

    def read() -> int:
        recording = read_recording(path)
        severe = [finding for finding in recording.findings if finding.severity != "info"]
        assert not severe, severe
        return int(recording.samples.estimated_size())

    return read


def by_pyarrow(path: Path) -> Callable[[], int]:
    """A Parquet file that an ingest wrote; gives the bytes of its table."""
    read = importlib.import_module("pyarrow.parquet").read_table
    return lambda: int(read(path).nbytes)


CONTESTANTS = {"zstd": by_zstd, "official": by_official, "blocks": by_blocks, "pmg": by_pmg}


def contest(name: str, path: Path) -> dict[str, float]:
    """Least times [s], peak memory beyond that before the first reading [bytes], and bytes of the result."""
    read = (CONTESTANTS | {"pyarrow": by_pyarrow})[name](path)
    # The peak of the process so far may lie above what it holds now; a reading smaller than that would not show.
    before = _peak()
    processor: list[float] = []
    wall: list[float] = []
    held, peak, begun = 0, 0, time.perf_counter()
    while (spent := time.perf_counter() - begun) < LEAST_S or (len(wall) < REPEATS and spent < MOST_S):
        start, at = time.process_time(), time.perf_counter()
        held = read()
        processor.append(time.process_time() - start)
        wall.append(time.perf_counter() - at)
        peak = peak or _peak()
    return {"processor": min(processor), "wall": min(wall), "memory": peak - before, "result": held}


def _peak() -> int:
    """Most memory that this process has held [bytes].

    What `getrusage` tells on Linux begins with the memory of the process that started this one; the system's own
    status, which is of this program alone, goes first.
    """
    status = Path("/proc/self/status")
    if status.exists():
        found = re.search(r"VmHWM:\s+(\d+) kB", status.read_text())
        if found:
            return int(found[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def apart(name: str, path: Path) -> dict[str, float]:
    """A contest in a process of its own."""
    words = [sys.executable, "-m", "tests.bench.throughput", "--contest", name, str(path)]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=dict(os.environ))
    found: dict[str, float] = json.loads(done.stdout)
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="pmgw bench throughput", description=__doc__)
    parser.add_argument("--samples", type=int, default=6_000_000, help="on all channels together")
    parser.add_argument("--block", type=int, default=1000, help="samples a message")
    parser.add_argument("--contest", nargs=2, metavar=("NAME", "FILE"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    out = sys.stdout.write
    if given.contest:
        out(json.dumps(contest(given.contest[0], Path(given.contest[1]))))
        return
    few = given.samples // SINGLE_PART
    out(f"{given.samples} samples in blocks of {given.block}, and {few} one a message; CRCs on. ")
    out(f"The least of some {REPEATS} times, in 1e6 samples/s.\n")
    out("Blocks are what the official reader gives too, each as an array; pmg is torque and angle, all checked.\n")
    out("pmg hashes on a second thread, the others have one: 'processor' counts both, 'wall' what one waits.\n\n")
    heads = ("time", *CONTESTANTS, "blocks/zstd", "blocks/off.", "pmg/zstd")
    sizes = ("file [MB]", "result [MB]", "peak [MB]", "peak/result")
    out(f"{'layout':22}" + "".join(f"{head:>12}" for head in (*heads, *sizes)) + "\n")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.mcap")
        for layout, columns_of in LAYOUTS.items():
            made = columns_of(given.samples, np.random.default_rng(SEED))
            record(path, made, RUN, CALIBRATION.encode(), RATE_HZ, given.block)
            out(row(layout, path, given.samples) + "\n")
        for encoding in SINGLE:
            single_samples(path, encoding, few)
            out(row(f"one a message, {encoding}", path, few) + "\n")
        columns = LAYOUTS["frequency f64"](given.samples, np.random.default_rng(SEED))
        one = Path(folder, "one")
        one.mkdir()
        record(one / "a.mcap", columns, RUN, CALIBRATION.encode(), RATE_HZ, given.block)
        whole(one, given.samples, tuple(CONTESTANTS), apart)


def row(layout: str, path: Path, samples: int) -> str:
    """Two lines of the table, by processor time and by wall time."""
    found = {name: apart(name, path) for name in CONTESTANTS}
    result, memory = found["pmg"]["result"], found["pmg"]["memory"]
    sizes = [path.stat().st_size / 1e6, result / 1e6, memory / 1e6, memory / result]
    lines = []
    for kind in TIMES:
        rates = {name: samples / one[kind] for name, one in found.items()}
        cells = [rate / 1e6 for rate in rates.values()]
        cells += [rates["blocks"] / rates["zstd"], rates["blocks"] / rates["official"], rates["pmg"] / rates["zstd"]]
        cells += sizes if kind == TIMES[0] else []
        lines.append(
            f"{layout if kind == TIMES[0] else '':22}{kind:>12}" + "".join(f"{value:12.2f}" for value in cells)
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
