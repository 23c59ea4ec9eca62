"""The published figures judged and the published run under each choice: computed once for a command and its report."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.thesis_figures.rounding import DRAWS, ROUNDING_SEED
from pmg.pipeline.thesis_figures.transient import transient_options
from pmg.pipeline.thesis_figures.verdict import validate

if TYPE_CHECKING:
    from pmg.pipeline.thesis_figures.transient import TransientResult
    from pmg.pipeline.thesis_figures.verdict import JudgedFigure
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid, OperatingPoints


@dataclass(frozen=True)
class ComparedFigures:
    """The published figures next to what the published grid gives.

    Parameters
    ----------
    judged : tuple of JudgedFigure
        Each figure with its interval and verdict.
    runs : tuple of TransientResult
        The run in time under each choice that the source leaves open.
    draws, seed : int
        Draws within the rounding of the tables, and their seed.
    """

    judged: tuple[JudgedFigure, ...]
    runs: tuple[TransientResult, ...]
    draws: int
    seed: int


@dataclass(frozen=True)
class _Asked:
    """What the figures follow from; the grid counts by its contents."""

    contents: tuple[bytes | float | str, ...]
    bench: BenchParameters
    draws: int
    seed: int
    grid: Grid = field(compare=False, repr=False)


def compared_figures(
    grid: Grid, bench: BenchParameters, draws: int = DRAWS, seed: int = ROUNDING_SEED
) -> ComparedFigures:
    """Every published figure and the published run, from the published grid; the last answer is kept in memory.

    Parameters
    ----------
    grid : Grid
        The published grid.
    bench : BenchParameters
        Numbers of the bench.
    draws, seed : int
        Draws within the rounding of the tables, and their seed.

    Raises
    ------
    GridError
        The grid is not the thesis's.
    FitError
        Too few draws.
    """
    return _compared(_Asked(_contents(grid) + _contents(grid.points), bench, draws, seed, grid))


@lru_cache(maxsize=1)
def _compared(asked: _Asked) -> ComparedFigures:
    judged = validate(asked.grid, asked.bench, asked.draws, np.random.default_rng(asked.seed))
    runs = transient_options(asked.grid, asked.bench, judged, np.random.default_rng(asked.seed))
    return ComparedFigures(judged, runs, asked.draws, asked.seed)


def _contents(table: Grid | OperatingPoints) -> tuple[bytes | float | str, ...]:
    """Columns as bytes, and what is one number or word."""
    values = (getattr(table, each.name) for each in fields(table))
    return tuple(
        value.tobytes() if isinstance(value, np.ndarray) else value
        for value in values
        if isinstance(value, np.ndarray | float | str)
    )
