"""Faults of the file system: what is no file, names, rights, full disks, closed streams, files in motion."""

from __future__ import annotations

import os
import shutil
import socket
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Thread

from tests.grid.checked_campaign import NEUTRAL

from .case import ANALYSE, BOTH, INGEST, Call, Case, Desk, Setup

FULL = "/dev/full"


def _beside(make: Callable[[Path], object]) -> Setup:
    """Something that is called like a recording, beside the others."""
    return lambda desk: make(desk.recordings / "b.mcap")


def _socket(path: Path) -> None:
    """A socket; its path is short from within its folder."""
    here = os.open(path.parent, os.O_RDONLY)
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(f"/proc/self/fd/{here}/{path.name}")
    os.close(here)


def _named(name: bytes) -> Setup:
    def spoil(desk: Desk) -> None:
        (desk.recordings / NEUTRAL).rename(desk.recordings / f"{os.fsdecode(name)}.mcap")

    return spoil


def _rights(mode: int, *parts: str) -> Setup:
    def spoil(desk: Desk) -> None:
        for part in parts:
            (desk.place / part).chmod(mode)

    return spoil


def _emptied(desk: Desk) -> None:
    for path in desk.recordings.iterdir():
        path.unlink()


def _more(desk: Desk) -> None:
    """A recording that the store does not hold yet."""
    data = (desk.recordings / NEUTRAL).read_bytes()
    (desk.recordings / "new.mcap").write_bytes(data + b"behind the end")


def _less(desk: Desk) -> None:
    (desk.recordings / "new.mcap").unlink()


def _while(change: Callable[[Path, int], object], seconds: float = 2.5) -> Setup:
    """Something done to a recording every 20 ms while the command runs."""

    def again(path: Path) -> None:
        end = time.monotonic() + seconds
        number = 0
        while time.monotonic() < end and path.parent.is_dir():
            change(path, number)
            number += 1
            time.sleep(0.02)

    return lambda desk: Thread(target=again, args=(desk.recordings / NEUTRAL,), daemon=True).start()


def _grow(path: Path, number: int) -> None:
    with path.open("ab") as stream:
        stream.write(bytes([number % 256]) * 100)


def _shrink(path: Path, number: int) -> None:
    os.truncate(path, max(path.stat().st_size - 50 * (number > 2), 9_000))


def _replace(path: Path, number: int) -> None:
    other = sorted(path.parent.glob("0*.mcap"))[0]
    aside = path.parent / ".aside"
    shutil.copy(other if number % 2 else path, aside)
    aside.replace(path)


def _store_goes(desk: Desk) -> None:
    def later() -> None:
        for _ in range(200):
            if (desk.store / "runs").is_dir() and any((desk.store / "runs").iterdir()):
                break
            time.sleep(0.01)
        shutil.rmtree(desk.store, ignore_errors=True)

    Thread(target=later, daemon=True).start()


def _under(**how: object) -> tuple[Call, ...]:
    return tuple(replace(call, **how) for call in BOTH)  # type: ignore[arg-type]


def _plain(call: Call) -> Call:
    """Without JSON."""
    return replace(call, words=call.words[:-1])


BESIDE: tuple[tuple[str, Callable[[Path], object]], ...] = (
    ("a pipe called like a recording", os.mkfifo),
    ("a folder called like a recording", lambda path: path.mkdir()),
    ("a link to itself", lambda path: path.symlink_to(path)),
    ("a link to its own folder", lambda path: path.symlink_to(path.parent)),
    ("a link to a device that never ends", lambda path: path.symlink_to("/dev/zero")),
    ("a link to nothing", lambda path: path.symlink_to("gone")),
    ("a socket called like a recording", _socket),
    ("an empty file", lambda path: path.write_bytes(b"")),
    ("a file of a gigabyte of nothing", lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_WRONLY), 2**30)),
)

NAMES: tuple[tuple[str, bytes], ...] = (
    ("a name that is no UTF-8", b"p\xe9ng"),
    ("a name with a line feed", b"a\nb"),
    ("a name that begins like an option", b"--store"),
    ("a name of 255 bytes", b"n" * 250),
    ("a name of quotes and blanks", b'a\' "b" $(c) `d`'),
    ("a name that steers the terminal", b"a\x1b]0;b\x07\xe2\x80\xae"),
    ("a name with marks of the shell", b"*?[a]{b}"),
    ("a name that begins a formula", b"=1+1"),
)


