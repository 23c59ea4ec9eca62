"""Orthonormal bases of what columns span."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

if TYPE_CHECKING:
    from pmg.sim.signals import Array


def orthonormal(columns: Array, tolerance: float = 1e-6) -> Array:
    """Orthonormal basis of the columns' span (m, r), each column first brought to unit length."""
    length = np.linalg.norm(columns, axis=0)
    kept = columns[:, length > 0.0] / length[length > 0.0]
    if kept.shape[1] == 0:
        return np.zeros((len(columns), 0))
    try:
        left, singular, _ = np.linalg.svd(kept, full_matrices=False)
    except np.linalg.LinAlgError:  # divide and conquer fails on some columns of low rank; this way does not
        left, singular, _ = linalg.svd(kept, full_matrices=False, lapack_driver="gesvd")
    return left[:, singular > tolerance * singular[0]]


def pseudo_inverse(columns: Array, tolerance: float = 1e-9) -> Array:
    """Inverse (k, m) of columns (m, k) by least squares, each first brought to unit length; zero for one of zeros."""
    length = np.linalg.norm(columns, axis=0)
    length[length == 0.0] = 1.0
    return np.asarray(np.linalg.pinv(columns / length, rcond=tolerance) / length[:, None])
