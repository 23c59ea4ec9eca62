"""The audit trail of a store: one line a command, each holding the hash of the one before."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any

from pmg.pipeline.store.store import MARK

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

FILE = "audit.jsonl"
SCHEMA = "pmg.audit/1"
LONGEST = 1 << 28
"""Longest line that is read [bytes]."""
PATIENCE_S = 10.0
"""Time for which another command may hold the trail [s]."""
OWN, BEFORE, NUMBER = "sha256", "previous", "entry"
"""Keys of the hash of an entry, of the hash of the one before it, and of its line."""
STATE, BEGAN, ENDED, OPENED_BY = "state", "began", "ended", "opened_by"
"""Key of what an entry is, its two values, and key of the number of the entry with which its call began."""


@dataclass(frozen=True)
class Break:
    """A place where the chain does not hold.

    Parameters
    ----------
    line : int
        From 1; one past the last where something is missing at the end.
    came, expected : str
        What stands there, and what should.
    """

    line: int
    came: str
    expected: str


@dataclass(frozen=True)
class AuditTrail:
    """A trail as it was read.

    Parameters
    ----------
    entries : tuple of dict
        Whole entries, in the order of the file.
    breaks : tuple of Break
        Where the chain does not hold.
    lost : tuple of Break
        Lines that are no whole entries though the chain goes on around them, as a kill or a full disk leaves them.
    """

    entries: tuple[dict[str, Any], ...]
    breaks: tuple[Break, ...]
    lost: tuple[Break, ...]

    @property
    def head(self) -> str | None:
        """Hash of the last entry, which stands for all before it; None where there is no entry."""
        return self.entries[-1][OWN] if self.entries else None

    @property
    def calls(self) -> tuple[dict[str, Any], ...]:
        """One entry a call: that of its end, or that of its beginning where it left no end."""
        closed = {str(entry.get(OPENED_BY)) for entry in self.entries}
        return tuple(e for e in self.entries if e.get(STATE) != BEGAN or str(e.get(NUMBER)) not in closed)


def append_entry(store: Path, facts: Mapping[str, Any]) -> int | None:
    """Append an entry to the trail of a store; gives its number, None where there is no store and nothing is done.

    Parameters
    ----------
    store : Path
        The store.
    facts : mapping
        The entry without its number and hashes.

    Raises
    ------
    OSError
        It cannot be written; the trail is as it was.
    """
    if not (store / MARK).is_file():
        return None
    path = store / FILE
    if path.exists() and not path.is_file():
        raise OSError(0, "not a regular file", str(path))
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o644)
    with os.fdopen(descriptor, "r+b") as file, _held(descriptor, path):
        starts, end, torn = [], 0, False
        for line in _lines(file):
            starts.append(end)
            end, torn = end + len(line), not line.endswith(b"\n")
        before = next((found[OWN] for start in reversed(starts) if (found := _entry_at(file, start))), None)
        entry = {**facts, "schema": SCHEMA, NUMBER: len(starts) + 1, BEFORE: before}
        entry[OWN] = _hash_of(entry)
        left = b"\n" * torn + _canonical(entry) + b"\n"
        os.lseek(descriptor, 0, os.SEEK_END)
        try:
            while left:
                left = left[os.write(descriptor, left) :]
            os.fsync(descriptor)
        except OSError:
            os.ftruncate(descriptor, end)
            raise
    return len(starts) + 1


def read_trail(store: Path) -> AuditTrail:
    """The trail of a store, with every place where it does not hold.

    Raises
    ------
    OSError
        There is none, or it cannot be read.
    """
    path = store / FILE
    if path.exists() and not path.is_file():
        raise OSError(0, "not a regular file", str(path))
    entries: list[dict[str, Any]] = []
    breaks: list[Break] = []
    lost: list[Break] = []
    with path.open("rb") as file:
        for number, line in enumerate(_lines(file), 1):
            entry = _entry_of(line)
            if entry is None:
                came = "no end of line" if not line.endswith(b"\n") else "no whole entry"
                lost.append(Break(number, f"{came} in {len(line)} bytes", "one JSON object, ended by a line feed"))
                continue
            breaks += _breaks(number, line, entry, entries[-1][OWN] if entries else None)
            entries.append(entry)
    return AuditTrail(tuple(entries), tuple(breaks), tuple(lost))


def _breaks(number: int, line: bytes, entry: dict[str, Any], before: str | None) -> Iterator[Break]:
    """Where a line does not stand as it was written, or not after the one that it was written after."""
    if line.removesuffix(b"\n") != _canonical(entry):
        yield Break(number, "another spelling of its JSON", "the one that pmg writes")
    own = _hash_of(entry)
    if entry[OWN] != own:
        yield Break(number, f"contents with the hash {own}", f"{entry[OWN]}, which the line states")
    if entry.get(NUMBER) != number:
        yield Break(number, f"entry {entry.get(NUMBER)}", f"entry {number}: lines were removed, added or moved")
    if entry.get(BEFORE) != before:
        stated = entry.get(BEFORE) or "no entry"
        yield Break(number, f"{before or 'no entry'} before it", f"{stated}, after which it was written")


def _lines(file: IO[bytes]) -> Iterator[bytes]:
    """Lines, each with its end where it has one; one that is too long comes in parts, none of which is an entry."""
    while line := file.readline(LONGEST):
        yield line


def _entry_of(line: bytes) -> dict[str, Any] | None:
    """The entry in a line; None where it is no whole one."""
    try:
        entry = json.loads(line)
        whole = isinstance(entry, dict) and isinstance(entry.get(OWN), str) and _hash_of(entry)
    except (ValueError, RecursionError):
        return None
    return entry if whole else None


def _entry_at(file: IO[bytes], start: int) -> dict[str, Any] | None:
    """The entry in the line that begins at this byte."""
    file.seek(start)
    return _entry_of(file.readline(LONGEST))


def _hash_of(entry: Mapping[str, Any]) -> str:
    """SHA-256 over the canonical JSON of an entry without its own hash."""
    return hashlib.sha256(_canonical({key: value for key, value in entry.items() if key != OWN})).hexdigest()


def _canonical(entry: Mapping[str, Any]) -> bytes:
    """Canonical JSON: keys sorted, no blanks, ASCII."""
    return json.dumps(entry, sort_keys=True, separators=(",", ":"), ensure_ascii=True).encode("ascii")


@contextmanager
def _held(descriptor: int, path: Path) -> Iterator[None]:
    """The trail in the hands of this process alone; a process that ends lets go by that.

    Raises
    ------
    OSError
        Another process keeps it.
    """
    until = time.monotonic() + PATIENCE_S
    while not _locked(descriptor):
        if time.monotonic() > until:
            raise OSError(0, f"held by another process for more than {PATIENCE_S:g} s", str(path))
        time.sleep(0.01)
    yield


def _locked(descriptor: int) -> bool:
    """Whether the file could be locked now; closing it unlocks it."""
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(descriptor, 1 << 62, os.SEEK_SET)  # a byte that is never read, as others may read the rest
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
            os.lseek(descriptor, 0, os.SEEK_SET)
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    return True
