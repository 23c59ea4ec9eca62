"""A family of tests on the same differences, with one p-value for all of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, stats

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Mask


@dataclass(frozen=True)
class DifferenceGroup:
    """Differences that are reported together, such as the sun torques of the engaged points.

    Parameters
    ----------
    rows : (m,) array of bool
        Which of all differences.
    weights : (k, m) array
        Linear tests: each row, times the differences, is an estimate that is zero where there is no difference.
    """

    rows: Mask
    weights: Array


@dataclass(frozen=True)
class LinearEstimate:
    """A linear estimate: its value, independent and common standard uncertainty, and two-sided nominal p-value."""

    value: float
    own: float
    common: float
    p_value: float

    @property
    def u(self) -> float:
        """Standard uncertainty, both parts together."""
        return float(np.hypot(self.own, self.common))


@dataclass(frozen=True)
class DifferenceFamily:
    r"""Law of m differences where there is none, and the tests that look for one.

    Parameters
    ----------
    noise : tuple of (effects, degrees of freedom)
        Independent sources of noise: the (m, r) effects of unit normal errors, and how well their size is known.
    left : (m, s) array
        What one standard uncertainty of each common error leaves in the differences.
    blocks : tuple of DifferenceGroup
        The differences reported together, with their linear tests.

    Notes
    -----
    Each block is tested by its linear estimates, :math:`z = w^Td/u`, and by :math:`\chi^2 = d^T\Sigma^{-1}d` with
    the covariance :math:`\Sigma` of independent and common errors together. The smallest nominal p-value of the whole
    family is compared with that of drawn differences that are nothing but errors, the size of the noise drawn with
    its degrees of freedom. So the search over all tests is paid for, and their dependence is taken into account.
    """

    noise: tuple[tuple[Array, float], ...]
    left: Array
    blocks: tuple[DifferenceGroup, ...]

    @property
    def covariance(self) -> Array:
        """Covariance of the independent errors (m, m)."""
        return np.asarray(sum(effect @ effect.T for effect, _ in self.noise))

    def estimates(self, differences: Array) -> tuple[tuple[LinearEstimate, ...], ...]:
        """Every linear estimate, block by block."""
        covariance, found = self.covariance, []
        for block in self.blocks:
            own = np.sqrt(np.einsum("km,mn,kn->k", block.weights, covariance, block.weights))
            common = np.linalg.norm(block.weights @ self.left, axis=1)
            values = block.weights @ differences
            p = 2.0 * stats.norm.sf(np.abs(values) / np.hypot(own, common))
            found.append(tuple(LinearEstimate(*map(float, one)) for one in zip(values, own, common, p, strict=True)))
        return tuple(found)

    def chi_squares(self, differences: Array) -> tuple[tuple[float, int, float], ...]:
        """Block by block: chi-square, its degrees of freedom, and its nominal p-value."""
        covariance, found = self.covariance + self.left @ self.left.T, []
        for block in self.blocks:
            chosen = differences[block.rows]
            value = float(chosen @ np.linalg.solve(covariance[np.ix_(block.rows, block.rows)], chosen))
            found.append((value, len(chosen), float(stats.chi2.sf(value, len(chosen)))))
        return tuple(found)

    def smallest(self, differences: Array) -> Array:
        """Smallest nominal p-value of the family, as its logarithm, for each column (m, c) of differences."""
        covariance = self.covariance + self.left @ self.left.T
        logs = []
        for block in self.blocks:
            u = np.sqrt(np.einsum("km,mn,kn->k", block.weights, covariance, block.weights))
            z = np.abs(block.weights @ differences) / u[:, None]
            logs.append(np.log(2.0) + stats.norm.logsf(z))
            lower = linalg.cholesky(covariance[np.ix_(block.rows, block.rows)], lower=True)
            white = linalg.solve_triangular(lower, differences[block.rows], lower=True)
            logs.append(stats.chi2.logsf(np.sum(white**2, axis=0), len(lower))[None, :])
        return np.asarray(np.minimum(np.concatenate(logs).min(axis=0), 0.0))

    def drawn(self, draws: int, rng: np.random.Generator) -> Array:
        """Differences that are nothing but errors, in units of what is taken for the noise (m, draws)."""
        total = self.left @ rng.standard_normal((self.left.shape[1], draws))
        for effect, dof in self.noise:
            size = np.sqrt(dof / rng.chisquare(dof, draws)) if np.isfinite(dof) else np.ones(draws)
            total += (effect @ rng.standard_normal((effect.shape[1], draws))) * size
        return np.asarray(total)

    def p_value(self, differences: Array, draws: int, rng: np.random.Generator) -> float:
        """Probability of a smallest p-value like that of these differences where there is none."""
        null = self.smallest(self.drawn(draws, rng))
        seen = float(self.smallest(differences[:, None])[0])
        return float((1 + np.count_nonzero(null <= seen)) / (draws + 1))
