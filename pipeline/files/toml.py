"""Lines of a TOML file in which its keys and tables begin."""

from __future__ import annotations

import re
import tomllib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

TOKEN = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}|' r"'''.*?'{3,5}|" r'"(?:[^"\\]|\\.)*"|' r"'[^']*'|#[^\n]*|[\[\]{}\n]", re.DOTALL
)
"""Strings, comments, brackets and ends of lines of TOML: what tells where an assignment ends."""

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
    """Heads and assignments of a sound text, each with its first line; one in brackets or quotes goes over several."""
    depth, begin, line = 0, 0, 1
    for token in TOKEN.finditer(text + "\n"):
        if token[0] in "[{":
            depth += 1
        elif token[0] in "]}":
            depth -= 1
        elif token[0] == "\n" and depth == 0:
            statement = text[begin : token.end()]
            if statement.strip() and not statement.lstrip().startswith("#"):
                yield line, statement
            line += statement.count("\n")
            begin = token.end()


def _paths(data: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """The words that lead to each innermost entry; an empty table is one."""
    for name, entry in data.items():
        if isinstance(entry, dict) and entry:
            yield from ((name, *path) for path in _paths(entry))
        else:
            yield (name,)
