"""Orthonormal bases of many nearly equal columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

if TYPE_CHECKING:
    from pmg.sim.signals import Array


def orthonormal(columns: Array, tolerance: float = 1e-6) -> Array:
    """Orthonormal basis of the columns' span (n, r), each column first brought to unit length.

    Notes
    -----
    By pivoted QR: terms and families hold the same column several times, on which a singular value decomposition by
    divide and conquer, as in `diagnose.noise.orthonormal`, may fail to converge.
    """
    length = np.linalg.norm(columns, axis=0)
    kept = columns[:, length > 0.0] / length[length > 0.0]
    if kept.shape[1] == 0:
        return np.zeros((len(columns), 0))
    q, r, _ = qr(kept, mode="economic", pivoting=True)
    size = np.abs(np.diag(r))
    return np.asarray(q[:, : len(size)][:, size > tolerance * size[0]])
