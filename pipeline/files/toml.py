"""Lines of a TOML file in which its keys and tables begin."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

Key = tuple[str | int, ...]
"""Words that lead to a value of a file; a number, from 0, where a list stands."""


def lines_of(text: str) -> dict[Key, int]:
    """Line, from 1, in which each key or table of a sound text begins; line feeds end its lines."""
    found: dict[Key, int] = {}
    counts: dict[Key, int] = {}
    table: Key = ()
    for number, statement in _statements(text):
        paths = _paths(tomllib.loads(statement))
        if statement.lstrip().startswith("["):
            names, table = next(paths), ()
            if statement.lstrip().startswith("[["):
                found.setdefault(names, number)
            for depth, name in enumerate(names, start=1):
                table = (*table, name)
                if depth == len(names) and statement.lstrip().startswith("[["):
                    counts[table] = counts.get(table, 0) + 1
                table = (*table, counts[table] - 1) if table in counts else table
            found.setdefault(table, number)
        else:
            for path in paths:
                for depth in range(1, len(path) + 1):
                    found.setdefault((*table, *path[:depth]), number)
    return found


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """Heads and assignments of a sound text, each with its first line; one that is broken off goes on."""
    begun, first = "", 1
    for number, line in enumerate(text.split("\n"), start=1):
        if not begun and (not line.strip() or line.lstrip().startswith("#")):
            continue
        first = first if begun else number
        begun += line + "\n"
        try:
            tomllib.loads(begun)
        except tomllib.TOMLDecodeError:
            continue
        yield first, begun
        begun = ""


def _paths(data: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """The words that lead to each innermost entry; an empty table is one."""
    for name, entry in data.items():
        if isinstance(entry, dict) and entry:
            yield from ((name, *path) for path in _paths(entry))
        else:
            yield (name,)
