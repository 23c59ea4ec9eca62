"""JSON as files hold it, and numbers that are not known."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


def read_json(path: Path) -> Any:  # noqa: ANN401 - whatever the file says
    """Value of a JSON file.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError
        It is no JSON in UTF-8, or nested deeper than any document of pmg.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError as fault:
        raise ValueError("nested too deeply") from fault


def with_nulls(document: Mapping[str, Any]) -> dict[str, Any]:
    """The document, and those within it, with null for what is not a number, as JSON knows none."""
    return {name: with_nulls(value) if isinstance(value, dict) else _known(value) for name, value in document.items()}


def _known(value: object) -> object:
    return None if isinstance(value, float) and value != value else value
