"""Least-squares fits of the neutral loss torques, shaft by shaft, with the terms the user chooses."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import FitError
from pmg.sim.losscurve import SPEED_REFERENCE_RING, SPEED_REFERENCE_SUN, LossCurve

if TYPE_CHECKING:
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array, Mask

DEFAULT_POWERS = (0.0, 0.5, 1.0, 2.0)
"""Constant (seals, hysteresis), root (lubricated bearings), linear (viscous, eddy) and square (windage) term.

On drag that grows like a power of speed between 0.3 and 0.7, these four stay within 0.05 mN m where the thesis's
polynomials of degree three and four leave 0.3 to 1 mN m."""

THESIS_POWERS_SUN = (0.0, 1.0, 2.0, 3.0)
"""Sun curve that reproduces the thesis's simulated torques best."""

THESIS_POWERS_RING = (0.0, 1.0, 2.0, 3.0, 4.0)
"""Ring curve that reproduces the thesis's simulated torques best."""


ALIKE = 1e-8
"""Ratio of singular values (columns of unit length) below which two terms cannot be told apart."""


@dataclass(frozen=True)
class LossFit:
    """A fitted loss curve and how good it is.

    Parameters
    ----------
    shaft : str
        ``sun`` or ``ring``.
    curve : LossCurve
        The curve [N m].
    covariance : (k, k) array
        Covariance of its coefficients [N m squared], from the scatter about the curve.
    residuals : (m,) array
        Measured minus fitted drag [N m], at the rows used.
    rows : (n,) array of bool
        Rows of the grid that were used.
    r_squared : float
        Coefficient of determination.
    rmse : float
        Root of the residual sum of squares over the degrees of freedom [N m].
    error_thesis : float
        The thesis's own measure, equation 4.1: sqrt(sum of squares)/n [N m].
    aicc : float
        Akaike's criterion, corrected for small samples (Burnham and Anderson 2002, section 2.4).
    """

    shaft: str
    curve: LossCurve
    covariance: Array
    residuals: Array
    rows: Mask
    r_squared: float
    rmse: float
    error_thesis: float
    aicc: float

    @property
    def standard_errors(self) -> Array:
        """Standard errors of the coefficients [N m]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def dof(self) -> int:
        """Degrees of freedom left."""
        return len(self.residuals) - len(self.curve.powers)


@dataclass(frozen=True)
class LossFits:
    """The two curves that the neutral tests give."""

    sun: LossFit
    ring: LossFit


def check_powers(powers: tuple[float, ...]) -> tuple[float, ...]:
    """The exponents in rising order; a `FitError` where they cannot be terms of a curve."""
    if not powers or len(set(powers)) < len(powers) or min(powers) < 0.0 or not np.isfinite(powers).all():
        raise FitError(
            "loss fit terms",
            ", ".join(f"{p:g}" for p in powers) or "none",
            "distinct exponents of the speed, none below 0, such as 0,0.5,1,2",
            "Choose the terms anew.",
        )
    return tuple(sorted(powers))


def _fit_one(shaft: str, speed: Array, drag: Array, rows: Mask, powers: tuple[float, ...], scale: float) -> LossFit:
    n, k = int(rows.sum()), len(powers)
    levels = len(np.unique(np.round(np.abs(speed[rows]), 1))) if n else 0
    if n <= k + 1 or levels < k:
        raise FitError(
            f"loss fit of the {shaft}",
            f"{n} neutral points at {levels} speeds",
            f"at least {k + 2} points at {k} speeds or more for {k} terms",
            "Measure more speeds, or choose fewer terms.",
        )
    curve = LossCurve(powers, np.zeros(k), scale, float(np.abs(speed[rows]).max()))
    design, measured = curve.terms(speed[rows]), drag[rows]
    coefficients, _, rank, _ = np.linalg.lstsq(design, measured, rcond=None)
    if rank < k:
        raise FitError(
            f"loss fit of the {shaft}",
            f"rank {rank}",
            f"rank {k}",
            "Choose fewer terms: these are alike here.",
        )
    length = np.linalg.norm(design, axis=0)
    _, singular, right = np.linalg.svd(design / length, full_matrices=False)
    if singular[-1] < ALIKE * singular[0]:
        raise FitError(
            f"loss fit of the {shaft}",
            f"{k} terms that are alike over these speeds",
            "terms that can be told apart",
            "Choose fewer terms, or powers further apart.",
        )
    inverse = right.T / singular
    covariance = (inverse @ inverse.T) / np.outer(length, length)
    residuals = measured - design @ coefficients
    rss = float(residuals @ residuals)
    about_mean = float(np.sum((measured - measured.mean()) ** 2))
    aicc = math.nan
    if n > k + 2 and rss > 0.0:
        aicc = n * math.log(rss / n) + 2.0 * (k + 1) + 2.0 * (k + 1) * (k + 2) / (n - k - 2)
    return LossFit(
        shaft=shaft,
        curve=replace(curve, coefficients=np.asarray(coefficients, dtype=np.float64)),
        covariance=covariance * rss / (n - k),
        residuals=residuals,
        rows=rows,
        r_squared=1.0 - rss / about_mean if about_mean > 0.0 else math.nan,
        rmse=math.sqrt(rss / (n - k)),
        error_thesis=math.sqrt(rss) / n,
        aicc=aicc,
    )


def fit_losses(
    grid: Grid,
    powers_sun: tuple[float, ...] = DEFAULT_POWERS,
    powers_ring: tuple[float, ...] = DEFAULT_POWERS,
    *,
    include_rest: bool = False,
) -> LossFits:
    r"""Loss curves :math:`T_{bs}(n_s)` and :math:`T_{br}(n_r)` of the neutral points.

    Parameters
    ----------
    grid : Grid
        Measured torques; its accepted neutral rows are used, each with equal weight, because the wander between
        points outweighs what differs from window to window.
    powers_sun, powers_ring : tuple of float
        Exponents of the speed; 0.5 is allowed.
    include_rest : bool
        Use the readings of a shaft at rest too. They are static reactions, not drag, so the default leaves them
        out; the thesis's curves come out with them in.

    Raises
    ------
    FitError
        Too few points or speeds for the terms, or terms that these speeds cannot tell apart.

    Notes
    -----
    Ordinary least squares (thesis, section 4.2.3) of the drag :math:`\mathrm{sgn}(\omega)\,T`.
    """
    at = grid.points
    use = at.neutral & grid.accepted
    fits = []
    for shaft, speed, torque, rest, powers, scale in (
        ("sun", at.speed_sun, grid.torque_sun, at.rest_sun, powers_sun, SPEED_REFERENCE_SUN),
        ("ring", at.speed_ring, grid.torque_ring, at.rest_ring, powers_ring, SPEED_REFERENCE_RING),
    ):
        direction = np.where(rest, 1.0, np.sign(speed))
        rows = use if include_rest else use & ~rest
        fits.append(_fit_one(shaft, np.where(rest, 0.0, speed), direction * torque, rows, check_powers(powers), scale))
    return LossFits(sun=fits[0], ring=fits[1])
