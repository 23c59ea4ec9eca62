"""The entries of the audit trail that a call leaves in each store it works on: as it begins, and as it ends."""

from __future__ import annotations

import os
import platform
import sys
import warnings
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import Enum
from getpass import getuser
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmg.pipeline.files.notes import notes_taken, taking_notes
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.store.audit_trail import BEGAN, ENDED, FILE, OPENED_BY, STATE, append_entry

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pmg.pipeline.files.notes import Notes

VERSIONS = {"pmg": "pmg-bench", "numpy": "numpy", "scipy": "scipy"}
"""Distributions whose versions an entry names."""


def _now() -> str:
    return datetime.now(UTC).isoformat()


@dataclass(frozen=True)
class AuditedCall:
    """A call of a command, or from Python, that leaves entries.

    Parameters
    ----------
    command : str
        Its name.
    words : sequence of str
        Its call as typed; from Python, that of the script.
    settings : mapping
        What the call set, by name; the notes hold what a campaign file set besides.
    by : str
        ``pmg`` for a command, ``Python``.
    began : str
        When.
    opened : dict of Path to int or None
        Number of the entry of its beginning, by store; None where that could not be written.
    """

    command: str
    words: Sequence[str]
    settings: Mapping[str, object]
    by: str = "pmg"
    began: str = field(default_factory=_now)
    opened: dict[Path, int | None] = field(default_factory=dict)

    def begin(self, notes: Notes) -> None:
        """Leave an entry of the beginning in each store that is there and has none; the end tells if it could not."""
        chosen = self._chosen(notes)
        for store in _stores(chosen):
            if self.opened.get(store) is None:
                with suppress(Exception):
                    self.opened[store] = append_entry(store, {STATE: BEGAN, **self._facts(chosen)})

    def end(self, notes: Notes, code: int) -> tuple[Remark, ...]:
        """Leave an entry of the end in each store, with the exit code.

        Returns
        -------
        tuple of Remark
            A warning for each entry that could not be written: the results of the call stand all the same.
        """
        chosen = self._chosen(notes)
        failed = []
        for store in _stores(chosen):
            place = {STATE: ENDED, OPENED_BY: self.opened.get(store), ENDED: _now(), "exit_code": code}
            try:
                append_entry(store, self._facts(chosen) | _files(notes, store.absolute()) | place)
            except Exception as error:
                came = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
                message = f"the audit trail has no entry of this command ({came}); expected a file that "
                message += "can be written. The results stand; note by hand what was run, and put the file right"
                failed.append(Remark("warning", str(store / FILE), message))
        return tuple(failed)

    def _chosen(self, notes: Notes) -> dict[str, object]:
        return {name: value for name, value in {**self.settings, **notes.settings}.items() if value is not None}

    def _facts(self, settings: Mapping[str, object]) -> dict[str, Any]:
        """Who calls what, where and with which settings."""
        versions = {"python": platform.python_version()} | {name: version(each) for name, each in VERSIONS.items()}
        return {
            BEGAN: self.began,
            "user": _user(),
            "host": platform.node(),
            "platform": platform.platform(),
            "versions": versions,
            "command": self.command,
            "by": self.by,
            "arguments": list(self.words),
            "folder": str(Path.cwd()),
            "settings": {name: _plain(value) for name, value in settings.items()},
        }


@contextmanager
def audited_from_python(name: str, store: Path | None, **settings: object) -> Iterator[None]:
    """Entries of a call from Python in a store, if it names one; within a command, its own stand for it."""
    if notes_taken() is not None:
        yield
        return
    call = AuditedCall(name, sys.argv, {"store": store, **settings}, by="Python")
    code = 1
    with taking_notes(call.begin) as notes:
        call.begin(notes)
        try:
            yield
            code = 0
        finally:
            for remark in call.end(notes, code):
                warnings.warn(f"{remark.where}: {remark.message}", stacklevel=4)


def _stores(settings: Mapping[str, object]) -> list[Path]:
    """Stores that settings name."""
    named = settings.get("stores", [settings.get("store")])
    return list(dict.fromkeys(path for path in named if isinstance(path, Path))) if isinstance(named, list) else []


def _files(notes: Notes, store: Path) -> dict[str, Any]:
    """What went in and came out; files of the store are named from there, others in full."""
    named = set(notes.read.values())
    recordings = {digest: name for digest, name in notes.recordings.items() if digest not in named}
    read = {path: digest for path, digest in notes.read.items() if path not in notes.written}
    return {
        "read": [_file(path, digest, store) for path, digest in sorted(read.items())],
        "recordings": [{"name": name, "sha256": digest} for digest, name in sorted(recordings.items())],
        "written": [_file(path, digest, store) for path, digest in sorted(notes.written.items())],
    }


def _file(path: str, digest: str, store: Path) -> dict[str, str]:
    place = Path(path)
    name = place.relative_to(store).as_posix() if place.is_relative_to(store) else path
    return {"path": name, "sha256": digest}


def _plain(value: object) -> object:
    """A setting as JSON has it."""
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value if isinstance(value, bool | int | float | str) else str(value)


def _user() -> str:
    """Name of the account that runs the command, or its number; the environment is asked last."""
    if sys.platform == "win32":
        return getuser()
    import pwd

    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return str(os.getuid())
