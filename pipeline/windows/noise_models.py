"""Kinds of noise that a stretch may hold, and how the means of its pieces vary together under each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.windows.revolutions import BATCHES
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

LONGEST_MEMORY = 0.3
"""Longest correlation time of noise of first order alone, as part of the stretch."""
SHORTEST_MEMORY = 0.004
"""Shortest one; below it pieces are as good as independent."""
MEMORIES = 24
"""Correlation times that are weighed, equally spaced in their logarithm, and none at all."""
INDEPENDENT = 4.0
"""Weight of no correlation at all before the data are seen, where each of the others has 1."""

SLOW, SLOW_WEIGHT = (0.06, 0.12, 0.25, 0.6, 1.5, 3.0), 1.0
"""Correlation times of slow noise plus independent noise, as part of the stretch, and their weight together."""
SLOW_WHITE = (0.2, 0.4, 0.6, 0.8, 0.9, 0.95)
"""Share of the independent noise in the variance of a piece."""
POWERS, POWER_WEIGHT = (0.25, 0.5, 0.75, 1.0), 0.4
"""Exponents a of noise of density 1/f^a, and their weight together."""
REACH, FINEST = 10.0, 1e-4
"""Longest and shortest correlation time in it, as part of the stretch: below a frequency it is flat."""
TIMES = 40
"""Correlation times that it is put together from."""
CYCLES, CYCLES_WEIGHT = tuple(float(c) for c in np.geomspace(1.5, 20.0, 14)), 1.0
"""Cycles of a resonance in the stretch, and the weight of all resonances together."""
DAMPING = (0.05, 0.12, 0.3)
"""Their damping ratios."""
RING_WHITE = (0.0, 0.01, 0.04, 0.2, 0.6)
"""Share of independent noise added to them in the variance of a piece."""

UNEVEN = 0.1
"""Part by which the density at zero may differ from that at one cycle in the stretch and pass for flat there."""
UNSAFE = 0.1
"""Part by which batches may be expected to miss the variance of the mean."""


@dataclass(frozen=True)
class _NoiseForm:
    r"""Noise whose correlation is a sum of exponentials, with or without independent noise.

    Parameters
    ----------
    sizes, rates : (j,) array of complex
        A and z of :math:`\rho(t) = \mathrm{Re} \sum A e^{-zt}`, with t in stretches; empty for independent noise.
    white : tuple of float
        Shares of independent noise in the variance of a piece; each is a form of its own.
    weight : float
        Weight of each form before the data are seen.
    memory : float
        Correlation time of noise of first order alone, as part of the stretch, 0 for none; NaN for other kinds.
    """

    sizes: npt.NDArray[np.complex128]
    rates: npt.NDArray[np.complex128]
    white: tuple[float, ...]
    weight: float
    memory: float

    def covariance(self, m: int) -> Array:
        r"""Covariance of m equal pieces with the first (m,), without independent noise; its variance 1.

        Notes
        -----
        With :math:`F(t) = \mathrm{Re} \sum A (e^{-zt} - 1 + zt)/z^2`, whose second derivative is the correlation, that
        of the means of pieces k apart goes as :math:`F((k+1)/m) - 2 F(k/m) + F((k-1)/m)`, and F is even.
        """
        if not len(self.rates):
            return np.asarray(np.eye(m)[0], dtype=np.float64)
        twice = self._twice(np.arange(m + 1) / m)
        second = np.diff(np.concatenate((twice[1:2], twice)), n=2)
        return np.asarray(second / second[0], dtype=np.float64)

    def density(self, cycles: float, m: int) -> float:
        """Two-sided density at so many cycles a stretch, of noise with that covariance."""
        if not len(self.rates):
            return 1.0 / m
        omega = REVOLUTION * cycles
        return float(np.sum(2.0 * self.sizes * self.rates / (self.rates**2 + omega**2)).real / self._piece(m))

    def coarser(self, m: int, count: int) -> float:
        """Variance of one of `count` pieces, where that of one of m is 1."""
        return self._piece(count) / self._piece(m) if len(self.rates) else count / m

    def _piece(self, m: int) -> float:
        """Variance of the mean of one of m pieces, of noise of variance 1."""
        return float(2.0 * m**2 * self._twice(np.array([1.0 / m]))[0])

    def _twice(self, t: Array) -> Array:
        """The correlation integrated twice (k,)."""
        turns = self.rates * t[:, None]
        return np.asarray(np.sum(self.sizes * (np.expm1(-turns) + turns) / self.rates**2, axis=-1).real)


@dataclass(frozen=True)
class Forms:
    """All kinds at all their shares of independent noise, for m pieces.

    Parameters
    ----------
    turn : (g, m, m) array
        Rows: axes on which a kind's noise falls apart into independent parts; independent noise does on any.
    ones : (g, m) array
        Ones on these axes.
    kind : (f,) array of int
        Kind of each form.
    variances : (f, m) array
        Variance on each axis.
    half_log : (f,) array
        Half the logarithm of the determinant of the covariance.
    log_weight : (f,) array
        Logarithm of the weight before the data are seen.
    memory : (f,) array
        `_NoiseForm.memory`.
    uneven, unsafe : (f,) array of bool
        Not flat at the lowest frequencies of the stretch (`UNEVEN`); not to be had from batches (`UNSAFE`).
    """

    turn: Array
    ones: Array
    kind: Array
    variances: Array
    half_log: Array
    log_weight: Array
    memory: Array
    uneven: Mask
    unsafe: Mask


@lru_cache(maxsize=1)
def _kinds() -> tuple[_NoiseForm, ...]:
    """Kinds of noise that are weighed; those of first order first, by memory."""
    one = np.ones(1, dtype=np.complex128)
    found = [_NoiseForm(one[:0], one[:0], (0.0,), INDEPENDENT, 0.0)]
    memories = np.geomspace(SHORTEST_MEMORY, LONGEST_MEMORY, MEMORIES)
    found += [_NoiseForm(one, one / float(memory), (0.0,), 1.0, float(memory)) for memory in memories]
    each = SLOW_WEIGHT / len(SLOW) / len(SLOW_WHITE)
    found += [_NoiseForm(one, one / memory, SLOW_WHITE, each, np.nan) for memory in SLOW]
    times = np.geomspace(FINEST, REACH, TIMES).astype(np.complex128)
    for power in POWERS:
        size = times ** (power - 1.0)
        found.append(_NoiseForm(size / size.sum(), 1.0 / times, (0.0,), POWER_WEIGHT / len(POWERS), np.nan))
    each = CYCLES_WEIGHT / len(CYCLES) / len(DAMPING) / len(RING_WHITE)
    for cycles in CYCLES:
        for damping in DAMPING:
            root = np.sqrt(1.0 - damping**2)
            rate = REVOLUTION * cycles * (damping - 1j * root) * one
            found.append(_NoiseForm((1.0 - 1j * damping / root) * one, rate, RING_WHITE, each, np.nan))
    return tuple(found)


def _axes(covariance: Array) -> tuple[Array, Array]:
    r"""Variances (m,) on axes (m, m), in rows, on which m equal pieces fall apart; `covariance` (m,) is with the first.

    Notes
    -----
    The matrix is the same read backwards, so its axes are even or odd about the middle and come from two halves of the
    size [1]_: of :math:`A \pm B J`, with A the first block, B the one beside it, and J turning it over.

    References
    ----------
    .. [1] A. Cantoni, P. Butler, Linear Algebra and its Applications 13 (1976) 275-288, theorem 2.
    """
    m = len(covariance)
    half, odd = divmod(m, 2)
    place = np.arange(half + odd)
    first = covariance[np.abs(place[:, None] - place)]
    crossed = covariance[m - 1 - place[:, None] - place]
    if odd:  # the middle piece is its own mirror
        for block in (first, crossed):
            block[:, -1] *= np.sqrt(0.5)
            block[-1] *= np.sqrt(0.5)
    even, along = np.linalg.eigh(first + crossed)
    uneven, across = np.linalg.eigh((first - crossed)[:half, :half])
    axes = np.zeros((m, m))
    axes[: half + odd, :half] = np.sqrt(0.5) * along[:half].T
    axes[: half + odd, m - half :] = axes[: half + odd, :half][:, ::-1]
    if odd:
        axes[: half + odd, half] = along[half]
    axes[half + odd :, :half] = np.sqrt(0.5) * across.T
    axes[half + odd :, m - half :] = -axes[half + odd :, :half][:, ::-1]
    return np.concatenate((even, uneven)), axes


@lru_cache(maxsize=64)
def forms(m: int) -> Forms:
    """All forms for m pieces."""
    turn, rows = [], []
    for number, kind in enumerate(_kinds()):
        own = kind.covariance(m)
        along, axes = _axes(own)
        turn.append(axes)
        white = np.array(kind.white)
        variances = (1.0 - white[:, None]) * along + white[:, None]
        zero, first = ((1.0 - white) * kind.density(cycles, m) + white / m for cycles in (0.0, 1.0))
        mean = (1.0 - white) * (2.0 * (own @ np.arange(m, 0, -1)) / m - own[0]) / m + white / m
        one = (1.0 - white) * kind.coarser(m, BATCHES) + white * BATCHES / m
        expected = (one - mean) / (BATCHES - 1)
        uneven = np.abs(np.log(zero / first)) > np.log1p(UNEVEN)
        unsafe = np.abs(np.log(expected / mean)) > UNSAFE
        same = (np.full(len(white), each) for each in (number, kind.weight, kind.memory))
        rows.append((*same, variances, uneven, unsafe))
    which, weight, memory, along, uneven, unsafe = (np.concatenate(column) for column in zip(*rows, strict=True))
    turned = np.array(turn)
    half_log = 0.5 * np.log(along).sum(axis=-1)
    return Forms(turned, turned.sum(axis=-1), which, along, half_log, np.log(weight), memory, uneven, unsafe)
