"""Machines that ship with pmg."""

from __future__ import annotations

from pathlib import Path

from pmg.sim.errors import BenchError, near_miss

FOLDER = Path(__file__).parent / "shipped"
"""Where the files of machines that ship lie."""


def shipped() -> dict[str, Path]:
    """Files of the machines that ship, by their names."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}


def machine_path(name: str) -> Path:
    """The file of a machine: a path, or the name of one that ships.

    Raises
    ------
    BenchError
        It is neither.
    """
    path, known = Path(name), shipped()
    if path.is_file():
        return path
    if name in known:
        return known[name]
    if path.is_dir():
        raise BenchError(f"machine {name}", "a folder", "a machine file", "Name the file itself.")
    expected = f"a machine file, or one of those that ship: {', '.join(known)}"
    raise BenchError(f"--machine {name}", "no such file", expected, near_miss(name, known))
