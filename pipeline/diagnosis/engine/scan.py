"""The scan: the logarithm of one p-value for each kind of structure, for data and synthetic noise alike."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from pmg.pipeline.fit.robust import MINIMUM_ROOM
from pmg.pipeline.fit.span import orthonormal

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.engine.evidence import Evidence
    from pmg.sim.signals import Array

ABSORBED = 1e-2
"""A column of which less than this part survives the baseline cannot be seen, and is not looked for."""


LEAST_P = 1e-280
"""Probability of a tail below which its logarithm is taken from the leading terms of its series [1]."""

LARGEST_RATIO = 1e280
"""Ratio of variances beyond which none is told from another."""

MOST_AT_ONCE = 2_000_000
"""Values that are worked on at a time."""


def in_parts(function: Callable[[Array], Array], white: Array) -> Array:
    """What a function gives of columns (m, draws), as many at a time as memory bears; the last axis is the draws."""
    parts = -(-white.size // MOST_AT_ONCE)
    if parts <= 1:
        return function(white)
    return np.concatenate([function(part) for part in np.array_split(white, parts, axis=1)], axis=-1)


def _log_upper_tail(k: int, dof: float, ratio: Array) -> Array:
    r"""Natural logarithm of the probability that a ratio of variances is larger by chance, however small that is.

    Parameters
    ----------
    k, dof : int and float
        Degrees of freedom above and below.
    ratio : (draws,) array
        Ratio of the mean squares.

    Notes
    -----
    :math:`I_x(a, b)` with :math:`x = \nu/(\nu + kF)`, :math:`a = \nu/2`, :math:`b = k/2`. Where it is too small for a
    number, :math:`\ln I_x = a \ln x + b \ln(1 - x) - \ln a B(a, b) - \ln(1 - x (a + b)/(a + 1))`, the last term for the
    series :math:`_2F_1(a + b, 1; a + 1; x)` as a geometric one. Large records leave such tails to strong effects and to
    some synthetic noise alike, and which is the clearer must be told.

    References
    ----------
    NIST Digital Library of Mathematical Functions, 8.17.7 and 15.8.1.
    """
    found = np.asarray(special.fdtrc(k, dof, ratio))
    a, b = 0.5 * dof, 0.5 * k
    x = dof / (dof + k * np.clip(ratio, 1.0, LARGEST_RATIO))
    series = -np.log1p(-np.minimum(x * (a + b) / (a + 1.0), 1.0 - 1e-9))
    far = a * np.log(x) + b * np.log1p(-x) - math.log(a) - special.betaln(a, b) + series
    return np.where(found > LEAST_P, np.log(np.maximum(found, LEAST_P)), np.minimum(far, math.log(LEAST_P)))


@dataclass(frozen=True)
class Scan:
    """Projections that turn whitened rows into one p-value a family; the same for data and synthetic noise.

    Parameters
    ----------
    evidence : Evidence
        Groups, contrasts, and what is looked for.
    baseline, everything : (m, k) array
        Orthonormal bases of the baseline, and of it with every family that is not narrow.
    excluded : (m, c) array
        Orthonormal basis of the columns excluded from the estimate of the scatter, beyond both.
    bases : tuple of (m, r) array
        Orthonormal basis of each family beyond the baseline; that of a single column points as the column does.
    """

    evidence: Evidence
    baseline: Array
    everything: Array
    excluded: Array
    bases: tuple[Array, ...]

    def __call__(self, white: Array) -> Array:
        """Natural logarithms of nominal p-values (tests, draws) of whitened columns (m, draws).

        Tests are the families, two on the repeats of each group that has any, and one on single rows where asked for.
        """
        return in_parts(self._tests, white)

    def _tests(self, white: Array) -> Array:
        """The same of as many columns as memory bears."""
        left, leverage = white, np.zeros(len(white))
        for basis in (self.everything, self.excluded):
            left = left - basis @ (basis.T @ left)
            leverage += np.einsum("ij,ij->i", basis, basis)
        variance, dof, scale = [], [], np.empty_like(white)
        for rows in self.evidence.groups:
            free = float(np.sum(1.0 - leverage[rows]))
            dof.append(max(free, 1.0))
            variance.append(np.sum(left[rows] ** 2, axis=0) / free if free > 1.0 else np.ones(white.shape[1]))
            scale[rows] = np.sqrt(variance[-1])
        residual = white - self.baseline @ (self.baseline.T @ white)
        standard = residual / scale
        tests = []
        for place, basis in enumerate(self.bases):
            k = basis.shape[1]
            if k == 0:
                tests.append(np.zeros(white.shape[1]))
                continue
            group = int(np.argmax([float(np.sum(basis[rows] ** 2)) for rows in self.evidence.groups]))
            along = basis.T @ standard
            tests.append(_log_upper_tail(k, dof[group], np.sum(along**2, axis=0) / k))
            if place in self.evidence.positive:
                tests[-1] = np.where(along[0] > 0.0, tests[-1] - math.log(2.0), 0.0)
        for group, columns in enumerate(self.evidence.contrasts):
            if columns.shape[1]:
                ratio = np.mean((columns.T @ residual) ** 2, axis=0) / variance[group]
                lower = np.maximum(special.fdtr(columns.shape[1], dof[group], ratio), LEAST_P)
                tests.append(math.log(2.0) + _log_upper_tail(columns.shape[1], dof[group], ratio))
                tests.append(math.log(2.0) + np.log(lower))
        if self.evidence.single_rows:
            room = np.sqrt(np.maximum(1.0 - np.einsum("ij,ij->i", self.baseline, self.baseline), 1e-6))
            usable = room > MINIMUM_ROOM
            largest = np.max(np.abs(standard[usable]) / room[usable, None], axis=0)
            tests.append(math.log(max(usable.sum(), 1)) + _log_upper_tail(1, min(dof), largest**2))
        return np.minimum(np.stack(tests), 0.0)


def make_scan(evidence: Evidence, baseline: Array) -> Scan:
    """The scan of some evidence beside a whitened baseline (m, k)."""
    base = orthonormal(baseline)
    bases = []
    for block in evidence.families:
        basis, alone = _beyond_basis(base, block)
        bases.append(basis * np.sign(basis.T @ alone)[0] if basis.shape[1] == alone.shape[1] == 1 else basis)
    everything = orthonormal(np.hstack([base, *bases[: len(bases) - evidence.narrow]]))
    excluded = base[:, :0] if evidence.excluded is None else _beyond_basis(everything, evidence.excluded)[0]
    return Scan(evidence, base, everything, excluded, tuple(bases))


def _beyond_basis(basis: Array, columns: Array) -> tuple[Array, Array]:
    """What columns (m, k) of unit length have beyond a basis: an orthonormal basis of it, and itself (m, k).

    Columns of which less than `ABSORBED` is left do not count for the former.
    """
    length = np.linalg.norm(columns, axis=0)
    unit = columns[:, length > 0.0] / length[length > 0.0]
    left = unit - basis @ (basis.T @ unit)
    return orthonormal(left[:, np.linalg.norm(left, axis=0) > ABSORBED], 1e-3), left


def look_elsewhere(observed: float, smallest: Array) -> float:
    """Probability that pure noise shows as clear a thing: of its smallest nominal p-values (draws,), or logarithms."""
    return (1.0 + float(np.sum(smallest <= observed))) / (len(smallest) + 1.0)
