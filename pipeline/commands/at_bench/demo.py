"""The stage behind ``pmg demo``: the recordings that ship with pmg, run from decoding to the report."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from pmg.pipeline.commands.compare import run_all
from pmg.pipeline.settings.chosen import choose
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from pmg.pipeline.commands.outcome import Outcome
    from pmg.pipeline.files.progress import Progress

EXAMPLE = "pmg.example"
"""Package that holds the recordings."""
NOTE = "Synthetic recordings, written by a bench generator: no measurement of a real bench"


def run_demo(store: Path, report: Path, progress: Progress | None = None) -> Outcome:
    """Run the example.

    Parameters
    ----------
    store, report : Path
        Folders of the decoded runs, and of the report.
    progress : callable, optional
        Told (done, total, name) of each step.

    Raises
    ------
    PmgError
        The example is not installed, or a folder cannot be used.
    """
    return run_all(choose(None, recordings=_example_folder(), store=store, report=report, note=NOTE), progress)


def _example_folder() -> Path:
    """Folder of the example's recordings.

    Raises
    ------
    RecordingError
        It was not installed.
    """
    try:
        (folder,) = import_module(EXAMPLE).__path__
    except ModuleNotFoundError:
        do = "Install pmg anew: its wheel holds them."
        raise RecordingError(EXAMPLE, "not installed", "the recordings of the example", do) from None
    return Path(folder)
