"""Files of a folder that are to be ingested, each by its name and its content."""

from __future__ import annotations

import hashlib
import os
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.files.notes import note_read
from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.container.records import MAGIC
from pmg.pipeline.recording.findings import Finding
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

SUFFIX = ".mcap"
FOREIGN = frozenset({".csv", ".tsv", ".tdms", ".mf4", ".mdf", ".h5", ".hdf5"})
"""Ends of the names of files that other recorders write."""
PUBLISHED = ("neutral_grid.csv", "engaged_grid.csv")
"""Files of a folder of published grids, the thesis's or others of the same form."""
BRING = (
    "Bring it in with 'pmg import': a file says which channel is which (see 'pmg import --help'). "
    "Of another machine than a magnetic gear, 'pmg run' reads it as it is, with --machine FILE."
)
SAMPLED = 1 << 16
"""Bytes at either end of a file that tell, with its size, which shard it belongs to."""


@dataclass(frozen=True)
class StoredSource:
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

    sources: tuple[StoredSource, ...]
    unreadable: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class Shard:
    """One of several parts of a campaign, each ingested by a process of its own.

    Parameters
    ----------
    number : int
        Which part, from 1.
    count : int
        How many there are.
    """

    number: int
    count: int

    @classmethod
    def of(cls, text: str) -> Shard:
        """The shard that a text such as ``3/16`` names.

        Raises
        ------
        RecordingError
            It is not of that form, or there is no such part.
        """
        form = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text.strip())
        shard = cls(int(form[1]), int(form[2])) if form else cls(0, 0)
        if not 1 <= shard.number <= shard.count:
            do = "Count from 1; of a job array that counts from 0, give the number plus 1."
            raise RecordingError("--shard", repr(text), "i/n with i from 1 to n, such as 3/16", do)
        return shard

    def part(self, paths: list[Path]) -> list[Path]:
        """The files of this part, by name.

        Parts take the files in turn, the largest first, so that each gets as many and as much. Files of the same
        bytes come into the same part, where the copy is seen. Nothing but their ends is read.
        """
        groups: dict[tuple[int, str], list[Path]] = {}
        for path in paths:
            groups.setdefault(_likeness(path), []).append(path)
        mine = sorted(groups, reverse=True)[self.number - 1 :: self.count]
        return sorted(path for likeness in mine for path in groups[likeness])


class Selection(Protocol):
    """Some of the files of a place, such as a shard."""

    def part(self, paths: list[Path]) -> list[Path]:
        """The files that are taken, by name."""


@dataclass(frozen=True)
class Named:
    """Files that are named one by one.

    Parameters
    ----------
    paths : frozenset of Path
        The files.
    """

    paths: frozenset[Path]

    def part(self, paths: list[Path]) -> list[Path]:
        """Those of the place that are named."""
        return [path for path in paths if path in self.paths]


def _likeness(path: Path) -> tuple[int, str]:
    """Size and a hash of both ends, which are the same for files of the same bytes; the name where none can be had."""
    try:
        if not path.is_file():
            return -1, str(path)
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            ends = file.read(SAMPLED)
            file.seek(max(size - SAMPLED, 0))
            return size, hashlib.sha256(ends + file.read(SAMPLED)).hexdigest()
    except OSError:
        return -1, str(path)


def find_recordings(place: Path) -> list[Path]:
    """The recordings of a folder (and below it), by name; or the one file that was named.

    Raises
    ------
    RecordingError
        Nothing is there.
    """
    if place.is_file():
        if place.suffix.lower() in FOREIGN:
            came = f"a file of the ending {place.suffix}"
            raise RecordingError(str(place), came, f"a folder of {SUFFIX} files, or one", BRING)
        return [place]
    if not place.exists():
        came = "no such file" if place.suffix else "no such folder"
        raise RecordingError(str(place), came, f"a folder of {SUFFIX} files, or one", "Check the path.")
    if not place.is_dir():
        do = "Name a folder or a regular file."
        raise RecordingError(str(place), "a device, pipe or socket", f"a folder of {SUFFIX} files, or one", do)
    found = sorted(path for path in place.rglob(f"*{SUFFIX}") if not path.is_dir())
    if not found:
        others = sorted({path.suffix or "no suffix" for path in place.iterdir()})
        contents = f"no {SUFFIX} file" + (f" (but {', '.join(others[:5])})" if others else " (the folder is empty)")
        do = BRING if FOREIGN & {other.lower() for other in others} else "Name the folder that holds them."
        raise RecordingError(str(place), contents, f"recordings with the ending {SUFFIX}", do)
    return found


def passed_over(place: Path) -> tuple[Finding, ...]:
    """Recordings by their content that the folder holds under another ending, and that are not read."""
    if not place.is_dir():
        return ()
    do = f"Move it out of the folder; if it is no copy of another, give it the ending {SUFFIX}."
    message = f"a recording by its content, without the ending {SUFFIX}: not read"
    return tuple(
        Finding(Severity.WARNING, "whole file", message, path.relative_to(place).as_posix(), Code.UNEXPECTED, do)
        for path in sorted(place.rglob("*"))
        if path.suffix.lower() != SUFFIX and _begins_as_recording(path)
    )


def _begins_as_recording(path: Path) -> bool:
    """Whether a regular file begins as MCAP does; no for what cannot be read."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def take_inventory(place: Path, shard: Selection | None = None) -> Inventory:
    """Files of a place by content: the same bytes twice are one source, and said so.

    Parameters
    ----------
    place : Path
        A folder, or one file.
    shard : Selection, optional
        The part of the files that is looked at.

    Raises
    ------
    RecordingError
        Nothing is there.
    """
    base = place if place.is_dir() else place.parent
    sources: dict[str, StoredSource] = {}
    paths = find_recordings(place)
    findings, unreadable = [], 0
    for path in paths if shard is None else shard.part(paths):
        name = os.fsencode(path.relative_to(base).as_posix()).decode("utf-8", "backslashreplace")
        try:
            if path.exists() and not path.is_file():
                raise OSError("a device, pipe or socket, not a regular file")
            digest = sha256_of(path)
        except OSError as error:
            unreadable += 1
            message = f"cannot be opened ({error.strerror or error}); expected a readable file"
            advice = "Check the link, the rights and the disk."
            findings.append(Finding(Severity.ERROR, "whole file", message, name, Code.UNREADABLE, advice))
            continue
        note_read(path, digest)
        if digest in sources:
            message = f"the same bytes as {sources[digest].name}; expected each run once. It is ingested once"
            findings.append(
                Finding(Severity.WARNING, "whole file", message, name, Code.DUPLICATE_FILE, "Remove the copy.")
            )
            continue
        sources[digest] = StoredSource(path, name, digest)
    return Inventory(tuple(sources.values()), unreadable, tuple(findings))
