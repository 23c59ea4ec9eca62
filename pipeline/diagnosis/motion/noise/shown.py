"""The wander of transducers and the ripple of a turn that the residuals of a campaign show."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag, eigh

from pmg.pipeline.diagnosis.motion.constants import RIPPLE
from pmg.pipeline.diagnosis.motion.noise.row_noise import QUIETEST, USUAL, SlowNoise, turns_of
from pmg.pipeline.diagnosis.motion.noise.wander import TIMES, Wander, of_means
from pmg.sim.shafts import per_shaft
from pmg.sim.signals import NORMAL_MAD

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise
    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.sim.signals import Array

PIECE = 2.0
"""Time over which a reading is averaged to see its wander [s]."""

FILLED = 0.5
"""Part of a piece that rows must fill for its mean to count."""

LEAST_RIPPLE = 3e-4
"""Least standard deviation that is taken for the ripple of a turn [N m]."""

OF_FEW = {2: 1.196, 3: 1.495, 4: 1.363, 5: 1.206, 6: 1.200, 7: 1.140, 8: 1.129, 9: 1.107}
"""Factor on a scatter by medians of so many values."""

USUAL_WANDER = USUAL.wander.sun
"""What is thought of a wander before anything is seen of it."""

SIZE_DOUBT = 0.7
"""Standard deviation of the logarithm of its size before."""

SIZES = np.linspace(-2.0, 5.0, 71)
"""Logarithms of the size of a wander over the usual one that are tried."""

SHARES = np.array([cut for cut in itertools.product(range(4), repeat=len(TIMES)) if sum(cut) == 3]) / 3.0
"""Parts of the whole variance at each time that are tried."""

UNLIKELY = 1e-4
"""Probability over that of the likeliest case below which one is left out."""

SAME = 1e-6
"""Length of a direction, over the longest, up to which it adds nothing to what may explain means."""


@dataclass(frozen=True)
class _Means:
    """Means of the reading of one stretch over pieces of time.

    Parameters
    ----------
    when : (p,) array
        Middle of each [s since 1970].
    off : (p,) array
        Mean of what is left [N m].
    columns : (p, k) array
        The same of each column that may explain it.
    covariance : (p, p) array
        Of the means, by what the filters leave alone [(N m)2].
    """

    when: Array
    off: Array
    columns: Array
    covariance: Array


def slow_noise_of(
    stretches: tuple[RotorRows, ...], noise: list[RowNoise], left: list[Array], columns: list[Array]
) -> SlowNoise:
    """The wander and the ripple that residuals show, beside what may explain them.

    The waves of a turn are those of its side, in neutral and engaged; a few that stand out do not count.

    Parameters
    ----------
    stretches : tuple of RotorRows
        All of a campaign.
    noise : list of RowNoise
        Of each.
    left : list of (n,) array
        Measured torque of each less what explains it [N m].
    columns : list of (n, k) array
        What may explain a part of that, so that it is no wander; a column is one over all stretches of a side.
    """
    told: dict[str, list[_Means]] = {}
    ripples: dict[tuple[str, bool], list[Array]] = {}
    for place, stretch in enumerate(stretches):
        if noise[place].floor <= QUIETEST**2:  # as a channel that shows one value, and nothing of its wander
            continue
        means, waves = _means_of(stretch, noise[place], left[place], columns[place])
        told.setdefault(stretch.side, []).append(means)
        if len(waves):
            ripples.setdefault((stretch.side, stretch.coupled), []).append(waves)
    several = [np.array(of) for of in ripples.values() if len(of) > 1]
    ripple = USUAL.ripple
    if several:
        scatter = np.average(list(map(_scatter, several)), axis=0, weights=[len(of) - 1 for of in several])
        ripple = tuple(max(float(np.mean(each)), LEAST_RIPPLE) for each in np.split(scatter, len(RIPPLE)))
    return SlowNoise(per_shaft(lambda side: _wander(told[side]) if side in told else USUAL_WANDER), ripple)


def _scatter(waves: Array) -> Array:
    """Standard deviation (w,) of the waves of n runs (n, w), by the median of what they are off their median.

    References
    ----------
    C. Croux, P. J. Rousseeuw, 'Time-Efficient Algorithms for Two Highly Robust Estimators of Scale', COMPSTAT (1992):
    the factors by which few values make that small.
    """
    n, off = len(waves), np.abs(waves - np.median(waves, axis=0))
    return np.asarray((OF_FEW[n] if n in OF_FEW else n / (n - 0.8)) * NORMAL_MAD * np.median(off, axis=0))


def _means_of(stretch: RotorRows, noise: RowNoise, left: Array, columns: Array) -> tuple[_Means, Array]:
    """Means of a stretch over pieces, and the waves of a turn (w,) beside them [N m]."""
    pieces, when = _pieces(stretch)
    of_known = np.hstack([pieces, turns_of(stretch)])
    white = noise.factor.solved(np.hstack([of_known, columns, left[:, None]]))
    squares = white[:, : of_known.shape[1]].T @ white
    inverse = np.linalg.pinv(squares[:, : len(squares)], rcond=1e-12, hermitian=True)
    found, p = inverse @ squares[:, len(squares) :], len(when)
    weights = noise.factor.adjoint(white[:, : len(squares)] @ inverse[:, :p])
    of_steps = weights.T @ noise.quantisation
    covariance = inverse[:p, :p] - noise.floor * weights.T @ weights + of_steps @ of_steps.T
    return _Means(when, found[:p, -1], found[:p, :-1], covariance), found[p:, -1]


def _pieces(stretch: RotorRows) -> tuple[Array, Array]:
    """Pieces of time (n, k) that rows fill, each 1 in its own, and when their middles were [s since 1970]."""
    time = stretch.run.row_time[stretch.rows]
    of = np.floor(time / PIECE).astype(np.int64)
    held = [k for k in np.unique(of) if np.sum(of == k) > FILLED * PIECE * stretch.run.row_rate]
    began = stretch.run.run.started_at.timestamp()
    return (of[:, None] == np.array(held, dtype=np.int64)).astype(np.float64), began + PIECE * (np.array(held) + 0.5)


def _wander(told: list[_Means]) -> Wander:
    r"""The wander of one transducer from the means of all its stretches: every case with its probability.

    Notes
    -----
    Means that nothing explains, :math:`z = Q^T y` with Q orthogonal to all that may, are normal with the covariance
    :math:`Q^T (N + s^2 \sum_k p_k K_k) Q` of filtered noise and wander, so that what a fit takes away is made up for
    (restricted likelihood, Patterson and Thompson 1971). Sizes s about the usual one and parts p on a lattice are
    equally likely before.
    """
    when, off = np.concatenate([each.when for each in told]), np.concatenate([each.off for each in told])
    free = _beyond(np.vstack([each.columns for each in told]))
    if not free.shape[1]:
        return USUAL_WANDER
    z, known = free.T @ off, free.T @ block_diag(*(each.covariance for each in told)) @ free
    parts = [free.T @ of_means(when, PIECE, time) @ free for time in TIMES]
    variances = USUAL_WANDER.size**2 * np.exp(2.0 * SIZES)
    likely, cases = [], []
    for shares in SHARES:
        seen, across = eigh(sum(share * part for share, part in zip(shares, parts, strict=True)), known)
        whole = 1.0 + variances[:, None] * seen
        squares = np.sum(np.log(whole) + (across.T @ z) ** 2 / whole, axis=1)
        likely.append(-0.5 * squares - 0.5 * (SIZES / SIZE_DOUBT) ** 2)
        cases.append(variances[:, None] * shares)
    weights = np.exp(np.concatenate(likely) - np.max(likely))
    kept = weights > UNLIKELY
    return Wander(np.vstack(cases)[kept], weights[kept] / weights[kept].sum())


def _beyond(columns: Array) -> Array:
    """Orthonormal directions (n, f) that no column (n, k) follows."""
    length = np.linalg.norm(columns, axis=0)
    unit = columns[:, length > 0.0] / length[length > 0.0]
    basis, sizes, _ = np.linalg.svd(unit, full_matrices=True)
    rank = int(np.sum(sizes > SAME * sizes[0])) if len(sizes) else 0
    return np.asarray(basis[:, rank:])
