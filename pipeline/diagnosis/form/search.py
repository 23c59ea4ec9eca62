"""The search: which short form takes up most of what the baseline leaves, for its number of constants."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.optimize import minimize

from pmg.pipeline.diagnosis.engine.scan import ABSORBED
from pmg.pipeline.diagnosis.form.grammar import Form, forms

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.form.atoms import FormCovariate
    from pmg.sim.signals import Array, Mask

    Vector: TypeAlias = np.ndarray[tuple[int], np.dtype[np.float64]]

REFINED = 4
"""Leading forms whose constants are refined beyond the grid."""

AROUND = 4.0
"""Factor by which a constant may leave its value on the grid."""

EVALUATIONS = 80
"""Steps of a refinement."""

BLOCK = 4096
"""Columns looked at together: bounds the memory of a search."""


@dataclass(frozen=True)
class View:
    """Readings from which a form is chosen: some or all of those of a location, whitened, the baseline projected out.

    Parameters
    ----------
    matrix : (n,) or (p, n) array
        Whitens what a form gives at the n readings; a vector where the noise is white, zero at readings left out.
    basis : (p, r) array
        What the baseline can absorb; orthonormal over all readings, here the rows that a form can touch.
    left : (p,) array
        The readings, whitened, less what the baseline absorbs.
    """

    matrix: Array
    basis: Array
    left: Array

    @property
    def used(self) -> int:
        """Readings that count."""
        return int(np.count_nonzero(self.matrix if self.matrix.ndim == 1 else np.abs(self.matrix).max(axis=0)))

    def white(self, columns: Array) -> Array:
        """Columns (n, ...) whitened (p, ...)."""
        flat = columns.reshape(len(columns), -1)
        out = flat * self.matrix[:, None] if self.matrix.ndim == 1 else self.matrix @ flat
        return np.asarray(out.reshape(-1, *columns.shape[1:]))

    def normal(self, columns: Array) -> tuple[Array, Array]:
        """Normal equations of columns (n, g, l) with the baseline free: matrices (g, l, l) and right sides (g, l).

        Where less than `scan.ABSORBED` of a column survives the baseline its right side is zero.
        """
        white = self.white(columns)
        flat = white.reshape(len(white), -1)
        absorbed = (self.basis.T @ flat).reshape(-1, *columns.shape[1:])
        whole = np.einsum("pgi,pgj->gij", white, white)
        gram = whole - np.einsum("rgi,rgj->gij", absorbed, absorbed)
        right = (self.left @ flat).reshape(columns.shape[1:])
        kept = np.einsum("gii->gi", gram) > ABSORBED**2 * np.einsum("gii->gi", whole)
        return gram, np.where(kept.all(axis=1)[:, None], right, 0.0)

    def gains(self, columns: Array) -> Array:
        """Fall of the sum of squares (g,) by columns (n, g, l), in noise variances."""
        gram, right = self.normal(columns)
        if columns.shape[2] == 1:
            return right[:, 0] ** 2 / np.maximum(gram[:, 0, 0], 1e-300)
        determinant = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
        top = right[:, 0] ** 2 * gram[:, 1, 1] + right[:, 1] ** 2 * gram[:, 0, 0]
        top -= 2.0 * right[:, 0] * right[:, 1] * gram[:, 0, 1]
        sound = determinant > ABSORBED**2 * gram[:, 0, 0] * gram[:, 1, 1]
        return np.where(sound, top / np.where(sound, determinant, 1.0), 0.0)


@dataclass(frozen=True)
class Library:
    """Every form of some covariates, with its values at the constants from which fits start.

    Parameters
    ----------
    forms : tuple of Form
        The forms.
    starts : tuple of (g, k) array
        For each of them.
    blocks : tuple of ((b, 2) int array, (n, b, l) array)
        Form and start of each column, and the columns.
    price : dict of (int, int) to float
        For each number of constants, linear and nonlinear: what the choice among that many forms costs.
    """

    forms: tuple[Form, ...]
    starts: tuple[Array, ...]
    blocks: tuple[tuple[npt.NDArray[np.int64], Array], ...]
    price: dict[tuple[int, int], float]

    def cost(self, form: Form, readings: int) -> float:
        """Least gain for which a formula is worth it, in noise variances.

        Notes
        -----
        The extended criterion: a logarithm of the number of readings for each constant, and twice the logarithm of the
        number of forms with as many.

        References
        ----------
        J. Chen and Z. Chen, Extended Bayesian information criteria for model selection with large model spaces,
        Biometrika 95 (2008), 759-771, DOI 10.1093/biomet/asn034, equation 1 with gamma = 1.
        """
        return (form.linear + form.nonlinear) * math.log(max(readings, 2)) + self.price[form.linear, form.nonlinear]


def make_library(covariates: tuple[FormCovariate, ...]) -> Library:
    """The library of a location's covariates."""
    listed = forms(covariates)
    starts = tuple(form.starts() for form in listed)
    blocks: list[tuple[npt.NDArray[np.int64], Array]] = []
    for linear in (1, 2):
        index: list[npt.NDArray[np.int64]] = []
        columns: list[Array] = []
        for i, (form, start) in enumerate(zip(listed, starts, strict=True)):
            if form.linear != linear or not len(start):
                continue
            index.append(np.c_[np.full(len(start), i), np.arange(len(start))])
            columns.append(form.columns(start))
            if sum(map(len, index)) >= BLOCK:
                blocks.append((np.concatenate(index), np.concatenate(columns, axis=1)))
                index, columns = [], []
        if index:
            blocks.append((np.concatenate(index), np.concatenate(columns, axis=1)))
    many = Counter((form.linear, form.nonlinear) for form in listed)
    return Library(listed, starts, tuple(blocks), {key: 2.0 * math.log(count) for key, count in many.items()})


