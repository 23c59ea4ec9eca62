"""The one reader of TOML files that a user writes: text to a checked model, each fault with its file, line and key."""

from __future__ import annotations

import re
import sys
import tomllib
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

from pmg.pipeline.files.notes import note_read
from pmg.pipeline.files.strict_tables import RefusalError
from pmg.pipeline.files.table_keys import key_in_file, known_keys, left_out, spelled_keys
from pmg.pipeline.files.toml import lines_of
from pmg.sim.errors import BenchError, PmgError, near_miss

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from pmg.pipeline.files.toml import Key

Table = TypeVar("Table", bound=BaseModel)

LONGEST = 4 << 20
"""Longest file that is read [bytes]."""

SHOWN = 60
"""Characters of a name that cannot be one that are repeated in a message."""

EMPTY = re.compile(r"([\w.-]+)\"?\s*=\s*(?=[,}#]|$)")
"""An entry of a line of TOML without a value."""

KINDS = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text in quotation marks",
    "bool_type": "true or false",
    "list_type": "a list in square brackets",
    "dict_type": "a table",
    "model_type": "a table",
    "too_short": "at least one entry",
    "string_too_short": "a name",
}
"""Expected kind of value, by the kind of fault that pydantic names."""


@dataclass(frozen=True)
class TableFile(Generic[Table]):
    """A file that was read.

    Parameters
    ----------
    path : Path
        The file.
    text : str
        Its text, lines ended by a line feed.
    table : Table
        What it holds.
    error : type of PmgError
        What a refusal is raised as.
    """

    path: Path
    text: str
    table: Table
    error: type[PmgError] = BenchError

    @cached_property
    def lines(self) -> dict[Key, int]:
        """Line, from 1, in which each key or table begins."""
        return lines_of(self.text)

    def resolve(self, name: str) -> Path:
        """A file or folder that the file names, relative to its own folder; one that cannot be is refused."""
        path = self.path.parent / name
        try:
            path.lstat()
        except (FileNotFoundError, NotADirectoryError, PermissionError):
            return path  # who needs it says so
        except (OSError, ValueError) as fault:
            reason = getattr(fault, "strerror", None) or str(fault)
            shown = name if len(name) <= SHOWN else f"{name[:SHOWN]}..."
            came = f"'{shown}' cannot be the name of a file: {reason}"
            raise self.error(str(self.path), came, "the path of a file or folder", "Check the path.") from fault
        return path

    def where(self, *key: str | int) -> str:
        """File, line and key for a message; the line is that of the innermost table that stands in the file."""
        return _place_of(self.path, self.text, key)

    def refusal(self, came: str, expected: str, do: str, *key: str | int) -> PmgError:
        """A fault of what stands at a key, as an error."""
        return self.error(self.where(*key), came, expected, do)


def read_table_file(
    path: Path,
    what: str,
    model: type[Table],
    error: type[PmgError] = BenchError,
    unit_of: Callable[[Mapping[str, Any], Key], str] | None = None,
    faults: list[PmgError] | None = None,
) -> TableFile[Table]:
    """The file at a path, checked by a model.

    Parameters
    ----------
    path : Path
        A TOML file.
    what : str
        What it should hold, for the message.
    model : type of BaseModel
        What its tables are checked by.
    error : type of PmgError
        What a refusal is raised as.
    unit_of : callable, optional
        Of keys that exist for several units, the unit that holds at a key of what the file says.
    faults : list of PmgError, optional
        Receives every fault of the tables; what is given is then read without the keys at fault.

    Raises
    ------
    PmgError
        The file is not there, cannot be read, is no UTF-8 or no TOML, or holds something unknown, out of range or
        contradictory.
    """
    text = _text_of(path, what, error)
    try:
        data = tomllib.loads(text)
        overlong = _overlong(data)
    except tomllib.TOMLDecodeError as fault:
        raise _fault_of_form(path, text, fault, error) from fault
    except (RecursionError, ValueError) as fault:
        came = "nested too deeply" if isinstance(fault, RecursionError) else "a number with thousands of digits"
        raise error(str(path), came, f"{what} in TOML", "Correct the file.") from fault
    if overlong is not None:
        came, do = "a whole number that no float can hold", "Correct the value."
        raise error(_place_of(path, text, overlong), came, "a number below 1e308", do)
    while True:
        try:
            return TableFile(path, text, model.model_validate(data), error)
        except ValidationError as invalid:
            found = sorted(invalid.errors(include_url=False), key=_rank)
        told = [_fault_of_table(each, data, model, unit_of) for each in found]
        raised = [error(_place_of(path, text, key), *parts) for key, parts in told]
        if faults is None:
            raise raised[0]
        faults += raised
        if not [key for key, _ in told if left_out(data, key)]:
            raise raised[0]


