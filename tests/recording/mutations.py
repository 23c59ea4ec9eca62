"""Mutations of a recording, byte by byte, and what becomes of its messages."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from mcap.writer import CompressionType

from .damages import CHUNK, of_kind, rewritten
from .readers import Messages, walked

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

ENGAGED = Path(__file__).resolve().parent.parent / "data" / "engaged.mcap"
KINDS = ("flip", "cut", "insert", "duplicate")
LONGEST = 400
"""Most bytes that a mutation removes, inserts or repeats, unless it repeats a whole chunk."""


class Outcome(StrEnum):
    """What becomes of a mutated file; the last three must never happen."""

    ALTERED = "all messages; other words changed where the file has no CRC"
    UNTOUCHED = "all messages, nothing to report"
    WHOLE = "all messages, and a finding"
    PART = "a part of them, and a finding"
    REFUSED = "refused with a finding"
    DOUBTED = "messages that were not recorded, and a finding"
    SILENT = "messages lost without a finding"
    FALSE = "messages that were not recorded, without a finding"
    CRASHED = "an exception"


FAULTS = (Outcome.SILENT, Outcome.FALSE, Outcome.CRASHED)


@dataclass(frozen=True)
class Held:
    """What a file holds: messages, other words (metadata, attachments, channels, schemas), and whether all is well."""

    messages: Messages
    words: str
    found: bool
    nothing: bool


@dataclass(frozen=True)
class Specimen:
    """A file to mutate: name, bytes, what it holds, and place and end of its chunks."""

    name: str
    data: bytes
    truth: Held
    chunks: Sequence[tuple[int, int]]


def specimens() -> tuple[Specimen, ...]:
    """A recording of the test data as it is, in many chunks, in chunks without compression, and without chunks."""
    data = ENGAGED.read_bytes()
    files = {
        "as recorded, one chunk": data,
        "chunks of 4 kB, zstd": rewritten(data, chunk_size=4096),
        "chunks of 4 kB, lz4": rewritten(data, CompressionType.LZ4, chunk_size=4096),
        "chunks of 4 kB, not compressed": rewritten(data, CompressionType.NONE, chunk_size=4096),
        "chunks of 4 kB, CRC over all data": rewritten(data, chunk_size=4096, data_crc=True),
        "without chunks": rewritten(data, CompressionType.NONE, chunked=False),
    }
    return tuple(Specimen(name, made, held(made), of_kind(made, CHUNK)) for name, made in files.items())


def held(data: bytes) -> Held:
    """What pmg's pass keeps of a file."""
    witness = walked(data)
    kept = Counter((topic, message[2:]) for topic, message in witness.whole)
    words = repr((witness.metadata, witness.attachments, witness.channels, witness.schemas))
    nothing = not (witness.whole or witness.channels or witness.metadata)
    return Held(kept, words, bool(witness.findings.gathered), nothing)


def mutate(kind: str, specimen: Specimen, rng: np.random.Generator) -> bytes:
    """The file with one mutation of a kind."""
    data = specimen.data
    at = int(rng.integers(len(data)))
    length = int(rng.integers(1, LONGEST))
    if kind == "flip":
        return data[:at] + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :]
    if kind == "cut":
        return data[:at] + (data[at + length :] if rng.random() < 0.5 else b"")
    if kind == "insert":
        return data[:at] + rng.bytes(length) + data[at:]
    if specimen.chunks and rng.random() < 0.5:
        first, end = specimen.chunks[int(rng.integers(len(specimen.chunks)))]
        places = [place for place, _ in specimen.chunks]
        at = places[int(rng.integers(len(places)))]
        return data[:at] + data[first:end] + data[at:]
    return data[: at + length] + data[at:]


def outcome(mutated: bytes, truth: Held) -> Outcome:
    """What becomes of a mutated file."""
    try:
        now = held(mutated)
    except Exception:
        return Outcome.CRASHED
    if not now.messages <= truth.messages:
        return Outcome.DOUBTED if now.found else Outcome.FALSE
    if now.messages != truth.messages:
        return (Outcome.REFUSED if now.nothing else Outcome.PART) if now.found else Outcome.SILENT
    if now.found:
        return Outcome.WHOLE
    return Outcome.UNTOUCHED if now.words == truth.words else Outcome.ALTERED
