"""Writing files so that a kill at any moment leaves the old one or the new one."""

from __future__ import annotations

import hashlib
import os
import platform
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from pmg.pipeline.files.notes import note_written

if TYPE_CHECKING:
    from collections.abc import Iterator

PREFIX = ".pmg-"
"""Start of the names of files that are still being written."""
AT_ONCE = 4
"""Files that the disk is asked to keep at the same time."""
UNNOTED, UNTOLD = "unnoted", "untold"
"""Births of a process that has ended and is not noted yet, and of one of which the system does not tell."""
ABANDONED = 3600.0
"""Age after which such a file belongs to no running process [s], where its process cannot be asked after."""


def write_atomic(path: Path, data: bytes) -> None:
    """Write a file so that it is either the old one or the new one, never half of it; `opened_aside` says how."""
    with opened_aside(path) as aside:
        aside.write(data)


def write_together(files: dict[Path, bytes]) -> None:
    """Write several files, each as `write_atomic` does; what the disk takes for them is waited for at once."""
    with ExitStack() as left:
        asides = {path: left.enter_context(_aside(path)) for path in reversed(files)}  # left in the order of the files
        for path, data in files.items():
            asides[path].write(data)
        list(_settling(os.getpid()).map(_settle, asides.values()))


@cache
def _settling(_process: int) -> ThreadPoolExecutor:
    """Threads that wait for the disk, started once for all files; a process that was forked off has its own."""
    return ThreadPoolExecutor(AT_ONCE, "pmg-settle")


@contextmanager
def opened_aside(path: Path) -> Iterator[BinaryIO]:
    """A file to be written piece by piece; it stands at its place once the block has been left without an error.

    The data go to a file of another name in the same folder, which is then renamed. The folder is made if absent.
    The other name tells which process writes it.
    """
    with _aside(path) as aside:
        yield aside
        _settle(aside)


@contextmanager
def _aside(path: Path) -> Iterator[BinaryIO]:
    """A file of another name, to be settled within the block; then it is renamed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    owner = f"{PREFIX}{_realm()}-{os.getpid()}.{_birth(os.getpid())}-"
    handle, name = tempfile.mkstemp(prefix=owner, suffix=path.suffix, dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as aside:
            yield aside
        Path(name).chmod(0o644)
        note_written(path, Path(name))
        Path(name).replace(path)
    except BaseException:
        with suppress(OSError):
            Path(name).unlink()
        raise


def _settle(aside: BinaryIO) -> None:
    """Wait until the disk holds a file."""
    aside.flush()
    os.fsync(aside.fileno())


def abandoned(path: Path) -> bool:
    """Whether the process that was writing such a file is gone.

    On the machine that wrote it, because no such process runs; from elsewhere, because it is an hour old or more.
    """
    realm, _, rest = path.name.removeprefix(PREFIX).partition("-")
    pid, _, birth = rest.partition("-")[0].partition(".")
    if realm == _realm() and pid.isdecimal() and not _runs(int(pid), birth):
        return True
    try:
        return time.time() - path.stat().st_mtime > ABANDONED
    except OSError:
        return False


def _runs(pid: int, birth: str) -> bool:
    """Whether the process of this number that started then lives; taken to where the system cannot be asked safely.

    One that has ended and waits for its parent to note it does not live: in a container nobody may ever note it.
    """
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    now = _birth(pid)
    return now != UNNOTED and (birth in {"", UNTOLD} or now in {birth, UNTOLD})


def _birth(pid: int) -> str:
    """When a process started, in ticks since the start of the machine; `UNNOTED`, or `UNTOLD` where nothing tells."""
    try:
        told = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    except OSError:
        return UNTOLD
    return UNNOTED if told[0] in "ZX" else told[19]


@cache
def _realm() -> str:
    """Within it a process number means one process: this machine since its start, and its space of numbers."""
    known = [platform.node()]
    with suppress(OSError):
        known.append(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii"))
        known.append(str(Path("/proc/self/ns/pid").readlink()))
    return hashlib.sha256("\n".join(known).encode()).hexdigest()[:8]
