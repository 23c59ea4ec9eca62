"""With what power further rows would tell two explanations apart."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.fit.span import lengths

if TYPE_CHECKING:
    from pmg.sim.signals import Array

ENOUGH = 0.95
"""Power from which on the shorter of two tests is preferred."""


def power_to_separate(noncentrality: float, margin: float = MARGIN) -> float:
    """Probability that the difference of evidence, normal with variance 4 times its mean, exceeds a margin."""
    if noncentrality <= 0.0:
        return 0.0
    return float(stats.norm.cdf((noncentrality - margin) / (2.0 * math.sqrt(noncentrality))))


def squares_beyond(effects: Array, columns: Array) -> Array:
    """Squared lengths (q,) of what free columns (m, k) leave of effects (m, q)."""
    length = lengths(columns)
    scale = np.outer(length, length)
    inverse = np.linalg.pinv((columns.T @ columns) / scale, rcond=1e-12, hermitian=True)
    along = (columns.T @ effects) / length[:, None]
    left = np.sum(effects**2, axis=0) - np.sum(along * (inverse @ along), axis=0)
    return np.asarray(np.maximum(left, 0.0))
