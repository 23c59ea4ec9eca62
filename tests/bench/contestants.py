"""Other ways to ask what a residual holds: PySINDy, a Gaussian process, the best BIC of pmg's own catalogue.

PySINDy (MIT) and scikit-learn (BSD-3-Clause) are imported where they are used, and only there.
"""

from __future__ import annotations

import math
import time
import warnings
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnose.candidates import candidates, fit_candidate, signature
from pmg.pipeline.diagnose.withheld import FOLDS, withhold
from tests.bench.bout import TOUCHED, Answer, Reply
from tests.bench.peers import installed

if TYPE_CHECKING:
    from tests.bench.bout import Bout, Contestant
    from pmg.sim.signals import Array, Mask

LEVELS = np.geomspace(0.02, 2.0, 25)
"""Thresholds of the sparse regressions: root mean square of a term's contribution [noise]."""
DEGREE, FREQUENCIES = 2, 2
"""Of PySINDy's polynomial and Fourier libraries."""
RELAX = 1.0
"""SR3's coupling of its sparse to its full coefficients (PySINDy's default)."""
MOST_STEPS = 300
"""Iterations of SR3."""
USUAL_MARGIN = 10.0
"""Difference of BIC that counts as very strong evidence (Kass and Raftery 1995)."""
SHORTEST, LONGEST = 0.05, 1e3
"""Bounds of the lengthscales, in standard deviations of the covariate."""
RESTARTS = 1
"""Further starts of the likelihood's maximisation, on all readings."""
COVARIATES = ("speed_sun", "speed_ring", "load", "time")
GENERIC, PHYSICAL, BESIDE = "polynomials and Fourier", "physical terms", "physical terms, baseline projected out"
ABSORBED = 1e-2
"""Part of a column that the baseline must leave where it is projected out."""


@dataclass(frozen=True)
class Library:
    """Columns to choose from, of unit root mean square, the mechanism of each, and whether they stand beside a baseline
    that stays free; else it is frozen."""

    theta: Array
    owners: tuple[tuple[str, str] | None, ...]
    beside: bool = False

    def columns(self, bout: Bout, train: Mask) -> Array:
        """The columns; where the baseline is projected out, as the training rows determine that."""
        return bout.beside(self.theta, train) if self.beside else self.theta


def generic_library(bout: Bout) -> Library:
    """PySINDy's polynomials and Fourier terms of the four covariates, for each transducer."""
    import pysindy  # type: ignore[import-not-found, unused-ignore]

    low, high = bout.covariates.min(axis=0), bout.covariates.max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    scaled = math.pi * (2.0 * (bout.covariates - low) / span - 1.0)
    library = pysindy.PolynomialLibrary(degree=DEGREE) + pysindy.FourierLibrary(n_frequencies=FREQUENCIES)
    whole = np.asarray(library.fit_transform(scaled))
    theta = np.hstack([whole * rows[:, None] for _, rows in bout.shafts])
    return Library(*_unit(theta, [None] * theta.shape[1]))


def physical_library(bout: Bout, *, beside: bool = False) -> Library:
    """What each mechanism of the catalogue does to each reading, at the typical value of its shape.

    `beside` gives the regression what pmg's diagnosis works with: columns, and residual, less all that the baseline
    can take up.
    """
    columns, owners = [], []
    for candidate in candidates():
        if candidate.shaft == "both" and candidate.kind.both_at_once:
            continue
        shape = np.array([parameter.typical for parameter in candidate.parameters[len(candidate.sizes) :]])
        found = signature(bout.stage, candidate, shape)
        columns.append(found / bout.scale[:, None])
        owners += [(candidate.identifier, candidate.shaft)] * found.shape[1]
    theta, names = _unit(np.hstack(columns), owners)
    if beside:
        left = np.sqrt(np.mean(bout.beside(theta, np.ones(len(theta), dtype=bool)) ** 2, axis=0))
        kept = left > ABSORBED
        theta, names = theta[:, kept] / left[kept], tuple(name for name, keep in zip(names, kept, strict=True) if keep)
    return Library(theta, names, beside)


def _unit(theta: Array, owners: list[Any]) -> tuple[Array, tuple[Any, ...]]:
    size = np.sqrt(np.mean(theta**2, axis=0))
    kept = size > 0.0
    return theta[:, kept] / size[kept], tuple(owner for owner, keep in zip(owners, kept, strict=True) if keep)


