"""The entry of the audit trail that a command leaves in each store it worked on."""

from __future__ import annotations

import os
import platform
import sys
from enum import Enum
from getpass import getuser
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.store.audit_trail import FILE, append_entry

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from datetime import datetime

    from pmg.pipeline.files.notes import Notes

VERSIONS = {"pmg": "pmg-bench", "numpy": "numpy", "scipy": "scipy"}
"""Distributions whose versions an entry names."""


def leave_entries(
    command: str, words: Sequence[str], settings: Mapping[str, object], notes: Notes, began: datetime, code: int
) -> tuple[Remark, ...]:
    """Leave an entry in the store that the settings name, or in each of several.

    Parameters
    ----------
    command : str
        Its name.
    words : sequence of str
        Its call as typed.
    settings : mapping
        What the call set, by name; the notes hold what a campaign file set besides.
    notes : Notes
        Of what it read and wrote.
    began : datetime
        When.
    code : int
        Its exit code.

    Returns
    -------
    tuple of Remark
        A warning for each entry that could not be written: the results of the command stand all the same.
    """
    chosen = {name: value for name, value in {**settings, **notes.settings}.items() if value is not None}
    named = chosen.get("stores", [chosen.get("store")])
    stores = [path for path in named if isinstance(path, Path)] if isinstance(named, list) else []
    failed = []
    for store in dict.fromkeys(stores):
        try:
            append_entry(store, _facts(command, words, chosen, notes, began, code, store.absolute()))
        except Exception as error:
            came = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
            message = f"the audit trail has no entry of this command ({came}); expected a file that "
            message += "can be written. The results stand; note by hand what was run, and put the file right"
            failed.append(Remark("warning", str(store / FILE), message))
    return tuple(failed)


def _facts(
    command: str,
    words: Sequence[str],
    settings: Mapping[str, object],
    notes: Notes,
    began: datetime,
    code: int,
    store: Path,
) -> dict[str, Any]:
    """The entry without its place in the chain; files of the store are named from there, others in full."""
    named = set(notes.read.values())
    recordings = {digest: name for digest, name in notes.recordings.items() if digest not in named}
    read = {path: digest for path, digest in notes.read.items() if path not in notes.written}
    return {
        "began": began.isoformat(),
        "user": _user(),
        "host": platform.node(),
        "platform": platform.platform(),
        "versions": {"python": platform.python_version()} | {name: version(each) for name, each in VERSIONS.items()},
        "command": command,
        "arguments": list(words),
        "folder": str(Path.cwd()),
        "settings": {name: _plain(value) for name, value in settings.items()},
        "read": [_file(path, digest, store) for path, digest in sorted(read.items())],
        "recordings": [{"name": name, "sha256": digest} for digest, name in sorted(recordings.items())],
        "written": [_file(path, digest, store) for path, digest in sorted(notes.written.items())],
        "exit_code": code,
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
