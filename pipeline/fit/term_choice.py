"""Which terms a loss curve needs: candidates ranked by corrected AIC, among those that predict withheld speeds well."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.loss_fit import ALIKE, relative_weights
from pmg.pipeline.fit.robust import huber_weights
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import FitError
from pmg.sim.losscurve import LossCurve

if TYPE_CHECKING:
    from pmg.pipeline.fit.loss_fit import ShaftDrag
    from pmg.sim.signals import Array, Mask

POWERS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
"""Exponents that are tried."""

NEEDED = (0.0, 0.5, 1.0)
"""A candidate holds one of these: drag that rises from rest no faster than in proportion to speed."""

MOST_TERMS = 5
"""Terms of the largest candidate."""

MINIMUM_LEVELS = 4
"""Speeds needed before one can be withheld and the rest still say something about it."""

EXACT = 1e-9
"""Residual, as part of the largest drag, below which a fit counts as exact and fewer terms win."""


@dataclass(frozen=True)
class TermRank:
    r"""One candidate.

    Parameters
    ----------
    powers : tuple of float
        Its exponents.
    aicc : float
        Corrected Akaike criterion.
    weight : float
        Akaike weight among all candidates, :math:`e^{-\Delta/2}` normalised.
    cv_rmse, cv_se : float
        Root mean square error at withheld speeds [N m] and its standard error over the withheld speeds.
    eligible : bool
        Whether that error is within one standard error of the smallest.
    """

    powers: tuple[float, ...]
    aicc: float
    weight: float
    cv_rmse: float
    cv_se: float
    eligible: bool


@dataclass(frozen=True)
class TermChoice:
    """Candidates of one shaft, the chosen one first, then by AICc.

    Parameters
    ----------
    shaft : str
        ``sun`` or ``ring``.
    ranking : tuple of TermRank
        Eligible candidates before the others, each by rising AICc.
    levels : int
        Speeds that were withheld in turn.
    """

    shaft: str
    ranking: tuple[TermRank, ...]
    levels: int

    @property
    def powers(self) -> tuple[float, ...]:
        """The chosen exponents."""
        return self.ranking[0].powers


def _candidates() -> tuple[tuple[float, ...], ...]:
    """All sets of 1 to 5 exponents out of `POWERS` that hold 0, 1/2 or 1."""
    sets = (chosen for size in range(1, MOST_TERMS + 1) for chosen in combinations(POWERS, size))
    return tuple(chosen for chosen in sets if set(chosen) & set(NEEDED))


def _withheld(basis: Array, residuals: Array, blocks: list[Mask]) -> Array | None:
    """Mean squared error of each block when it is withheld; None where the rest does not determine the curve."""
    errors = []
    for rows in blocks:
        q = basis[rows]
        left = np.eye(len(q)) - q @ q.T
        values, vectors = np.linalg.eigh(left)
        if values[0] < 1e-10:
            return None
        errors.append(float(np.mean((vectors @ ((vectors.T @ residuals[rows]) / values)) ** 2)))
    return np.array(errors)


def choose_terms(reading: ShaftDrag, weights: Array | None = None, *, robust: bool = False) -> TermChoice:
    r"""Terms of one shaft's loss curve.

    Parameters
    ----------
    reading : ShaftDrag
        Drag readings of the shaft.
    weights : (n,) array, optional
        Relative weights of the rows of the grid.
    robust : bool
        Weigh the readings by Huber's weights about the curve of the five terms 0, 1/2, 1, 2, 3 first, for all
        candidates alike.

    Raises
    ------
    FitError
        Fewer than four speeds.

    Notes
    -----
    One level of the shaft's own speed (a row or column of the grid) is withheld at a time and predicted from the rest.
    For least squares with hat matrix H the errors of a withheld block are :math:`(I - H_{BB})^{-1} r_B`. The mean
    squared errors of the levels, weighted by their points, give the error and its standard error. Among the candidates
    whose error is within one standard error of the smallest (L. Breiman et al., 'Classification and Regression Trees',
    1984, section 3.4.3), the smallest AICc wins (Burnham and Anderson 2002, section 2.4): AICc alone takes the points
    of one speed for independent evidence about the curve's shape, and the withheld speeds keep watch over it.
    """
    rows = reading.rows
    n = int(rows.sum())
    levels = reading.levels[rows]
    names = np.unique(levels)
    if len(names) < MINIMUM_LEVELS:
        raise FitError(
            f"terms of the {reading.shaft}'s loss curve",
            f"{counted(n, 'neutral point')} at {counted(len(names), 'speed')}",
            f"at least {MINIMUM_LEVELS} speeds, of which one is withheld at a time",
            "Measure more speeds, or name the terms by --terms-sun and --terms-ring.",
        )
    speed, drag = reading.speed[rows], reading.drag[rows]
    weight = relative_weights(weights, rows)

    def terms(powers: tuple[float, ...]) -> Array:
        limit = float(np.abs(speed).max())
        return LossCurve(powers, np.zeros(len(powers)), reading.reference, limit).terms(speed)

    if robust:
        richest = tuple(p for p in (0.0, 0.5, 1.0, 2.0, 3.0)[: max(len(names) - 2, 1)])
        factors, _ = huber_weights(terms(richest), drag, weight)
        weight = weight * factors
        weight = weight / np.exp(np.mean(np.log(weight)))
    root = np.sqrt(weight)
    target = drag * root
    blocks = [np.asarray(levels == name) for name in names]
    sizes = np.array([block.sum() for block in blocks], dtype=np.float64)
    floor = n * (EXACT * float(np.abs(target).max(initial=1e-300))) ** 2
    found: list[tuple[tuple[float, ...], float, float, float]] = []
    for powers in _candidates():
        k = len(powers)
        if k >= len(names) or n <= k + 2:
            continue
        design = terms(powers) * root[:, None]
        basis, singular, _ = np.linalg.svd(design / np.linalg.norm(design, axis=0), full_matrices=False)
        if singular[-1] < ALIKE * singular[0]:
            continue
        residuals = target - basis @ (basis.T @ target)
        squares = _withheld(basis, residuals, blocks)
        if squares is None:
            continue
        rss = max(float(residuals @ residuals), floor)
        aicc = n * math.log(rss / n) + 2.0 * (k + 1) + 2.0 * (k + 1) * (k + 2) / (n - k - 2)
        mean = float(sizes @ squares / n)
        f = len(sizes)
        spread = math.sqrt(float(np.sum((sizes * (squares - mean)) ** 2)) * f / (f - 1)) / n
        rmse = math.sqrt(max(mean, floor / n))
        found.append((powers, aicc, rmse, spread / (2.0 * rmse)))
    best = min(found, key=lambda item: item[2])
    least = min(aicc for _, aicc, _, _ in found)
    total = sum(math.exp(-0.5 * (aicc - least)) for _, aicc, _, _ in found)
    ranks = [
        TermRank(powers, aicc, math.exp(-0.5 * (aicc - least)) / total, rmse, se, rmse <= best[2] + best[3])
        for powers, aicc, rmse, se in found
    ]
    ranks.sort(key=lambda rank: (not rank.eligible, rank.aicc, len(rank.powers)))
    return TermChoice(reading.shaft, tuple(ranks), len(names))
