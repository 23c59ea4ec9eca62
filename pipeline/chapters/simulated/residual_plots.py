"""How residuals are distributed: against normal quantiles, and within the bands of tolerance and uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from pmg.pipeline.chapters.cells import names_of
from pmg.pipeline.report.document import Chart, Figure, Series
from pmg.pipeline.wording.probability import COVERAGE_FACTOR
from pmg.sim.signals import RESIDUAL

if TYPE_CHECKING:
    from pmg.pipeline.analysis.comparison import Difference, Residuals
    from pmg.pipeline.analysis.tolerance import Agreements

FEWEST_DRAWN = 3
"""Residuals of a shaft below which their distribution is not drawn."""


def residual_plots(residuals: Residuals, agreed: Agreements) -> list[Figure]:
    """Residuals of both torques in bands, point after point, and against normal quantiles; none of too few points."""
    shafts = (("sun", residuals.torque_sun), ("ring", residuals.torque_ring))
    drawn = [(side, of) for side, of in shafts if int(of.compared.sum()) >= FEWEST_DRAWN]
    if not drawn:
        return []
    panels = [_bands(residuals, agreed, side, of) for side, of in drawn]
    quantiles = [_quantiles(residuals, side, of, i) for i, (side, of) in enumerate(drawn)]
    ends = np.array([-3.0, 3.0])
    line = Series("as the stated u", ends, ends, None, "line", 7)
    panels.append(Chart("normal quantile", "residual / u", (line, *quantiles), title="against normal quantiles"))
    spreads = ", ".join(f"{float(np.std(series.y)):.2f} ({series.name})" for series in quantiles)
    caption = (
        "Torque residuals in the order of the points with the tolerance band and U = 2u, and their quantiles. Where u "
        f"is right and nothing is missing they follow the line; their standard deviation over u is {spreads}."
    )
    return [Figure("residuals-distributed", "Residuals in their bands", caption, tuple(panels), columns=len(panels))]


def _bands(residuals: Residuals, agreed: Agreements, side: str, of: Difference) -> Chart:
    """Residual of a torque point after point, by time where it is known, over its bands."""
    at = residuals.grid.points
    rows = np.flatnonzero(of.compared)
    if at.ordered:
        rows = rows[np.argsort(at.started_at[rows], kind="stable")]
    x, zero = np.arange(1.0, len(rows) + 1.0), np.zeros(len(rows))
    bound = agreed.of[f"torque_{side}"].bound[rows] / COVERAGE_FACTOR / RESIDUAL.scale
    return Chart(
        "place in the order of the test" if at.ordered else "number of the point",
        RESIDUAL.label,
        (
            Series("tolerance", x, zero, bound, "band", 4),
            Series("U = 2u", x, zero, of.u[rows] / RESIDUAL.scale, "band", 7),
            Series("residual", x, RESIDUAL.display(of.value[rows]), None, "markers", 0, "", names_of(at.name[rows])),
        ),
        references=(("", 0.0),),
        title=f"{side} torque",
    )


def _quantiles(residuals: Residuals, side: str, of: Difference, colour: int) -> Series:
    """Residuals over u, rising, against the quantiles of as many normal numbers (at (k - 0.5)/n)."""
    rows = np.flatnonzero(of.compared & (of.u > 0.0))
    score = of.value[rows] / of.u[rows]
    order = np.argsort(score, kind="stable")
    expected = ndtri((np.arange(len(rows)) + 0.5) / max(len(rows), 1))
    return Series(
        side, expected, score[order], None, "markers", colour, "", names_of(residuals.grid.points.name[rows[order]])
    )
