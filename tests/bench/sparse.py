"""PySINDy (MIT) on the residual of a baseline, tuned by cross-validation; imported here and nowhere else."""

from __future__ import annotations

import math
import time
import warnings
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.withheld import FOLDS
from tests.bench.bout import TOUCHED, Answer, Reply

if TYPE_CHECKING:
    from pmg.sim.signals import Array
    from tests.bench.bout import AnyBout, Library

LEVELS = np.geomspace(0.015, 4.0, 30)
"""Thresholds of the sparse regressions: root mean square of a term's contribution [noise]."""
RELAX = 1.0
"""SR3's coupling of its sparse to its full coefficients (PySINDy's default)."""
MOST_STEPS = 300
"""Iterations of SR3."""


def sparse_coefficients(optimizer: str, theta: Array, y: Array, level: float) -> Array:
    """Coefficients by PySINDy's STLSQ or SR3 with that threshold."""
    import pysindy  # type: ignore[import-not-found, unused-ignore]

    root = math.sqrt(len(y))  # columns of unit length, as normalize_columns makes them
    if optimizer == "STLSQ":
        chosen = pysindy.STLSQ(threshold=level)
    else:
        lam = level**2 / (2.0 * RELAX)  # the hard threshold of L0 is sqrt(2 lam nu)
        # From its default start, least squares, nearly equal columns keep huge weights of opposite sign.
        start = np.zeros((1, theta.shape[1]))
        chosen = pysindy.SR3(lam, "L0", RELAX, max_iter=MOST_STEPS, initial_guess=start)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = chosen.fit(theta / root, (y / root)[:, None])
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

    def __call__(self, bout: AnyBout, *, withheld: bool) -> Answer:
        """Terms at every threshold; the threshold by the least error of four folds, or by one standard error."""
        began = time.perf_counter()
        library = bout.library(self.library)
        every = np.ones(len(bout.fold), dtype=bool)
        theta, y = library.columns(bout, every), bout.residual_without(every) if library.beside else bout.residual
        all_of_it = np.stack([sparse_coefficients(self.optimizer, theta, y, float(level)) for level in LEVELS])
        errors: dict[tuple[int, ...], Array] = {(k,): self._errors(bout, library, (k,)) for k in range(FOLDS)}
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

    def _errors(self, bout: AnyBout, library: Library, without: tuple[int, ...]) -> Array:
        """Residual less correction at every reading (levels, m), folds left out of baseline and regression."""
        train = ~np.isin(bout.fold, without)
        theta, y = library.columns(bout, train), bout.residual_without(train)
        found = [sparse_coefficients(self.optimizer, theta[train], y[train], float(level)) for level in LEVELS]
        return np.asarray(y - np.stack(found) @ theta.T)

    def _nested(self, bout: AnyBout, library: Library, errors: dict[tuple[int, ...], Array]) -> tuple[Array, Array]:
        """Errors on withheld folds, the threshold of each chosen among the others, by either rule."""
        pairs = {pair: self._errors(bout, library, pair) for pair in combinations(range(FOLDS), 2)}
        found = np.zeros((2, len(bout.fold)))
        for k in range(FOLDS):
            others = [j for j in range(FOLDS) if j != k]
            inner = [np.mean(pairs[(min(j, k), max(j, k))][:, bout.fold == j] ** 2, axis=1) for j in others]
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


def _largest(names: tuple[tuple[str, str] | None, ...], theta: Array, coefficients: Array) -> tuple[str, str] | None:
    """Owner of the largest contribution; None where columns have no owner."""
    owners = {owner for owner, c in zip(names, coefficients, strict=True) if c != 0.0 and owner is not None}
    if not owners:
        return None

    def contribution(owner: tuple[str, str]) -> float:
        mine = np.array([other == owner for other in names])
        return float(np.linalg.norm(theta[:, mine] @ coefficients[mine]))

    return max(sorted(owners), key=contribution)
