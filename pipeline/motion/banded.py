"""Banded matrices factored once, by which many columns are divided: the covariance of filtered noise is one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

if TYPE_CHECKING:
    from pmg.sim.signals import Array

BLOCK = 64
"""Rows of a banded matrix that are solved for at once."""


@dataclass(frozen=True)
class BandedFactor:
    """A lower banded matrix, in blocks that hold its band: many columns at once are products of small matrices.

    Parameters
    ----------
    band : (b + 1, n) array
        Its diagonals, as LAPACK keeps them.
    inverses : tuple of (r, r) array
        Of its blocks of `BLOCK` rows on the diagonal; of the last one fewer.
    links : tuple of (r, b) array
        What each block takes of the b solved rows before it, solved; zero of the first.
    """

    band: Array
    inverses: tuple[Array, ...]
    links: tuple[Array, ...]

    @classmethod
    def of(cls, band: Array) -> BandedFactor:
        """A lower banded matrix by its diagonals (b + 1, n)."""
        below, n = len(band) - 1, band.shape[1]
        inverses, links = [], []
        for first in range(0, n, max(BLOCK, below)):
            last = min(first + max(BLOCK, below), n)
            rows = np.zeros((last - first, below + last - first))
            for down, diagonal in enumerate(band):
                at = np.arange(max(first, down), last)
                rows[at - first, at - down - first + below] = diagonal[at - down]
            inverse = solve_triangular(rows[:, below:], np.eye(last - first), lower=True, check_finite=False)
            inverses.append(np.asarray(inverse))
            links.append(np.asarray(inverse @ rows[:, :below]))
        return cls(band, tuple(inverses), tuple(links))

    def solved(self, columns: Array) -> Array:
        """Columns (n, j) by the inverse of the matrix."""
        found = np.empty(columns.shape)
        first = 0
        for inverse, link in zip(self.inverses, self.links, strict=True):
            last = first + len(inverse)
            np.matmul(inverse, columns[first:last], out=found[first:last])
            if first:
                found[first:last] -= link @ found[first - link.shape[1] : first]
            first = last
        return found

    def adjoint(self, columns: Array) -> Array:
        """Columns (n, j) by the inverse of the transposed matrix."""
        found = columns.copy()
        last = len(columns)
        for inverse, link in zip(self.inverses[::-1], self.links[::-1], strict=True):
            first = last - len(inverse)
            if first:
                found[first - link.shape[1] : first] -= link.T @ found[first:last]
            found[first:last] = inverse.T @ found[first:last]
            last = first
        return found
