"""Orthonormal bases of what columns span."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pmg.sim.signals import Array


def orthonormal(columns: Array, tolerance: float = 1e-6) -> Array:
    """Orthonormal basis (m, r) of what columns (m, k) span, each first brought to unit length.

    Directions whose singular value is less than `tolerance` (1e-7 at least) of the largest are left out. Made of the
    eigenvectors of the columns' products, which is less work than singular vectors of tall columns; twice, as what they
    make is orthogonal but for rounding over the square of the tolerance.

    References
    ----------
    A. Stathopoulos, K. Wu, 'A block orthogonalization procedure with constant synchronization requirements', SIAM
    Journal on Scientific Computing 23 (6), 2002, doi:10.1137/S1064827500370883.
    """
    basis = _unit(columns)
    for _ in range(2):
        squares, directions = _directions(basis, tolerance)
        basis = basis @ (directions / np.sqrt(squares))
    return basis


def freed(columns: Array, y: Array) -> tuple[Array, Array]:
    """Orthonormal basis of columns (m, k), and what they leave of rows (m,)."""
    basis = orthonormal(columns)
    return basis, y - basis @ (basis.T @ y)


def taken_out(columns: Array, values: Array, tolerance: float = 1e-6) -> tuple[Array, int]:
    """What columns (m, k) leave of values (m,), and how many directions they span.

    As by `orthonormal`, in a fraction of the time; the second turn takes out what rounding leaves of the first.
    """
    unit = _unit(columns)
    squares, directions = _directions(unit, tolerance)
    inverse = (directions / squares) @ directions.T
    for _ in range(2):
        values = values - unit @ (inverse @ (unit.T @ values))
    return values, len(squares)


def lengths(columns: Array) -> Array:
    """Length of each column (k,); 1 for one of zeros."""
    length = np.linalg.norm(columns, axis=0)
    return np.where(length == 0.0, 1.0, length)


def _unit(columns: Array) -> Array:
    """Columns brought to unit length; those of zeros are left out."""
    length = np.linalg.norm(columns, axis=0)
    return np.asarray(columns[:, length > 0.0] / length[length > 0.0])


def _directions(columns: Array, tolerance: float) -> tuple[Array, Array]:
    """Squares of the singular values (r,) of columns (m, k) above the tolerance, and their vectors (k, r)."""
    squares, vectors = np.linalg.eigh(columns.T @ columns)
    kept = squares > tolerance**2 * squares.max(initial=0.0)
    return squares[kept], vectors[:, kept]


def pseudo_inverse(columns: Array, tolerance: float = 1e-9) -> Array:
    """Inverse (k, m) of columns (m, k) by least squares, each first brought to unit length; zero for one of zeros."""
    length = lengths(columns)
    return np.asarray(np.linalg.pinv(columns / length, rcond=tolerance) / length[:, None])
