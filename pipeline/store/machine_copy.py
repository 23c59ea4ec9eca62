"""The machine that a store was made with: a copy of its file, whose hash the mark of the store holds."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.json_values import read_json
from pmg.pipeline.store.manifest import SCHEMA
from pmg.pipeline.store.store import MARK, SOURCES
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.store.store import Store

COPY_OF_MACHINE = "machine.toml"
"""The copy in the store."""

PROOF_OF_MACHINE = "machine_sha256"
"""Key of its hash in the mark."""


def keep_machine(store: Store, text: str) -> None:
    """Keep the text of a machine file in a store: the copy first, then its hash, so that a kill leaves it without."""
    store.prepare()
    data = text.encode()
    write_atomic(store.path / COPY_OF_MACHINE, data)
    mark = {"schema": SCHEMA, PROOF_OF_MACHINE: hashlib.sha256(data).hexdigest()}
    write_atomic(store.path / MARK, (json.dumps(mark, indent=1) + "\n").encode())


def kept_machine(store: Path) -> Path | None:
    """The copy of the machine file that a store was made with; None of a store of the thesis bench.

    Raises
    ------
    StoreError
        The copy is gone, or was changed.
    """
    try:
        mark = read_json(store / MARK)
    except (OSError, ValueError):
        return None
    proof = mark.get(PROOF_OF_MACHINE) if isinstance(mark, dict) else None
    if proof is None:
        return None
    path = store / COPY_OF_MACHINE
    came = "gone" if not path.is_file() else hashlib.sha256(path.read_bytes()).hexdigest()
    if came != proof:
        came = came if came == "gone" else f"bytes with the hash {came[:12]}"
        do = "Put the file back as it was, or ingest into another store."
        raise StoreError(str(path), came, f"{str(proof)[:12]}, the machine that the store was made with", do)
    return path


def holds_sources(store: Path) -> bool:
    """Whether anything was ingested into a store."""
    return any((store / SOURCES).glob("*.json"))
