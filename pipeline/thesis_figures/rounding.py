"""Shifts of each figure by the rounding of the thesis's tables: tables drawn anew within their last digit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.tables import ROUNDING_PUBLISHED
from pmg.pipeline.thesis_figures.replicate import THESIS, Choices, replicate
from pmg.pipeline.thesis_figures.tables import ROUNDING_FINE, Sample
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters

ROUNDING_SEED = 20260101
"""Seed where none is chosen."""

DRAWS = 500
"""Draws where no number is chosen."""

DRAWS_IN_REPORT = 100
"""Draws of the chapter that goes with the report of the published grids."""

FEWEST_DRAWS = 20
"""Below this the outer 2.5 % hold not one draw."""

OUTER = (0.025, 0.975)
"""Quantiles of the draws."""


@dataclass(frozen=True)
class RoundingSpread:
    """A figure from the rounded tables, and where draws within their rounding take it, in SI.

    Parameters
    ----------
    ours : float
        From the tables as printed.
    low, high : float
        The 2.5 and 97.5 % quantiles of the draws.
    """

    ours: float
    low: float
    high: float

    @property
    def shift(self) -> float:
        """Shift of the figure by rounding, to either side: the larger distance of the two quantiles.

        Notes
        -----
        The tables were rounded once and are blurred once more by a draw. Where that moves a figure one way only, as
        a scatter, which grows each time, the figure before the rounding lies as far on the other side of ours as the
        draws lie on this one. The interval is the same to both sides for that reason.
        """
        return max(self.ours - self.low, self.high - self.ours, 0.0)


def _draw(sample: Sample, rng: np.random.Generator) -> Sample:
    """Tables that would be printed as these are: every torque even within half a unit of its last digit."""
    coarse, fine = 0.5 * ROUNDING_PUBLISHED, 0.5 * ROUNDING_FINE
    grid = sample.grid
    torque_ring = grid.torque_ring + rng.uniform(-coarse, coarse, len(grid))
    return replace(
        sample,
        grid=replace(
            grid,
            torque_sun=grid.torque_sun + rng.uniform(-coarse, coarse, len(grid)),
            torque_ring=torque_ring,
            points=replace(grid.points, torque_ring=torque_ring),
        ),
        ring=sample.ring + rng.uniform(-fine, fine, sample.ring.shape),
        sun=sample.sun + rng.uniform(-fine, fine, sample.sun.shape),
    )


def spreads(
    sample: Sample, bench: BenchParameters, draws: int, rng: np.random.Generator, choices: Choices = THESIS
) -> dict[str, RoundingSpread]:
    """Every figure by id, with its spread over draws.

    Parameters
    ----------
    sample : Sample
        The tables as printed.
    bench : BenchParameters
        Numbers of the bench.
    draws : int
        How often the whole replication is made.
    rng : Generator
        Source of the draws.

    Raises
    ------
    FitError
        Too few draws.
    """
    if draws < FEWEST_DRAWS:
        raise FitError("draws", str(draws), f"{FEWEST_DRAWS} or more", "Ask for more draws with --draws.")
    ours = replicate(sample, bench, choices)
    drawn = [replicate(_draw(sample, rng), bench, choices) for _ in range(draws)]
    found = {}
    for id_, value in ours.items():
        low, high = np.quantile([figures[id_] for figures in drawn], OUTER)
        found[id_] = RoundingSpread(value, float(low), float(high))
    return found
