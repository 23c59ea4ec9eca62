"""Shifts of each figure by the rounding of the thesis's tables: tables drawn anew within their last digit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pmg.pipeline.grid.tables import ROUNDING_FINE, ROUNDING_PUBLISHED
from pmg.pipeline.thesis_figures.replicate import THESIS, Choices, replicate
from pmg.pipeline.thesis_figures.tables import Sample, with_ring_torque
from pmg.sim.errors import FitError, UnsettledFitError, UnsettledRunError
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

ROUNDING_SEED = 20260101
"""Seed where none is chosen."""

DRAWS = 500
"""Draws where no number is chosen, by the command and in the report of the published grids."""

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
    failed : int
        Draws that gave no figures, as a fit or a run did not settle.
    """

    ours: float
    low: float
    high: float
    failed: int = 0

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


def _shared_errors(own: Array, torque: Array) -> npt.NDArray[np.intp]:
    """Number of the rounding error behind each printed torque (n,), from 0.

    Parameters
    ----------
    own : (n,) array
        Speed of the shaft that the torque is of [rad/s].
    torque : (n,) array
        As printed [N m].

    Notes
    -----
    Where all readings of a shaft at one of its speeds print the same value, they scatter by less than the step, and
    what rounding takes from one it takes from all: they share one error. In every other row the values step, and each
    reading has an error of its own. On synthetic tables whose rows drift by up to a step and hardly scatter, 95 %
    intervals drawn like this hold the unrounded curve in 93 to 98 %; with errors that are all independent in 73 to
    91 %.
    """
    number = np.arange(len(torque))
    for speed in np.unique(own):
        row = np.flatnonzero(own == speed)
        if len(row) > 1 and len(np.unique(torque[row])) == 1:
            number[row] = row[0]
    return np.unique(number, return_inverse=True)[1]


def _draw(sample: Sample, rng: np.random.Generator) -> Sample:
    """Tables that would be printed as these are: every torque even within half a unit of its last digit."""
    grid, neutral = sample.grid, sample.grid.points.neutral
    coarse, fine = 0.5 * ROUNDING_PUBLISHED, 0.5 * ROUNDING_FINE
    drawn = []
    for side in SIDES:
        torque = grid.torque[side]
        error = rng.uniform(-coarse, coarse, len(grid))
        shared = _shared_errors(grid.points.speed[side][neutral], torque[neutral])
        error[neutral] = rng.uniform(-coarse, coarse, len(grid))[shared]
        drawn.append(torque + error)
    drawn[1][sample.rows] = sample.ring + rng.uniform(-fine, fine, sample.rows.shape)
    return replace(
        sample,
        grid=with_ring_torque(replace(grid, torque_sun=drawn[0]), np.arange(len(grid)), drawn[1]),
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
        Too few draws, or too few that settle.
    """
    if draws < FEWEST_DRAWS:
        raise FitError("draws", str(draws), f"{FEWEST_DRAWS} or more", "Ask for more draws with --draws.")
    ours = replicate(sample, bench, choices)
    drawn, failed = list[dict[str, float]](), 0
    for _ in range(draws):
        try:
            drawn.append(replicate(_draw(sample, rng), bench, choices))
        except (UnsettledFitError, UnsettledRunError):
            failed += 1
    if len(drawn) < FEWEST_DRAWS:
        came = f"{failed} of {draws} that did not settle"
        raise FitError("draws", came, f"{FEWEST_DRAWS} or more that do", "Ask for more draws with --draws.")
    found = {}
    for id_, value in ours.items():
        low, high = np.quantile([figures[id_] for figures in drawn], OUTER)
        found[id_] = RoundingSpread(value, float(low), float(high), failed)
    return found
