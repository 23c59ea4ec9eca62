"""Where the result of a stage comes from, left next to it as an RO-Crate."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

from pmg.pipeline.commands.crate import CrateAction, SourceFile, recordings_of, source_file, write_crate
from pmg.pipeline.store.store import Store

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.sim.grid import Grid

    Clock = Callable[[], datetime]


MANY = 6
"""Files from which on they are counted instead of named."""


def now() -> datetime:
    """The time of day [UTC]."""
    return datetime.now(UTC)


def leave_crate(
    folder: Path,
    store: Path,
    grid: Grid,
    command: str,
    began: datetime,
    clock: Clock,
    more: tuple[Path, ...] = (),
    results: tuple[Path, ...] | None = None,
) -> Path:
    """Say next to the results of a stage which program made them of which recordings, and when.

    Parameters
    ----------
    folder : Path
        Holds the results.
    store : Path
        Holds the recordings' manifests; those of the grid's campaign went in.
    grid : Grid
        What the results are about.
    command : str
        Such as ``pmg compare``.
    began : datetime
        When the stage began.
    clock : callable
        Time of day, asked once more for the end.
    more : tuple of Path
        Further files that went in.
    results : tuple of Path, optional
        The files that came out; all that are in the folder when not given.
    """
    recordings = went_in(store, grid)
    files = (*recordings, *map(source_file, more))
    title = f"Results of {command} for campaign {grid.campaign}"
    action = CrateAction(command, title, f"Made of {_made(recordings)}.", began, clock(), files, results)
    return write_crate(folder, action)


def leave_crate_of_two(
    results: tuple[Path, ...],
    sides: tuple[tuple[Path, Grid], tuple[Path, Grid]],
    command: str,
    began: datetime,
    clock: Clock,
) -> Path:
    """Say the same of results about two campaigns.

    Parameters
    ----------
    results : tuple of Path
        The files that came out, the page first; the crate is left next to it.
    sides : tuple of two (store, grid)
        Where each campaign is from.
    command : str
        Such as ``pmg report``.
    began : datetime
        When the stage began.
    clock : callable
        Time of day, asked once more for the end.
    """
    recordings = [went_in(*side) for side in sides]
    names = " and ".join(grid.campaign for _, grid in sides)
    made = "; ".join(f"{label}: {_made(own)}" for label, own in zip("AB", recordings, strict=True))
    files = tuple(file for own in recordings for file in own)
    title = f"Results of {command} for campaigns {names}"
    action = CrateAction(command, title, f"Made of {made}.", began, clock(), files, results)
    return write_crate(results[0].parent, action)


def leave_crate_of_files(
    folder: Path,
    command: str,
    taken: tuple[Path | SourceFile, ...],
    results: tuple[Path, ...],
    began: datetime,
    clock: Clock = now,
) -> Path:
    """Say the same of results that were made of files alone, such as a scenario.

    Parameters
    ----------
    folder : Path
        Holds the results.
    command : str
        Such as ``pmg simulate``.
    taken : tuple of Path or SourceFile
        What went in: files that are there, or recordings as a store knows them.
    results : tuple of Path
        What came out.
    began : datetime
        When the stage began.
    clock : callable
        Time of day, asked once more for the end.
    """
    files = tuple(each if isinstance(each, SourceFile) else source_file(each) for each in taken)
    made = ", ".join(file.name for file in files) if len(files) < MANY else f"{len(files)} files"
    action = CrateAction(command, f"Results of {command}", f"Made of {made}.", began, clock(), files, results)
    return write_crate(folder, action)


def went_in(store: Path | None, grid: Grid) -> tuple[SourceFile, ...]:
    """The recordings that a grid was made of; none for published grids."""
    if store is None or grid.origin == "published" or not any(Store(store).manifests()):
        return ()
    return recordings_of(store, grid.campaign)


def _made(recordings: tuple[SourceFile, ...]) -> str:
    return f"{len(recordings)} recordings" if recordings else "published grids"
