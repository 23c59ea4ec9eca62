"""JSON as files hold it, with a proof of its bytes, and numbers that are not known."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


PROOF = "proof"
"""Key of the hash that a document holds of its own file."""
_BLANK = "0" * 64


class ChangedError(ValueError):
    """A file whose bytes are not those that were written."""


def proven_json(document: Mapping[str, Any]) -> bytes:
    """A document as its file holds it, with the SHA-256 of these bytes; where that stands, the hashed bytes hold 0."""
    blank = (json.dumps({**document, PROOF: _BLANK}, indent=1, allow_nan=False, ensure_ascii=False) + "\n").encode()
    return _with_proof(blank, hashlib.sha256(blank).hexdigest())


def _with_proof(data: bytes, proof: str, instead_of: str = _BLANK) -> bytes:
    """The bytes with another hash in the last entry."""
    head, key, tail = data.rpartition(f'"{PROOF}": "'.encode())
    return head + key + tail.replace(instead_of.encode(), proof.encode(), 1)


def read_proven_json(path: Path) -> Any:  # noqa: ANN401 - whatever the file says
    """Value of a JSON file, held against the hash that it holds of itself; without one it is unproven.

    Raises
    ------
    OSError, ValueError
        As `read_json` does.
    ChangedError
        Its bytes are not those that were written.
    """
    data = path.read_bytes()
    document = _parsed(data)
    if not isinstance(document, dict) or PROOF not in document:
        return document
    proof = document[PROOF]
    blank = _with_proof(data, _BLANK, instead_of=str(proof))
    if (found := hashlib.sha256(blank).hexdigest()) != proof:
        raise ChangedError(f"bytes with the hash {found[:12]}; expected {str(proof)[:12]}, as pmg wrote it")
    return document


def read_json(path: Path) -> Any:  # noqa: ANN401 - whatever the file says
    """Value of a JSON file.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError
        It is no JSON in UTF-8, or nested deeper than any document of pmg.
    """
    return _parsed(path.read_bytes())


def _parsed(data: bytes) -> Any:  # noqa: ANN401 - whatever the file says
    try:
        return json.loads(data.decode("utf-8"))
    except RecursionError as fault:
        raise ValueError("nested too deeply") from fault


def with_nulls(document: Mapping[str, Any]) -> dict[str, Any]:
    """The document, and those within it, with null for what is not a number, as JSON knows none."""
    return {name: with_nulls(value) if isinstance(value, dict) else _known(value) for name, value in document.items()}


def _known(value: object) -> object:
    return None if isinstance(value, float) and value != value else value
