"""`./pmgw bench kill`: the ingest killed at random moments and run again, its store held against an undisturbed one."""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pmg.pipeline.files.atomic import PREFIX
from pmg.pipeline.store.audit_trail import FILE as TRAIL

ROOT = Path(__file__).resolve().parent.parent.parent
EXAMPLE = ROOT / "raw" / "example"
LONGEST_S = 600.0
"""Time after which a command that neither ends nor comes to the moment is a fault [s]."""
LATEST_S = 0.02
"""Longest time from a finished file to the kill [s]; a file takes about half of it."""


def command(recordings: Path, store: Path, *more: str) -> subprocess.Popen[bytes]:
    """The real command, in a process of its own."""
    words = [sys.executable, "-m", "pmg.pipeline", "ingest", str(recordings), "--store", str(store), "--json", *more]
    path = f"{ROOT / '.typing'}{os.pathsep}{ROOT}"
    environment = {**os.environ, "PYTHONPATH": path}
    return subprocess.Popen(words, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def finish(process: subprocess.Popen[bytes]) -> dict[str, Any]:
    """What a command says when it is left to its end."""
    out, err = process.communicate(timeout=LONGEST_S)
    assert process.returncode in (0, 3), err.decode()
    told: dict[str, Any] = json.loads(out)["data"]
    return told


def contents(store: Path) -> dict[str, bytes]:
    """Every file of a store, whatever its name, but its audit trail: that tells the time and place of each command."""
    files = (p for p in sorted(store.rglob("*")) if p.is_file() and p != store / TRAIL)
    return {p.relative_to(store).as_posix(): p.read_bytes() for p in files}


def finished(store: Path) -> dict[str, tuple[int, int]]:
    """Files whose manifest is written, each with what changes when it is written again."""
    found = {}
    for path in (store / "sources").glob("*.json"):
        if not path.name.startswith(PREFIX):
            at = path.stat()
            found[path.stem] = at.st_ino, at.st_mtime_ns
    return found


def begun(store: Path, done: dict[str, tuple[int, int]]) -> int:
    """Files whose samples are written, wholly or in part, and whose manifest is not."""
    return sum(path.name.startswith(PREFIX) or path.stem not in done for path in (store / "runs").glob("*"))


def children(pid: int) -> list[int]:
    """Processes that a process has started."""
    found: list[int] = []
    for listing in Path(f"/proc/{pid}/task").glob("*/children"):
        found += map(int, listing.read_text(encoding="ascii").split())
    return found


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and waits to be noted does not."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@dataclass(frozen=True)
class Killed:
    """What one kill and the run after it came to.

    Parameters
    ----------
    after : float
        Time from the start of the command to the kill [s].
    done, begun : int
        Files with a manifest at the kill, and files that were being written.
    again : int
        Files with a manifest at the kill that the next run did again.
    left : int
        Worker processes that outlived the killed one by two seconds.
    resumed : int
        Files that the next run did.
    differing : tuple of str
        Files that are not those of the undisturbed store, byte for byte.
    """

    after: float
    done: int
    begun: int
    again: int
    left: int
    resumed: int
    differing: tuple[str, ...]


def kill_and_resume(
    recordings: Path, store: Path, whole: dict[str, bytes], moment: int, *more: str, delay: float = 0.0
) -> Killed:
    """Start the command, kill it with -9 at a moment, run it again to its end, and compare.

    Parameters
    ----------
    recordings, store : Path
        What to ingest, and a place for the store.
    whole : dict
        Files of the undisturbed store.
    moment : int
        It is killed once so many files are finished.
    *more : str
        Options of the command.
    delay : float
        Time from there to the kill [s].
    """
    process = command(recordings, store, *more)
    start = time.monotonic()
    while len(finished(store)) < moment or not (store / "sources").is_dir():
        if process.poll() is not None or time.monotonic() - start > LONGEST_S:
            break
        time.sleep(0.001)
    time.sleep(delay)
    after = time.monotonic() - start
    workers = children(process.pid)
    process.send_signal(signal.SIGKILL)
    process.wait()
    patience = time.monotonic() + 2.0
    while any(map(alive, workers)) and time.monotonic() < patience:
        time.sleep(0.01)
    orphans = [number for number in workers if alive(number)]
    for number in orphans:
        with suppress(ProcessLookupError):
            os.kill(number, signal.SIGKILL)
    for pipe in (process.stdout, process.stderr):
        if pipe is not None:
            pipe.close()
    before = finished(store)
    under_way = begun(store, before)
    told = finish(command(recordings, store, *more))
    later = finished(store)
    again = sum(later.get(name) != mark for name, mark in before.items())
    now = contents(store)
    differing = tuple(sorted(name for name in now.keys() | whole.keys() if now.get(name) != whole.get(name)))
    return Killed(after, len(before), under_way, again, len(orphans), told["ingested"], differing)


def main() -> int:
    """Print a row for each kill; the exit code says whether any of them left a trace."""
    parser = argparse.ArgumentParser(prog="pmgw bench kill", description=__doc__)
    parser.add_argument("recordings", nargs="?", type=Path, default=EXAMPLE)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=20260501)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    out = sys.stdout.write
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        start = time.monotonic()
        finish(command(given.recordings, Path(folder, "whole")))
        length = time.monotonic() - start
        whole = contents(Path(folder, "whole"))
        files = len(finished(Path(folder, "whole")))
        out(f"{files} files, undisturbed in {length:.1f} s. Killed after a random number of finished files and up to ")
        out(f"{1e3 * LATEST_S:g} ms more; every other time with --workers 2\n\n")
        heads = ("kill at [s]", "finished", "begun", "done again", "workers left", "done after", "other bytes")
        out("".join(f"{head:>13}" for head in heads) + "\n")
        for number in range(given.kills):
            moment, delay = int(rng.integers(files)), rng.uniform(0.0, LATEST_S)
            more = ("--workers", "2") if number % 2 else ("--workers", "1")
            found = kill_and_resume(given.recordings, Path(folder, f"{number}"), whole, moment, *more, delay=delay)
            counts = found.done, found.begun, found.again, found.left, found.resumed, len(found.differing)
            row = (f"{found.after:.2f}", *counts)
            out("".join(f"{cell!s:>13}" for cell in row) + "\n")
            faults += bool(found.differing) or bool(found.again) or bool(found.left)
    out(f"\nkills that left a trace: {faults} of {given.kills}\n")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
