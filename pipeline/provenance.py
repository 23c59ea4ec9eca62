"""Where the result of a stage comes from, left beside it as an RO-Crate."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

from pmg.pipeline.crate import CrateAction, SourceFile, recordings_of, source_file, write_crate
from pmg.pipeline.store import Store

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.sim.grid import Grid

    Clock = Callable[[], datetime]


def now() -> datetime:
    """The time of day [UTC]."""
    return datetime.now(UTC)


def leave_crate(
    folder: Path, store: Path, grid: Grid, command: str, began: datetime, clock: Clock, more: tuple[Path, ...] = ()
) -> Path:
    """Say beside the results of a stage which program made them of which recordings, and when.

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
    """
    recordings: tuple[SourceFile, ...] = ()
    if grid.origin != "published" and any(Store(store).manifests()):
        recordings = recordings_of(store, grid.campaign)
    files = (*recordings, *map(source_file, more))
    title = f"Results of {command} for campaign {grid.campaign}"
    made = f"{len(recordings)} recordings" if recordings else "published grids"
    return write_crate(folder, CrateAction(command, title, f"Made of {made}.", began, clock(), files))
