"""What a folder offers pmg, at a glance: names and sizes of its files, none of which is opened."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.store.sources import FOREIGN, SUFFIX
from pmg.pipeline.wording.plurals import counted

if TYPE_CHECKING:
    from pathlib import Path

MOST_FOLDERS = 200
"""Folders below this one that are looked into."""


def look_around(folder: Path) -> Outcome | None:
    """What pmg would do in a folder; None where neither it nor a folder directly below it holds recordings.

    Parameters
    ----------
    folder : Path
        The folder; only names and sizes are read.
    """
    files = sorted(path for path in folder.iterdir() if path.is_file())
    recordings = [path for path in files if path.suffix.lower() == SUFFIX]
    if recordings:
        return _would_run(folder, recordings)
    if foreign := [path for path in files if path.suffix.lower() in FOREIGN]:
        return _would_import(foreign)
    below = [path for path in sorted(folder.iterdir()) if path.is_dir()][:MOST_FOLDERS]
    held = [path.name for path in below if next(path.glob(f"*{SUFFIX}"), None) is not None]
    if not held:
        return None
    lines = [f"Recordings lie in {', '.join(held[:5])}{' and others' if len(held) > 5 else ''}."]
    lines += [_would(held[0], held[0], ""), _untouched()]
    return Outcome({"folder": str(folder), "folders_with_recordings": held}, tuple(lines))


def _would_run(folder: Path, recordings: list[Path]) -> Outcome:
    size = sum(path.stat().st_size for path in recordings)
    span = recordings[0].name if len(recordings) == 1 else f"{recordings[0].name} to {recordings[-1].name}"
    command = _would(".", folder.resolve().name or "campaign", "../")
    lines = [f"{counted(len(recordings), 'recording')} here: {span}, {size / 1e6:.1f} MB.", command]
    lines += ["To see first what they permit: pmg doctor .", _untouched()]
    data = {"folder": str(folder), "recordings": len(recordings), "bytes": size}
    return Outcome(data, tuple(lines))


def _would_import(foreign: list[Path]) -> Outcome:
    kinds = ", ".join(sorted({path.suffix.lower().lstrip(".").upper() for path in foreign}))
    first = _quoted(foreign[0].name)
    lines = [
        f"{counted(len(foreign), 'file')} of another format here ({kinds}). They are converted first:",
        f"  pmg import {first} --guess --out map.toml",
        "Complete map.toml, then: pmg import . --map map.toml --out ../recordings",
        _untouched(),
    ]
    return Outcome({"foreign": len(foreign)}, tuple(lines))


def _would(place: str, name: str, above: str) -> str:
    store, report = _quoted(f"{above}{name}-store"), _quoted(f"{above}{name}-report")
    return (
        f"This decodes them, fits the losses, compares with the simulation and names the cause of a difference:\n"
        f"  pmg run {_quoted(place)} --store {store} --report {report}"
    )


def _untouched() -> str:
    return "Nothing has been read or written yet."


def _quoted(word: str) -> str:
    """A word as shells take it, in quotes where it holds a space."""
    return f'"{word}"' if " " in word else word
