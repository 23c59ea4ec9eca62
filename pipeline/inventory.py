"""What there is to ingest: the files of a folder, each by its name and its content."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.recording import Code, Finding, Severity
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

SUFFIX = ".mcap"


@dataclass(frozen=True)
class Source:
    """One file to ingest: where it lies, its name in the campaign, its identity."""

    path: Path
    name: str
    sha256: str

    @property
    def place(self) -> str:
        """Hash of where the file lies, which tells the same place again without naming it."""
        return hashlib.sha256(str(self.path.resolve()).encode("utf-8", "surrogateescape")).hexdigest()[:16]

    @property
    def identifier(self) -> str:
        """Stem of the file and the first eight digits of its hash."""
        return f"{self.path.stem}-{self.sha256[:8]}"


@dataclass(frozen=True)
class Inventory:
    """The sources of a place.

    Parameters
    ----------
    sources : tuple of Source
        Each content once.
    unreadable : int
        Files that could not even be opened.
    findings : tuple of Finding
        Copies, and files that could not be opened.
    """

    sources: tuple[Source, ...]
    unreadable: int
    findings: tuple[Finding, ...]


def find_recordings(place: Path) -> list[Path]:
    """The recordings of a folder (and below it), by name; or the one file that was named.

    Raises
    ------
    RecordingError
        Nothing is there.
    """
    if place.is_file():
        return [place]
    if not place.exists():
        raise RecordingError(str(place), "nothing there", f"a folder of {SUFFIX} files, or one", "Check the path.")
    found = sorted(path for path in place.rglob(f"*{SUFFIX}") if not path.is_dir())
    if not found:
        others = sorted({path.suffix or "no suffix" for path in place.iterdir()})
        held = f"no {SUFFIX} file" + (f" (but {', '.join(others[:5])})" if others else " (the folder is empty)")
        raise RecordingError(
            str(place), held, f"recordings with the ending {SUFFIX}", "Name the folder that holds them."
        )
    return found


def take_inventory(place: Path) -> Inventory:
    """Files of a place by content: the same bytes twice are one source, and said so.

    Raises
    ------
    RecordingError
        Nothing is there.
    """
    base = place if place.is_dir() else place.parent
    sources: dict[str, Source] = {}
    findings, unreadable = [], 0
    for path in find_recordings(place):
        name = path.relative_to(base).as_posix()
        try:
            with path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            unreadable += 1
            message = f"cannot be opened ({error.strerror or error}); expected a readable file"
            advice = "Check the link, the rights and the disk."
            findings.append(Finding(Code.UNREADABLE, Severity.ERROR, name, "whole file", message, advice))
            continue
        if digest in sources:
            message = f"the same bytes as {sources[digest].name}; expected each run once. It is ingested once"
            findings.append(
                Finding(Code.DUPLICATE_FILE, Severity.WARNING, name, "whole file", message, "Remove the copy.")
            )
            continue
        sources[digest] = Source(path, name, digest)
    return Inventory(tuple(sources.values()), unreadable, tuple(findings))
