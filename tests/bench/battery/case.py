"""A fault of the battery, the folders it is planted in, and the commands that a user would give there."""

from __future__ import annotations

import ctypes
import math
import os
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path

from tests.grid.checked_campaign import Runs
from tests.recording.writer import write

PATIENCE = 60.0
"""Time after which a command counts as hanging [s]; the slowest of sound ones takes a few on a busy machine."""
OVERRIDES = (1, 2)
"""Capabilities of root to read, write and search whatever the modes of files say."""

Setup = Callable[["Desk"], object]


@dataclass(frozen=True)
class Desk:
    """Folder of one case: recordings, store, and whatever files the case adds."""

    place: Path

    @property
    def recordings(self) -> Path:
        """Folder of recordings."""
        return self.place / "recordings"

    @property
    def store(self) -> Path:
        """Store of the commands."""
        return self.place / "store"

    def file(self, name: str, text: str | bytes) -> Path:
        """A file of the case."""
        path = self.place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path


@dataclass(frozen=True)
class Call:
    """One command as a user gives it: words after `pmg`, and what it is run under.

    `before` is called first, `meanwhile` once it runs. `out` and `err` are what its streams go to, by default files; a
    bar is a pipe that nobody reads, a minus a stream that is closed.
    `file_size` limits the size of each file that it writes [bytes]; `plain` takes from root what others lack: the right
    to read and write whatever the modes of files say.
    """

    words: tuple[str, ...]
    before: Setup | None = None
    meanwhile: Setup | None = None
    out: str = ""
    err: str = ""
    file_size: int = 0
    plain: bool = False


INGEST = Call(("ingest", "recordings", "--store", "store", "--json"))
ANALYSE = Call(("analyse", "--store", "store", "--json"))
BOTH = (INGEST, ANALYSE)


@dataclass(frozen=True)
class Case:
    """A fault.

    Parameters
    ----------
    kind, what : str
        Its kind, and what it is.
    plant : callable, optional
        Changes the runs of the campaign before they are written.
    spoil : callable, optional
        Changes the files of the desk.
    calls : sequence of Call
        Commands under the fault.
    says : str
        Regular expression of what a finding or error must say to name it; by default any that is new.
    small : bool
        Whether two recordings suffice for a campaign.
    whole : bytes, optional
        The recording of the small campaign before it was spoilt; by default that of the campaign.
    first : str
        ``made`` where the sound campaign is ingested and analysed first; ``kept`` where, besides, what was written then
        must stand, and the same commands must go on afterwards.
    acts : callable, optional
        What, of the files and words written, acts on whoever reads it; empty where nothing does. Grids are then not
        compared: the names of points differ.
    """

    kind: str
    what: str
    plant: Callable[[Runs], object] | None = None
    spoil: Setup | None = None
    calls: Sequence[Call] = BOTH
    says: str = ""
    small: bool = False
    whole: bytes | None = None
    first: str = ""
    acts: Callable[[Desk, Sequence[Ended]], str] | None = None


@dataclass(frozen=True)
class Ended:
    """How a command ended: exit code (None: it hung), both streams, time, processor time [s], peak memory [bytes]."""

    code: int | None
    out: str
    err: str
    seconds: float
    cpu: float
    peak: int
    words: tuple[str, ...] = field(default=())


def write_changed(folder: Path, runs: Runs, before: Mapping[str, object]) -> None:
    """Those runs that are not as they were, as files; those that are gone, removed."""
    for name, run in runs.items():
        if run is not before.get(name):
            write(folder / name, run)
    for name in set(before) - set(runs):
        (folder / name).unlink()


def follow(call: Call, pmg: str, desk: Desk) -> Ended:
    """Run a command on a desk until it ends, or until it hangs and is stopped."""
    if call.before is not None:
        call.before(desk)
    began = time.monotonic()
    with ThreadPoolExecutor(2) as readers:
        child = _started(call, pmg, desk)
        reads = [readers.submit(s.read) if s is not None else None for s in (child.stdout, child.stderr)]
        if call.meanwhile is not None:
            call.meanwhile(desk)
        while True:
            pid, status, used = os.wait4(child.pid, os.WNOHANG)
            if pid or time.monotonic() - began > PATIENCE:
                break
            time.sleep(0.02)
        with suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)  # and whatever it started
        code = os.waitstatus_to_exitcode(status) if pid else None
        if not pid:
            _, _, used = os.wait4(child.pid, 0)
        child.returncode = 0  # it has been waited for
        out, err = ("" if read is None else read.result().decode(errors="replace") for read in reads)
    cpu = used.ru_utime + used.ru_stime
    return Ended(code, out, err, time.monotonic() - began, cpu, used.ru_maxrss * 1024, call.words)


def _started(call: Call, pmg: str, desk: Desk) -> subprocess.Popen[bytes]:
    libc = ctypes.CDLL(None)

    def limited() -> None:
        if call.file_size:
            resource.setrlimit(resource.RLIMIT_FSIZE, (call.file_size, call.file_size))
        if call.plain:
            for capability in OVERRIDES:
                libc.prctl(24, capability, 0, 0, 0)  # PR_CAPBSET_DROP
        for number, name in ((1, call.out), (2, call.err)):
            if name == "-":
                os.close(number)

    with ExitStack() as opened:
        streams = [_stream(name, opened) for name in (call.out, call.err)]
        return subprocess.Popen(
            [pmg, *call.words],
            cwd=desk.place,
            stdin=subprocess.DEVNULL,
            stdout=streams[0],
            stderr=streams[1],
            env=dict(os.environ) | {"OPENBLAS_NUM_THREADS": "1", "HOME": str(desk.place)},
            preexec_fn=limited,
            start_new_session=True,
        )


def _stream(name: str, opened: ExitStack) -> int:
    """What a stream goes to; a pipe that is read by default."""
    if name in ("", "-"):
        return subprocess.PIPE
    if name == "|":
        read, write_to = os.pipe()
        os.close(read)
        opened.callback(os.close, write_to)
        return write_to
    return opened.enter_context(Path(name).open("wb")).fileno()


def copied(source: Path, place: Path) -> Desk:
    """A desk with the recordings of another one."""
    desk = Desk(place)
    place.mkdir(parents=True)
    place.chmod(0o777)
    shutil.copytree(source, desk.recordings)
    return desk


def finite(text: str) -> float:
    """A number of a table, not a number where there is none."""
    return float(text) if text else math.nan
