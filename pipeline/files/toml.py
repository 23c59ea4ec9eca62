"""A file in TOML that a user wrote: its text, what it holds, and the line in which each key stands."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pmg.sim.errors import BenchError, PmgError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path


@dataclass(frozen=True)
class TomlFile:
    """A file and what it holds.

    Parameters
    ----------
    path : Path
        The file.
    text : str
        Its text, lines ended by a line feed.
    data : dict
        Its tables.
    """

    path: Path
    text: str
    data: dict[str, Any]

    def lines(self) -> dict[tuple[str, ...], int]:
        """Line, from 1, in which each key or table begins, by the words that lead to it."""
        found: dict[tuple[str, ...], int] = {}
        table: tuple[str, ...] = ()
        for number, statement in _statements(self.text):
            data = tomllib.loads(statement)
            if statement.lstrip().startswith("["):
                table = next(_paths(data), ())
                found.setdefault(table, number)
            else:
                for path in _paths(data):
                    for depth in range(1, len(path) + 1):
                        found.setdefault((*table, *path[:depth]), number)
        return found


def read_toml(path: Path, what: str, error: type[PmgError] = BenchError) -> TomlFile:
    """The file at a path.

    Parameters
    ----------
    path : Path
        A TOML file.
    what : str
        What it should hold, for the message.
    error : type of PmgError
        What a refusal is raised as.

    Raises
    ------
    PmgError
        The file is not there, cannot be read, is no UTF-8 or no TOML; a fault of form with its line and column.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
        return TomlFile(path, text, tomllib.loads(text))
    except OSError as fault:
        came = "no such file" if isinstance(fault, FileNotFoundError) else fault.strerror or "cannot be read"
        raise error(str(path), came, f"{what} in TOML", "Check the path.") from fault
    except UnicodeDecodeError as fault:
        raise error(str(path), f"not UTF-8 ({fault.reason})", "a text file", "Save it as UTF-8.") from fault
    except tomllib.TOMLDecodeError as fault:
        place = re.search(r" \(at (?:line (\d+), column (\d+)|end of document)\)$", str(fault))
        line = place[1] if place and place[1] else str(max(1, len(text.splitlines())))
        came = str(fault)[: place.start()] if place else str(fault)
        column = f", column {place[2]}" if place and place[2] else ""
        raise error(f"{path}: line {line}{column}", came, "TOML", _remedy(came)) from fault


def _remedy(came: str) -> str:
    """What to do about a fault of form, by the parser's words for it."""
    if "Unescaped '\\'" in came or "hex value" in came:
        return 'Between " a backslash begins a sign: write / instead, or put the text between single quotes.'
    if came == "Invalid value":
        return "Correct the line; text stands in quotation marks."
    return "Correct the line."


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
        inner = entry[0] if isinstance(entry, list) and entry and isinstance(entry[0], dict) else entry
        if isinstance(inner, dict) and inner:
            yield from ((name, *path) for path in _paths(inner))
        else:
            yield (name,)
