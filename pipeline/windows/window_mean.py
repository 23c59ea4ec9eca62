"""Error of the mean of a short stretch of correlated noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from pmg.pipeline.windows.noise_models import forms
from pmg.sim.sources import Source

if TYPE_CHECKING:
    from pmg.sim.signals import Array

BERGER_YANG = Source(
    "berger-yang",
    "J. O. Berger, R.-Y. Yang, 'Noninformative priors and Bayesian testing for the AR(1) model', Econometric Theory "
    "10(3-4), 1994",
)

FEWEST_PIECES = 8
"""Pieces below which nothing is said about correlation."""
NEGLIGIBLE = 1e-5
"""Weight below which a form of the noise is left out."""
EXACT = 1e-12
"""Part of itself to which the half-width of an interval is found."""
SLACK = 1e-9
"""Part by which its bounds are set apart, so that rounding leaves it between them."""


_ONE_SIGMA = 0.6826894921370859


@dataclass(frozen=True)
class SerialMean:
    """The uncertainty of a mean in the presence of correlation.

    Parameters
    ----------
    memory : float
        Correlation time as part of the stretch, the median of what the data leave possible to noise of first order.
    uneven : float
        Weight of the forms whose density is not flat at the lowest frequencies of the stretch (`UNEVEN`): as part of
        one, how sure it is that what lies below these frequencies, which the stretch does not show, matters.
    unsafe : float
        Weight of the forms under which batches do not give the variance of the mean (`UNSAFE`).
    weight, off, scale : (f,) array
        The forms that matter, each a Student's t: its weight, how far its mean is off the plain one, its scale.
    most : int
        Degrees of freedom of each of them.
    """

    memory: float
    uneven: float
    unsafe: float
    weight: Array
    off: Array
    scale: Array
    most: int

    @property
    def u(self) -> float:
        """Half of the interval that holds 68.3 % over the quantile of Student's t: a standard uncertainty."""
        return self._half_width[0] / float(special.stdtrit(self.dof, 0.5 + _ONE_SIGMA / 2.0))

    @cached_property
    def dof(self) -> float:
        """Degrees of freedom with which `u` gives the 95 % interval as well."""
        inner, outer = self._half_width
        return _dof_of(outer / inner, self.most)

    @cached_property
    def _half_width(self) -> tuple[float, float]:
        """Half-widths that hold 68.3 % and 95 % of the mixture; only found where they are asked for, in few windows."""
        inner, outer = (
            _half_width(level, self.weight, self.off, self.scale, self.most) for level in (_ONE_SIGMA, 0.95)
        )
        return inner, outer


def serial_mean(pieces: Array) -> SerialMean | None:
    r"""Uncertainty of the mean of equal consecutive pieces of a stretch.

    Parameters
    ----------
    pieces : (m,) array
        Mean of each piece.

    Returns
    -------
    SerialMean or None
        None with fewer than `FEWEST_PIECES`, or where all are equal.

    Notes
    -----
    The noise may be of first order, slow plus independent noise, of a power law of frequency, or a resonance
    (`forms`). For each form the truth given the pieces follows Student's t with m - 1 degrees of freedom about the
    generalised mean; the forms are weighed by :math:`|C|^{-1/2} (1^T C^{-1} 1)^{-1/2} S^{-(m-1)/2}`, the likelihood
    with mean and size integrated out, times their weight before. The interval is that of the mixture, laid about the
    plain mean. A form of which little is known widens it, which a single estimate would not do. What lies below one
    cycle in the stretch is the forms' word, not the data's: where it matters, `uneven` is large.

    References
    ----------
    `BERGER_YANG`; their prior of the memory is replaced by one that is even in its logarithm, within bounds.
    """
    m = len(pieces)
    if m < FEWEST_PIECES or not np.ptp(pieces) > 0.0:
        return None
    known = forms(m)
    axes = (known.turn @ (pieces - float(pieces.mean())))[known.kind]
    ones = known.ones[known.kind] / known.variances
    precision = np.sum(known.ones[known.kind] * ones, axis=-1)
    off = np.sum(ones * axes, axis=-1) / precision
    rest = np.sum((axes - off[:, None] * known.ones[known.kind]) ** 2 / known.variances, axis=-1)
    log_weight = known.log_weight - known.half_log - 0.5 * np.log(precision) - 0.5 * (m - 1) * np.log(rest)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    scale = np.sqrt(rest / (m - 1) / precision)
    kept = weight > NEGLIGIBLE
    return SerialMean(
        memory=_median_memory(known.memory, log_weight),
        uneven=float(weight[known.uneven].sum()),
        unsafe=float(weight[known.unsafe].sum()),
        weight=weight[kept],
        off=off[kept],
        scale=scale[kept],
        most=m - 1,
    )


def _median_memory(memory: Array, log_weight: Array) -> float:
    """Median of the memories by their weights, of the forms that have one."""
    first = np.isfinite(memory)
    weight = np.exp(log_weight[first] - log_weight[first].max())
    return float(np.interp(0.5, np.cumsum(weight / weight.sum()), memory[first]))


def _half_width(level: float, weight: Array, off: Array, scale: Array, dof: int) -> float:
    """Half-width about zero that holds this part of a mixture of Student's t, by the Illinois rule of false position.

    It lies between the least and the largest of its parts; `scipy.optimize` takes a tenth of a second to be loaded.
    """
    whole = float(weight.sum())

    def lacks(half: float) -> float:
        inside = special.stdtr(dof, (half - off) / scale) - special.stdtr(dof, (-half - off) / scale)
        return float(weight @ inside) - level * whole

    own = float(special.stdtrit(dof, (1.0 + level) / 2.0)) * scale
    far, half = float(own.min()) * (1.0 - SLACK), float(np.max(own + np.abs(off))) * (1.0 + SLACK)
    lacks_far, lacks_half = lacks(far), lacks(half)
    while abs(half - far) > EXACT * half and lacks_half != 0.0:
        next_half = half - lacks_half * (half - far) / (lacks_half - lacks_far)
        lacks_next = lacks(next_half)
        far, lacks_far = (half, lacks_half) if lacks_next * lacks_half < 0.0 else (far, lacks_far / 2.0)
        half, lacks_half = next_half, lacks_next
    return half


def _dof_of(ratio: float, most: int) -> float:
    """Degrees of freedom at which the 95 % half-width of Student's t is that many times the 68.3 % one."""
    dof = np.geomspace(1.0, most, 200)
    ratios = special.stdtrit(dof, 0.975) / special.stdtrit(dof, 0.5 + _ONE_SIGMA / 2.0)
    return float(np.interp(-ratio, -ratios, dof))
