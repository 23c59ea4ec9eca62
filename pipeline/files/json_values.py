"""Numbers that are not known, as JSON and tables keep them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping


def with_nulls(document: Mapping[str, Any]) -> dict[str, Any]:
    """The document, and those within it, with null for what is not a number, as JSON knows none."""
    return {name: with_nulls(value) if isinstance(value, dict) else _known(value) for name, value in document.items()}


def _known(value: object) -> object:
    return None if isinstance(value, float) and value != value else value
