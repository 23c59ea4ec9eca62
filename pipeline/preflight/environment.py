"""Whether this machine can do the work: packages and their versions, extras, room and rights for the store."""

from __future__ import annotations

import os
import re
import shutil
import sys
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

DISTRIBUTION = "pmg-bench"
OK, MIND, BAD = "ok", "mind", "bad"

EXTRAS = {
    "tdms": ("nptdms", "import of TDMS"),
    "mf4": ("asammdf", "import of MF4"),
    "hdf5": ("h5py", "import of HDF5 and of MAT 7.3"),
    "dask": ("distributed", "--scheduler"),
}
"""Extras: what they install, and what it is for."""

GROWTH = 2.0
"""Bytes of a store for each byte of recordings, reckoned high: 1.6 were found at 500 S/s and 1.0 at 10 kS/s."""

SPARE = 100e6
"""Room for analysis and report [bytes]."""


@dataclass(frozen=True)
class Check:
    """One property of the machine.

    Parameters
    ----------
    what : str
        Its name.
    state : str
        ``ok``, ``mind`` (something will not be possible) or ``bad`` (nothing will be).
    description : str
        What was found.
    """

    what: str
    state: str
    description: str


def environment(store: Path | None, size: int) -> tuple[Check, ...]:
    """This machine.

    Parameters
    ----------
    store : Path, optional
        Where the store is, or would be; the working folder is looked at where it is not named.
    size : int
        Bytes of the recordings that are not in it.
    """
    try:
        needed = requires(DISTRIBUTION) or []
        packages = _packages(needed)
    except PackageNotFoundError:
        packages = Check("packages", MIND, f"{DISTRIBUTION} is not installed: the versions it asks for are not known")
    python = ".".join(map(str, sys.version_info[:3]))
    checks = [Check("python", OK, python), packages, *_extras()]
    return (*checks, *_room(Path(), size, MIND)) if store is None else (*checks, *_room(store, size, BAD))


def _packages(needed: Iterable[str]) -> Check:
    """Installed versions against the ranges that pmg asks for."""
    wrong, count = [], 0
    for requirement in needed:
        name, _, rest = requirement.partition(";")
        if "extra" in rest:
            continue
        count += 1
        found = re.match(r"[A-Za-z0-9._-]+", name)
        assert found is not None  # the form of a requirement
        asked = name[found.end() :].strip()
        try:
            came = version(found[0])
        except PackageNotFoundError:
            wrong.append(f"{found[0]} is missing, {asked} is asked for")
            continue
        if not _within(came, asked):
            wrong.append(f"{found[0]} {came}, {asked} is asked for")
    text = "; ".join(wrong) or f"{count} packages in the ranges asked for"
    return Check("packages", BAD if any("missing" in w for w in wrong) else MIND if wrong else OK, text)


def _within(came: str, asked: str) -> bool:
    """Whether a version lies in a range such as ``<3,>=2.1``; of a version, only the numbers count."""
    tests = {
        "<": lambda a, b: a < b,
        "<=": lambda a, b: a <= b,
        ">": lambda a, b: a > b,
        ">=": lambda a, b: a >= b,
        "==": lambda a, b: a == b,
    }
    for part in filter(None, asked.replace(" ", "").split(",")):
        form = re.fullmatch(r"(<=|>=|==|<|>)([0-9.]+)", part)
        if form is None:
            continue
        one, other = _numbers(came), _numbers(form[2])
        length = max(len(one), len(other))
        one, other = (n + (0,) * (length - len(n)) for n in (one, other))
        if not tests[form[1]](one, other):
            return False
    return True


def _numbers(text: str) -> tuple[int, ...]:
    release = re.match(r"[0-9]+(\.[0-9]+)*", text)
    return tuple(map(int, release[0].split("."))) if release else ()


def _extras() -> Iterator[Check]:
    for extra, (name, use) in EXTRAS.items():
        try:
            yield Check(f"extra {extra}", OK, f"{name} {version(name)}: {use}")
        except PackageNotFoundError:
            install = f"pip install '{DISTRIBUTION}[{extra}]'"
            yield Check(f"extra {extra}", OK, f"not installed; {use} asks for {install}")


def _room(store: Path, size: int, otherwise: str) -> Iterator[Check]:
    """Rights and room where the store is, or at the nearest folder above it that is there."""
    there = next((place for place in (store.absolute(), *store.absolute().parents) if place.exists()), None)
    if there is None or not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        yield Check("store", otherwise, f"{there or store}: not a folder that can be written")
        return
    yield Check("store", OK, f"{there if otherwise == MIND else store} can be written")
    free, need = shutil.disk_usage(there).free, GROWTH * size + SPARE
    text = f"{free / 1e9:.1f} GB free, at most {need / 1e9:.1f} GB needed"
    yield Check("disk", OK if free >= need else otherwise, text)
