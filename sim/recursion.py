"""First-order recursions: what is kept of the value before, and what is new."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dtbtrs

if TYPE_CHECKING:
    from pmg.sim.signals import Array


def remembered(keep: Array, news: Array) -> Array:
    r"""Values of a first-order memory: a warming node, an autoregression.

    Parameters
    ----------
    keep : (n - 1,) array
        Part of each value that the next one keeps.
    news : (n,) or (n, c) array
        The first value, then what each step brings.

    Returns
    -------
    (n,) or (n, c) array
        :math:`x_0 = u_0,\ x_k = a_k x_{k-1} + u_k`, by forward substitution in a band of two.
    """
    band = np.ones((2, len(news)), order="F")
    band[1, :-1] = -keep
    return np.asarray(dtbtrs(band, news.reshape(len(news), -1), uplo=b"L", diag=b"U")[0]).reshape(news.shape)