@dataclass(frozen=True)
class FormFit:
    """A form with its constants.

    Parameters
    ----------
    form : Form
        What was fitted.
    constants : (k,) array
        The nonlinear ones.
    gain : float
        Fall of the sum of squares, in noise variances.
    score : float
        Gain less the cost of the form.
    """

    form: Form
    constants: Array
    gain: float
    score: float

    @property
    def columns(self) -> Array:
        """Values (n, linear) per unit of the linear constants."""
        return np.asarray(self.form.columns(self.constants[None, :])[:, 0])


def search(view: View, library: Library) -> list[FormFit]:
    """The leading forms, best score first, with the constants refined; empty where nothing can be seen."""
    best = np.zeros(len(library.forms))
    where = np.zeros(len(library.forms), dtype=int)
    for index, columns in library.blocks:
        gains = view.gains(columns)
        order = np.argsort(gains, kind="stable")
        improved = gains[order] > best[index[order, 0]]
        rows = order[improved]
        best[index[rows, 0]], where[index[rows, 0]] = gains[rows], index[rows, 1]  # the last of a form is its best
    costs = np.array([library.cost(form, view.used) for form in library.forms])
    leading = [i for i in np.argsort(costs - best, kind="stable")[:REFINED] if best[i] > 0.0]
    fits = [_refined(view, library.forms[i], library.starts[i], where[i], best[i], costs[i]) for i in leading]
    return sorted(fits, key=lambda fit: -fit.score)


def _refined(view: View, form: Form, starts: Array, which: int, gain: float, cost: float) -> FormFit:
    """The form with its nonlinear constants searched about the best start.

    Notes
    -----
    Variable projection: the linear constants, and those of the baseline, are solved for at every step. Constants are
    searched on a logarithm, within all starts; the place of a step among all that differ.
    """
    free, start = np.array(form.searched, dtype=bool), _placed(view, form, starts[which])
    if free.any():
        start = _placed(view, form, _descended(view, form, start, free, starts.min(axis=0), starts.max(axis=0)))
    gain = max(gain, float(view.gains(form.columns(start[None, :]))[0]))
    return FormFit(form, start, gain, gain - cost)


def _placed(view: View, form: Form, constants: Array) -> Array:
    """The constants with each place of a step at the best of all its values."""
    for i in np.flatnonzero(~np.array(form.searched, dtype=bool)):
        places = form.places(int(i))
        tried = np.repeat(constants[None, :], len(places), axis=0)
        tried[:, i] = places
        constants = tried[int(np.argmax(view.gains(form.columns(tried))))]
    return constants


def _descended(view: View, form: Form, start: Array, free: Mask, lowest: Array, highest: Array) -> Array:
    """The best constants about a start, those that are free."""

    def at(logarithms: Array) -> Array:
        constants = start.copy()
        constants[free] = start[free] * np.exp(logarithms)
        return constants

    def loss(logarithms: Vector) -> float:
        return -float(view.gains(form.columns(at(logarithms)[None, :]))[0])

    n, far = int(free.sum()), math.log(AROUND)
    low, high = (np.clip(np.log(limit / start)[free], -far, far) for limit in (lowest, highest))
    step = np.where(high > 0.1, 0.1, -0.1)
    simplex = np.vstack([np.zeros(n), np.clip(np.diag(step), low, high)])
    found = minimize(
        loss,
        np.zeros(n),
        method="Nelder-Mead",
        bounds=[(float(a), float(b)) for a, b in zip(low, high, strict=True)],
        options={"maxfev": EVALUATIONS, "xatol": 1e-4, "fatol": 1e-4, "initial_simplex": simplex},
    )
    return at(np.asarray(found.x)) if found.fun < loss(np.zeros(n)) else start
