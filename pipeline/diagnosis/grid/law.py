"""The law that readings show of a mechanism: the power with which it goes, against that of the library's form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from pmg.pipeline.diagnosis.grid.free_form import law_parts
from pmg.pipeline.diagnosis.grid.refit import spread_of
from pmg.sim.mechanisms.base import LawCovariate

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, GridProblem
    from pmg.sim.signals import Array

MOST = 3.0
"""Power beyond that of the library's form at which the search ends."""

INSIDE = 0.99
"""Part of that up to which a power counts as found: a search stays a little inside its bounds."""


@dataclass(frozen=True)
class LawPower:
    """Power of one quantity with which the effect of a mechanism must be multiplied to fit best.

    Parameters
    ----------
    identifier : str
        Id of the mechanism.
    shaft : str
        Shaft on which it acts so.
    along : LawCovariate
        The quantity.
    more : float
        Power beyond that of the library's form.
    standard_error : float
        Of it.
    """

    identifier: str
    shaft: str
    along: LawCovariate
    more: float
    standard_error: float


def law_powers(problem: GridProblem, fit: CandidateFit) -> tuple[LawPower, ...]:
    r"""Powers by which the law of a fitted mechanism differs from the library's form; none that is not determined.

    Parameters
    ----------
    problem : GridProblem
        The readings, with the baseline free.
    fit : CandidateFit
        The mechanism in the library's form.

    Notes
    -----
    On each shaft the effect becomes :math:`s\,e \prod_j x_j^{\kappa_j}` with its covariates :math:`x_j` over their
    largest value, all :math:`s` and :math:`\kappa` by nonlinear least squares beside the baseline. Standard errors are
    widened as those of the refit where more is left than noise.
    """
    parts = [part for part in law_parts(problem, fit) if LawCovariate.TIME not in part.covariates]
    free = [[name for name in part.covariates if part.varies(name)] for part in parts]
    if not any(free):
        return ()
    logarithms = [
        np.stack([part.logarithm(name) for name in own], axis=1) for part, own in zip(parts, free, strict=True)
    ]
    cuts = np.cumsum([1 + len(own) for own in free])
    start = np.zeros(cuts[-1])
    start[np.r_[0, cuts[:-1]]] = 1.0

    def residuals(values: Array) -> Array:
        split = zip(parts, logarithms, np.split(values, cuts[:-1]), strict=True)
        effect = np.sum([own[0] * part.effect * np.exp(x @ own[1:]) for part, x, own in split], axis=0)
        return problem.left - problem.beyond_baseline(effect)

    limit = np.where(start == 1.0, np.inf, MOST)
    found = least_squares(residuals, start, bounds=(-limit, limit), xtol=1e-10, ftol=1e-12)
    spare = max(len(problem.left) - problem.baseline.shape[1] - len(start), 1)
    errors = math.sqrt(max(1.0, 2.0 * found.cost / spare)) * spread_of(np.asarray(found.jac))
    powers, first = [], 0
    for part, own in zip(parts, free, strict=True):
        for i, name in enumerate(own, start=first + 1):
            if np.isfinite(errors[i]) and abs(found.x[i]) < INSIDE * MOST:
                powers.append(LawPower(fit.identifier, part.shaft, name, float(found.x[i]), float(errors[i])))
        first += 1 + len(own)
    return tuple(powers)