def acts(desk: Desk, ended: object) -> str:
    """Whether a name got into a terminal or a table as it was."""
    from .texts import acting

    return acting(desk, ended)  # type: ignore[arg-type]


CASES = (
    *(Case("file system", what, spoil=_beside(make), small=True) for what, make in BESIDE),
    *(Case("file system", what, spoil=_named(name), small=True) for what, name in NAMES),
    *(
        Case("file system", what, small=True, spoil=spoil, calls=_under(plain=True))
        for what, spoil in (
            ("a recording without rights", _rights(0, f"recordings/{NEUTRAL}")),
            ("a folder of recordings without rights", _rights(0, "recordings")),
            ("a folder that cannot be written to", _rights(0o555, ".")),
        )
    ),
    Case(
        "file system",
        "a store that cannot be written to, analysed",
        small=True,
        first="kept",
        spoil=_rights(0o555, "store", "store/analysis"),
        calls=(replace(ANALYSE, plain=True),),
    ),
    Case(
        "file system",
        "a store that cannot be written to, with a new recording",
        small=True,
        first="kept",
        spoil=_rights(0o555, "store", "store/runs", "store/sources"),
        calls=(replace(INGEST, plain=True, before=_more), replace(ANALYSE, before=_less)),
    ),
    *(
        Case(
            "file system",
            f"disk full after {size} bytes of a file, while {what}",
            small=True,
            first="kept",
            calls=calls,
        )
        for size in (0, 100, 3000)
        for what, calls in (
            ("ingesting", (replace(INGEST, file_size=max(size, 1), before=_more), replace(ANALYSE, before=_less))),
            ("analysing", (replace(ANALYSE, file_size=max(size, 1)),)),
        )
    ),
    Case("file system", "standard output full", small=True, calls=(replace(INGEST, out=FULL), ANALYSE)),
    Case(
        "file system", "standard output full, in words", small=True, calls=(replace(_plain(INGEST), out=FULL), ANALYSE)
    ),
    Case(
        "file system",
        "standard output full while analysing",
        small=True,
        first="kept",
        calls=(replace(ANALYSE, out=FULL),),
    ),
    Case("file system", "standard output closed by its reader", small=True, calls=(replace(INGEST, out="|"), ANALYSE)),
    Case(
        "file system", "standard output closed before it began", small=True, calls=(replace(INGEST, out="-"), ANALYSE)
    ),
    Case("file system", "standard error full", small=True, calls=_under(err=FULL)),
    Case(
        "file system",
        "standard error full, in words, with findings",
        small=True,
        spoil=_beside(os.mkfifo),
        calls=(replace(_plain(INGEST), err=FULL), INGEST, ANALYSE),
    ),
    Case(
        "file system",
        "standard error full and an error",
        small=True,
        calls=(replace(INGEST, words=("ingest", "nowhere", "--store", "store", "--json"), err=FULL), *BOTH),
    ),
    Case("file system", "standard error closed before it began", small=True, calls=_under(err="-")),
    Case("file system", "both streams full", small=True, calls=(replace(INGEST, out=FULL, err=FULL), *BOTH)),
    Case(
        "file system",
        "recording that grows while it is read",
        calls=(replace(INGEST, meanwhile=_while(_grow)), ANALYSE),
    ),
    Case(
        "file system",
        "recording that shrinks while it is read",
        calls=(replace(INGEST, meanwhile=_while(_shrink)), ANALYSE),
    ),
    Case(
        "file system",
        "recording that is replaced while it is read",
        calls=(replace(INGEST, meanwhile=_while(_replace)), *BOTH),
    ),
    Case("file system", "store deleted while it is filled", calls=(replace(INGEST, meanwhile=_store_goes), *BOTH)),
    Case("file system", "store that is a file", small=True, spoil=lambda desk: desk.file("store", "x")),
    Case("file system", "store that is a pipe", small=True, spoil=lambda desk: os.mkfifo(desk.store)),
    Case("file system", "no recordings", small=True, spoil=_emptied),
    Case("file system", "no such folder", small=True, spoil=lambda desk: shutil.rmtree(desk.recordings)),
    Case(
        "file system",
        "a pipe for the one recording",
        small=True,
        spoil=lambda desk: os.mkfifo(desk.place / "p.mcap"),
        calls=(replace(INGEST, words=("ingest", "p.mcap", "--store", "store", "--json")),),
    ),
)