def sparse_coefficients(optimizer: str, theta: Array, y: Array, level: float) -> Array:
    """Coefficients by PySINDy's STLSQ or SR3 with that threshold."""
    import pysindy

    root = math.sqrt(len(y))
    import os
    rows = 1.0 / root
    if optimizer == "STLSQ":
        chosen = pysindy.STLSQ(threshold=level)
        if os.environ.get('F_RAW'): rows=1.0
    elif optimizer == "SR3L1":
        chosen = pysindy.SR3(reg_weight_lam=level, regularizer="L1", relax_coeff_nu=RELAX, max_iter=MOST_STEPS)
    else:
        lam = level**2 / (2.0 * RELAX)  # SR3's hard threshold is sqrt(2 lam nu)
        chosen = pysindy.SR3(reg_weight_lam=lam, regularizer="L0", relax_coeff_nu=RELAX, max_iter=MOST_STEPS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = chosen.fit(theta * rows, (y * rows)[:, None])
    return np.asarray(found.coef_, dtype=np.float64).ravel()


@dataclass(frozen=True)
class SparseRegression:
    """PySINDy on the residual: any term that survives is an alarm, the largest contribution is the cause."""

    library: str
    optimizer: str

    @property
    def name(self) -> str:
        """As in the table."""
        return f"PySINDy {self.optimizer}, {self.library}"

    def __call__(self, bout: Bout, *, withheld: bool) -> Answer:
        """Terms at every threshold; the threshold by the least error of four folds, or by one standard error."""
        began = time.perf_counter()
        library = generic_library(bout) if self.library == GENERIC else physical_library(bout, beside=self.library == BESIDE)
        every = np.ones(len(bout.fold), dtype=bool)
        theta, y = library.columns(bout, every), bout.residual_without(every) if library.beside else bout.residual
        all_of_it = np.stack([sparse_coefficients(self.optimizer, theta, y, float(level)) for level in LEVELS])
        errors = {(k,): self._errors(bout, library, (k,)) for k in range(FOLDS)}
        best, frugal = _choose([np.mean(errors[(k,)][:, bout.fold == k] ** 2, axis=1) for k in range(FOLDS)])
        seconds = time.perf_counter() - began
        effects = all_of_it @ theta.T
        alarms = np.any(all_of_it != 0.0, axis=1)
        said = [_largest(library.owners, theta, row) for row in all_of_it]

        def reply(place: int, error: Array | None) -> Reply:
            if not alarms[place]:
                return Reply(alarm=False)
            effect = effects[place]
            touched = np.abs(effect) > TOUCHED * math.sqrt(float(np.mean(effect**2)))
            held = None if error is None else bout.ratio(error, touched & (bout.fold < FOLDS))
            return Reply(True, said[place], held)

        whole: Array | None = None
        chosen: tuple[Array | None, Array | None] = (None, None)
        if withheld:
            whole = np.select([bout.fold == k for k in range(FOLDS)], [errors[(k,)] for k in range(FOLDS)])
            chosen = self._nested(bout, library, errors) if alarms[best] else (None, None)
        return Answer(
            level=float(LEVELS[np.flatnonzero(alarms)[-1]]) if alarms.any() else 0.0,
            settings={"least error": reply(best, chosen[0]), "one standard error": reply(frugal, chosen[1])},
            graded=tuple(
                (float(level), reply(i, None if whole is None else whole[i])) for i, level in enumerate(LEVELS)
            ),
            seconds=seconds,
            remarks={"columns": library.theta.shape[1], "threshold": float(LEVELS[best])},
        )

    def _errors(self, bout: Bout, library: Library, without: tuple[int, ...]) -> Array:
        """Residual less correction at every reading (levels, m), folds left out of baseline and regression."""
        train = ~np.isin(bout.fold, without)
        theta, y = library.columns(bout, train), bout.residual_without(train)
        found = [sparse_coefficients(self.optimizer, theta[train], y[train], float(level)) for level in LEVELS]
        return np.asarray(y - np.stack(found) @ theta.T)

    def _nested(self, bout: Bout, library: Library, errors: dict[tuple[int, ...], Array]) -> tuple[Array, Array]:
        """Errors on withheld folds, the threshold of each chosen among the others, by either rule."""
        pairs = {pair: self._errors(bout, library, pair) for pair in combinations(range(FOLDS), 2)}
        found = np.zeros((2, len(bout.fold)))
        for k in range(FOLDS):
            others = [j for j in range(FOLDS) if j != k]
            inner = [
                np.mean(pairs[(min(j, k), max(j, k))][:, bout.fold == j] ** 2, axis=1) for j in others
            ]
            for rule, place in enumerate(_choose(inner)):
                found[rule, bout.fold == k] = errors[(k,)][place, bout.fold == k]
        return found[0], found[1]


def _choose(errors: list[Array]) -> tuple[int, int]:
    """Place of the level of least error over the folds, and of the highest within one standard error of it."""
    table = np.stack(errors)
    mean = table.mean(axis=0)
    best = len(mean) - 1 - int(np.argmin(mean[::-1]))
    # The error that counts is that of the difference: folds differ from each other far more than levels do.
    spread = (table - table[:, [best]]).std(axis=0, ddof=1) / math.sqrt(len(table))
    return best, int(np.flatnonzero(mean - mean[best] <= spread + 1e-12)[-1])


def _largest(
    names: tuple[tuple[str, str] | None, ...], theta: Array, coefficients: Array
) -> tuple[str, str] | None:
    """Owner of the largest contribution; None where columns have no owner."""
    owners = {owner for owner, c in zip(names, coefficients, strict=True) if c != 0.0 and owner is not None}
    if not owners:
        return None

    def contribution(owner: tuple[str, str]) -> float:
        mine = np.array([other == owner for other in names])
        return float(np.linalg.norm(theta[:, mine] @ coefficients[mine]))

    return max(sorted(owners), key=contribution)


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
            proof = withhold(stage, (best,), np.random.default_rng(0))
            held = proof.rmse_after / proof.noise_floor
        said = (best.candidate.identifier, best.candidate.shaft)
        reply = Reply(True, said, held)
        return Answer(level, {"BIC": Reply(level > 0.0, said, held)}, ((level, reply),), seconds, {})


def contestants() -> tuple[Contestant, ...]:
    """All whose packages are there."""
    found: list[Contestant] = []
    if installed("pysindy"):
        found += [SparseRegression(library, "STLSQ") for library in (PHYSICAL, GENERIC)]
        found.append(SparseRegression(PHYSICAL, "SR3"))
    if installed("sklearn"):
        found.append(GaussianProcess())
    return (*found, BestOfCatalogue())