def _fault_of_table(
    found: Mapping[str, Any],
    data: Mapping[str, Any],
    model: type[BaseModel],
    unit_of: Callable[[Mapping[str, Any], Key], str] | None,
) -> tuple[Key, tuple[str, str, str]]:
    """Key of a fault of pydantic as the file spells it, and what came, what was expected, what to do."""
    refused = found.get("ctx", {}).get("error")
    unit = unit_of(data, found["loc"]) if unit_of else ""
    spelled = tuple(word for word, _ in spelled_keys(model, found["loc"], unit))
    key = key_in_file(data, (*spelled, *(refused.key if isinstance(refused, RefusalError) else ())))
    return key, _parts(found, key, known_keys(model, found["loc"][:-1], unit))


def _place_of(path: Path, text: str, key: Key) -> str:
    """File, line and key; of a list, entries are counted from 1."""
    if not key:
        return str(path)
    lines = lines_of(text)
    line = next((lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in lines), None)
    words = "".join(f"[{word + 1}]" if isinstance(word, int) else f".{word}" for word in key).lstrip(".")
    return f"{path}: {words}" if line is None else f"{path}: line {line}, {words}"


def _overlong(value: object, key: Key = ()) -> Key | None:
    """Key of the first whole number that no float can hold; None where there is none."""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    if isinstance(value, int) and abs(value) > sys.float_info.max:
        return key
    return next((found for word, part in parts if (found := _overlong(part, (*key, word))) is not None), None)


def _text_of(path: Path, what: str, error: type[PmgError]) -> str:
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            raise error(str(path), "a device, pipe or socket", f"a file with {what} in TOML", "Name a regular file.")
        with path.open("rb") as stream:
            data = stream.read(LONGEST + 1)
        if len(data) > LONGEST:
            came, do = f"more than {LONGEST} bytes", "Check the path: this is not a file written by hand."
            raise error(str(path), came, f"{what} in TOML", do)
        note_read(path, data)
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except OSError as fault:
        came = "no such file" if isinstance(fault, FileNotFoundError) else fault.strerror or "cannot be read"
        raise error(str(path), came, f"{what} in TOML", "Check the path.") from fault
    except UnicodeDecodeError as fault:
        raise error(str(path), f"not UTF-8 ({fault.reason})", "a text file", "Save it as UTF-8.") from fault


def _fault_of_form(path: Path, text: str, fault: tomllib.TOMLDecodeError, error: type[PmgError]) -> PmgError:
    """The parser's message, with line and column."""
    place = re.search(r" \(at (?:line (\d+), column (\d+)|end of document)\)$", str(fault))
    line = place[1] if place and place[1] else str(max(1, len(text.splitlines())))
    came = str(fault)[: place.start()] if place else str(fault)
    column = f", column {place[2]}" if place and place[2] else ""
    do = "Correct the line."
    if "Unescaped '\\'" in came or "hex value" in came:
        do = 'Between " a backslash begins a sign: write / instead, or put the text between single quotes.'
    elif came == "Invalid value" and (empty := _empty_before(text, place)):
        came, do = f"no value after '{empty[1]} ='", "Complete the line, or leave the entry out."
        return error(f"{path}: line {line}{column}", came, "a value", do)
    elif came == "Invalid value":
        do = "Correct the line; text stands in quotation marks."
    return error(f"{path}: line {line}{column}", came, "TOML", do)


def _empty_before(text: str, place: re.Match[str] | None) -> re.Match[str] | None:
    """The entry without a value that ends where the parser stopped."""
    if place is None or not place[1]:
        return None
    line, column = text.splitlines()[int(place[1]) - 1], int(place[2]) - 1
    return next((each for each in EMPTY.finditer(line) if each.end() >= column), None) if "=" in line[:column] else None


def _rank(found: Mapping[str, Any]) -> int:
    """Which fault is reported: another schema, then an unknown key, as either may be the cause of the others."""
    if found["loc"] == ("schema",) and found["type"] != "missing":
        return 0
    return 1 if found["type"] == "extra_forbidden" else 2


def _parts(found: Mapping[str, Any], key: Key, known: list[str]) -> tuple[str, str, str]:
    """A fault of pydantic in three parts: what came, what was expected, what to do."""
    details, kind = found.get("ctx", {}), found["type"]
    refused = details.get("error")
    if isinstance(refused, RefusalError):
        return refused.came, refused.expected, refused.do
    if kind == "extra_forbidden":
        return "unknown key", "a known one", near_miss(str(key[-1]), known)
    if kind == "missing":
        return "missing", "this key", f"Add {key[-1]}."
    came = repr(found["input"])
    if kind == "list_type" and isinstance(found["input"], dict):
        return "a single table", f"[[{key[-1]}]], each in double brackets", "Correct the head."
    if kind == "greater_than_equal":
        return came, f"{details['ge']:g} or more", "Correct the value."
    if kind in ("enum", "literal_error"):
        words = re.findall(r"'([^']*)'", str(details["expected"]))
        do = near_miss(str(found["input"]), words) if words else "Correct the value."
        return came, str(details["expected"]), do
    return came, KINDS.get(kind, found["msg"].lower()), "Correct the value."
