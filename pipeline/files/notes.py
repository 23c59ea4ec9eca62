"""Notes of what a call reads, writes and sets, taken while it runs; an audit trail is made of them."""

from __future__ import annotations

import hashlib
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from pmg.pipeline.files.digest import sha256_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Notes:
    """Notes of a call.

    Parameters
    ----------
    read, written : dict of str to str
        SHA-256 of each file that was read or written, by its full path.
    recordings : dict of str to str
        Name of each recording that the store answered for, by its SHA-256.
    settings : dict of str to object
        Settings in force, whatever set them.
    told : callable
        Told of these notes when settings are known, or a store was made.
    """

    read: dict[str, str] = field(default_factory=dict)
    written: dict[str, str] = field(default_factory=dict)
    recordings: dict[str, str] = field(default_factory=dict)
    settings: dict[str, object] = field(default_factory=dict)
    told: Callable[[Notes], None] | None = None

    def add(self, others: Notes) -> None:
        """Take in the notes of a part of the call."""
        self.read.update(others.read)
        self.written.update(others.written)
        self.recordings.update(others.recordings)
        self.settings.update(others.settings)


_TAKEN: ContextVar[Notes | None] = ContextVar("notes", default=None)


@contextmanager
def taking_notes(told: Callable[[Notes], None] | None = None) -> Iterator[Notes]:
    """Notes of what the block does in this process; `told` gets them when settings are known, or a store was made."""
    notes = Notes(told=told)
    before = _TAKEN.set(notes)
    try:
        yield notes
    finally:
        _TAKEN.reset(before)


def notes_taken() -> Notes | None:
    """Notes of the call that is running; None where nobody asked for any."""
    return _TAKEN.get()


def note_read(path: Path, content: bytes | str) -> None:
    """Note a file that was read, by its bytes or by their SHA-256."""
    if (notes := _TAKEN.get()) is not None:
        digest = content if isinstance(content, str) else hashlib.sha256(content).hexdigest()
        notes.read[str(path.absolute())] = digest


def note_recording(name: str, sha256: str) -> None:
    """Note a recording that the store answers for."""
    if (notes := _TAKEN.get()) is not None:
        notes.recordings[sha256] = name


def note_written(path: Path, content: Path) -> None:
    """Note a file that is written, by the file that holds its bytes until it is at its place."""
    if (notes := _TAKEN.get()) is not None:
        notes.written[str(path.absolute())] = sha256_of(content)


def note_settings(values: Mapping[str, object]) -> None:
    """Note settings in force."""
    if (notes := _TAKEN.get()) is not None:
        notes.settings.update(values)
    note_store()


def note_store() -> None:
    """Note that a store was made, or is known by now."""
    if (notes := _TAKEN.get()) is not None and notes.told is not None:
        notes.told(notes)


@dataclass(frozen=True)
class Noting(Generic[Item, Result]):
    """Work that gives its notes with its result, as another process takes them for itself."""

    work: Callable[[Item], Result]

    def __call__(self, item: Item) -> tuple[Result, Notes]:
        """The result for an item, and the notes."""
        with taking_notes() as notes:
            return self.work(item), notes
