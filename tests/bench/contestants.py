"""Other ways to ask what a residual holds: PySINDy, a Gaussian process, the best BIC of pmg's own catalogue.

scikit-learn (BSD-3-Clause) is imported where it is used, and only there.
"""

from __future__ import annotations

import math
import time
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.engine.withheld import withhold
from pmg.pipeline.diagnosis.grid.candidates import candidates
from pmg.pipeline.diagnosis.grid.catalogue import MECHANISMS
from pmg.pipeline.diagnosis.grid.fitting import fit_candidate
from pmg.pipeline.diagnosis.grid.withheld import withheld_readings
from tests.bench.bout import BESIDE, GENERIC, PHYSICAL, Answer, Reply
from tests.bench.peers import installed
from tests.bench.sparse import SparseRegression

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Mask
    from tests.bench.bout import Contestant
    from tests.bench.steady_bout import Bout

USUAL_MARGIN = 10.0
"""Difference of BIC that counts as very strong evidence (Kass and Raftery 1995)."""
SHORTEST, LONGEST = 0.05, 1e3
"""Bounds of the lengthscales, in standard deviations of the covariate."""
RESTARTS = 1
"""Further starts of the likelihood's maximisation, on all readings."""
COVARIATES = ("speed_sun", "speed_ring", "load", "time")


@dataclass(frozen=True)
class GaussianProcess:
    """A discrepancy after Kennedy and O'Hagan (2001): a Gaussian process of the residual, a transducer at a time."""

    name: str = "Gaussian process discrepancy"

    def __call__(self, bout: Bout, *, withheld: bool) -> Answer:
        """BIC against white noise, the better of both transducers; the covariate of the shortest lengthscale."""
        began = time.perf_counter()
        x = (bout.covariates - bout.covariates.mean(axis=0)) / np.maximum(bout.covariates.std(axis=0), 1e-12)
        y, effect, evidence, lengths = bout.residual, np.zeros(len(x)), {}, {}
        for shaft, rows in bout.shafts:
            found = fitted_process(x[rows], y[rows], RESTARTS)
            n, free = int(rows.sum()), len(found.kernel_.theta)
            white = -0.5 * n * (math.log(2.0 * math.pi * float(np.mean(y[rows] ** 2))) + 1.0)
            evidence[shaft] = 2.0 * (float(found.log_marginal_likelihood_value_) - white) - (free - 1) * math.log(n)
            lengths[shaft] = found.kernel_.k1.k2.length_scale.tolist()
            effect[rows] = found.predict(x[rows])
        strongest = max(evidence, key=lambda shaft: evidence[shaft])
        seconds = time.perf_counter() - began

        def corrected(train: Mask) -> Array:
            left, out = bout.residual_without(train), np.zeros(len(x))
            for _, rows in bout.shafts:
                out[rows] = fitted_process(x[rows & train], left[rows & train], 0).predict(x[rows])
            return out

        level = evidence[strongest]
        held = bout.held_out(effect, corrected) if withheld and level > -2.0 * USUAL_MARGIN else None
        return Answer(
            level,
            {"BIC": Reply(level > USUAL_MARGIN, None, held)},
            ((level, Reply(True, None, held)),),
            seconds,
            {
                "bic": evidence,
                "lengthscales": lengths,
                "shaft": strongest,
                "covariate": COVARIATES[int(np.argmin(lengths[strongest]))],
            },
        )


def fitted_process(x: Array, y: Array, restarts: int) -> Any:  # noqa: ANN401  (a foreign object)
    """scikit-learn's regressor, squared exponential with one lengthscale a covariate, and white noise."""
    from sklearn.gaussian_process import GaussianProcessRegressor  # type: ignore[import-not-found, unused-ignore]
    from sklearn.gaussian_process.kernels import (  # type: ignore[import-not-found, unused-ignore]
        RBF,
        ConstantKernel,
        WhiteKernel,
    )

    smooth = RBF(np.ones(x.shape[1]), (SHORTEST, LONGEST))
    kernel = ConstantKernel(1.0, (1e-4, 1e4)) * smooth + WhiteKernel(1.0, (1e-2, 1e3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return GaussianProcessRegressor(kernel, n_restarts_optimizer=restarts, random_state=0).fit(x, y)


@dataclass(frozen=True)
class BestOfCatalogue:
    """The mechanism of pmg's catalogue with the best BIC, beside the same free baseline and noise; no further rule."""

    name: str = "best BIC of the catalogue"

    def __call__(self, bout: Bout, *, withheld: bool) -> Answer:
        """Fall of the whitened sum of squares less the parameters' cost; none where nothing pays for itself."""
        began, stage = time.perf_counter(), bout.stage
        cost = math.log(len(stage.left))
        fits = [fit_candidate(stage, candidate) for candidate in candidates()]
        best = max(fits, key=lambda fit: fit.gain - fit.cost * cost)
        level = best.gain - best.cost * cost
        seconds = time.perf_counter() - began
        held = None
        if withheld and level > 0.0:
            proof = withhold(withheld_readings(stage), MECHANISMS, (best,), np.random.default_rng(0))
            held = None if proof is None else proof.rmse_after / proof.noise_floor
        said = (best.candidate.identifier, best.candidate.shaft)
        reply = Reply(True, said, held)
        return Answer(level, {"BIC": Reply(level > 0.0, said, held)}, ((level, reply),), seconds, {})


def contestants() -> tuple[Contestant[Bout], ...]:
    """All whose packages are there."""
    found: list[Contestant[Bout]] = []
    if installed("pysindy"):
        found += [
            SparseRegression(lib, optimizer) for lib in (GENERIC, PHYSICAL, BESIDE) for optimizer in ("STLSQ", "SR3")
        ]
    if installed("sklearn"):
        found.append(GaussianProcess())
    return (*found, BestOfCatalogue())
