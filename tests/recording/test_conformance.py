"""Every variant of the conformance suite of MCAP, made anew byte for byte, is read as it is described."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from io import BytesIO
from typing import TYPE_CHECKING, Any

import pytest

from pmg.pipeline.recording.container.gathered import WholeRecords
from pmg.pipeline.recording.container.records import MESSAGE
from pmg.pipeline.recording.container.walk import walk_records
from pmg.pipeline.recording.findings import Code, Findings

from .conformance import Variant, build, octets, variants

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

VARIANTS = variants()


@dataclass
class Witness(WholeRecords):
    """Notes each message whole, besides."""

    whole: list[bytes] = field(default_factory=list)

    def keep(self, identity: int, data: memoryview, start: int, stop: int) -> None:
        self.whole.append(data[start:stop].tobytes())
        super().keep(identity, data, start, stop)

    def keep_many(self, identity: int, data: memoryview, spans: list[tuple[int, int]]) -> None:
        self.whole.extend(data[start:stop].tobytes() for start, stop in spans)
        super().keep_many(identity, data, spans)

    def keep_alike(self, identity: int, rows: npt.NDArray[np.uint8]) -> None:
        self.whole.extend(row.tobytes() for row in rows)
        super().keep_alike(identity, rows)


def read(data: bytes) -> Witness:
    witness = Witness(lambda topic: True, Findings("variant"))
    walk_records(BytesIO(data), len(data), witness)
    return witness


def described(variant: Variant, kind: str, numbers: tuple[str, ...]) -> list[dict[str, Any]]:
    """Records of a kind with their numbers as numbers and their bytes as bytes, each once."""
    found: list[dict[str, Any]] = []
    for fields in variant.of(kind):
        shaped = {
            name: int(value) if name in numbers else octets(value) if name == "data" else value
            for name, value in fields.items()
        }
        if shaped not in found:
            found.append(shaped)
    return found


def test_the_suite_has_all_its_variants() -> None:
    assert len({variant.name for variant in VARIANTS}) == 416


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.name)
def test_a_variant_is_made_byte_for_byte_and_read_as_described(variant: Variant) -> None:
    data = build(variant)
    assert hashlib.sha256(data).hexdigest() == variant.sha256
    found = read(data)
    numbers = ("id", "schema_id", "channel_id", "sequence", "log_time", "publish_time", "create_time")
    messages = []
    for whole in found.whole:
        channel_id, sequence, log_time, publish_time = MESSAGE.unpack_from(whole)
        known = {"channel_id": channel_id, "sequence": sequence, "log_time": log_time, "publish_time": publish_time}
        messages.append(known | {"data": whole[MESSAGE.size :]})
    assert messages == described(variant, "Message", numbers)
    assert [payload for payloads in found.payloads.values() for payload in payloads] == [m["data"] for m in messages]
    assert [vars(schema) for schema in found.schemas.values()] == described(variant, "Schema", numbers)
    assert [vars(channel) for channel in found.channels.values()] == described(variant, "Channel", numbers)
    attachments = [{name: value for name, value in vars(a).items() if name != "crc"} for a in found.attachments]
    assert attachments == described(variant, "Attachment", numbers)
    assert [{"name": name, "metadata": texts} for name, texts in found.metadata] == variant.of("Metadata")
    assert not found.findings.gathered


@pytest.mark.parametrize("name", ["TenMessages-ch-chx-mx-pad-rch-rsh-st-sum", "TenMessages-pad-rch-rsh-st-sum"])
def test_a_changed_bit_is_never_silent_and_changes_no_message_of_a_chunk(name: str) -> None:
    variant = next(entry for entry in VARIANTS if entry.name == name)
    data = build(variant)
    whole = read(data).whole
    for place in range(len(data)):
        changed = bytearray(data)
        changed[place] ^= 1 << place % 8
        found = read(bytes(changed))
        assert found.findings.gathered, f"byte {place}"
        if "ch" in variant.features:
            assert set(found.whole) <= set(whole), f"byte {place}"


def test_a_wrong_crc_of_the_summary_is_told_and_costs_no_data() -> None:
    variant = next(entry for entry in VARIANTS if entry.name == "TenMessages-ch-chx-mx-pad-rch-rsh-st-sum")
    data = bytearray(build(variant))
    data[-9] ^= 0xFF
    found = read(bytes(data))
    assert len(found.whole) == 10
    assert [finding.code for finding in found.findings.gathered] == [Code.CRC]
