"""Loss torque of a shaft against its speed: a sum of powers, as fitted to the neutral tests."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pmg.sim.signals import RPM, Array, Number

SPEED_REFERENCE_SUN = 1872.0 * RPM
"""Highest sun speed of the published campaign [rad/s]; scales the fit only."""

SPEED_REFERENCE_RING = 720.0 * RPM
"""Highest ring speed of the published campaign [rad/s]; scales the fit only."""


@dataclass(frozen=True)
class LossCurve:
    r"""Loss torque B(w) of one shaft [N m], a magnitude.

    Parameters
    ----------
    powers : tuple of float
        Exponents p_k of the speed; 0 is the constant, 1/2 is allowed.
    coefficients : (k,) array
        Coefficients a_k [N m].
    speed_reference : float
        Speed w_0 that makes the terms dimensionless [rad/s].
    speed_limit : float
        Highest speed with data [rad/s]; beyond it the curve goes on along its tangent.

    Notes
    -----
    :math:`B(\omega) = \sum_k a_k\,(|\omega|/\omega_0)^{p_k}`. A polynomial of degree four turns down soon after
    its last point, and a negative drag would drive a shaft; hence the tangent.
    """

    powers: tuple[float, ...]
    coefficients: Array
    speed_reference: float
    speed_limit: float

    def _terms(self, x: Number) -> list[Number]:
        """The powers of the dimensionless speed magnitude `x`, each carried on along its tangent."""
        x_limit = self.speed_limit / self.speed_reference
        inside = np.minimum(x, x_limit)
        beyond = x - inside
        return [inside**p + (p * x_limit ** (p - 1.0) if p else 0.0) * beyond for p in self.powers]

    def terms(self, speed: Array) -> Array:
        """Design matrix (n, k): the powers of the dimensionless speed."""
        return np.stack(self._terms(np.abs(np.asarray(speed, dtype=np.float64)) / self.speed_reference), axis=-1)

    def law(self, magnitude: Number) -> Number:
        """Loss torque [N m] at a speed's magnitude [rad/s]: a float, a complex number or an array."""
        terms = self._terms(magnitude / self.speed_reference)
        return sum(a * term for a, term in zip(self._floats, terms, strict=True))

    def torque(self, speed: Array) -> Array:
        """Magnitude of the loss torque [N m] at the given speeds [rad/s]."""
        return np.asarray(self.terms(speed) @ self.coefficients)

    @cached_property
    def _floats(self) -> list[float]:
        return list(self.coefficients.tolist())
