"""Contributions to the uncertainty of a reading, and what they make together."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from pmg.pipeline.wording.probability import CONFIDENCE

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Mask

FEWEST = 1.0
"""Degrees of freedom that stand where none are known: the fewest an estimate can have, so U is rather too large."""


@dataclass(frozen=True)
class Contribution:
    """One contribution to the torque of n points.

    Parameters
    ----------
    key, name : str
        For files, and for people.
    kind : str
        ``A``: from a series of readings; ``B``: from anything else (GUM 2.3.2, 2.3.3).
    distribution : str
        ``t`` or ``rectangular``.
    common : bool
        Whether the points share it: it then does not average out over them.
    divisor : float
        What `value` is divided by to give the standard uncertainty.
    value : (n,) array
        Half-width of a rectangular distribution, or the standard uncertainty itself [N m]; NaN where nothing is
        stated, which adds nothing to the sum.
    dof : (n,) array
        Degrees of freedom; infinite where the value is taken as known, NaN where they are not known.
    remark : str
        Where it is from.
    signed : bool
        Whether a common one follows the sign of the torque, as a gain does; a tare does not.
    """

    key: str
    name: str
    kind: str
    distribution: str
    common: bool
    divisor: float
    value: Array
    dof: Array
    remark: str
    signed: bool = True

    @property
    def u(self) -> Array:
        """Standard uncertainty [N m] (n,)."""
        return np.asarray(self.value / self.divisor)


@dataclass(frozen=True)
class ShaftBudget:
    """The contributions to one shaft's torque at n points.

    Parameters
    ----------
    side : str
        ``sun`` or ``ring``.
    torque : (n,) array
        Mean torque [N m].
    contributions : tuple of Contribution
        In the order shown.
    """

    side: str
    torque: Array
    contributions: tuple[Contribution, ...]

    @property
    def independent(self) -> Array:
        """Standard uncertainty that differs from point to point [N m] (n,); NaN where there is no mean torque."""
        return self._sum([c for c in self.contributions if not c.common])

    @property
    def common(self) -> Array:
        """Standard uncertainty that the points share [N m] (n,)."""
        return self._sum([c for c in self.contributions if c.common])

    @property
    def u(self) -> Array:
        """Combined standard uncertainty [N m] (n,)."""
        return np.hypot(self.independent, self.common)

    @property
    def dof(self) -> Array:
        r"""Effective degrees of freedom :math:`u^4 / \sum_i u_i^4/\nu_i` (n,), GUM equation G.2b.

        A contribution whose degrees of freedom are not known counts with the fewest it can have.
        """
        share = sum(
            (np.nan_to_num(c.u) ** 4 / np.where(c.dof > 0.0, c.dof, FEWEST) for c in self.contributions),
            np.zeros(len(self.torque)),
        )
        return np.asarray(np.divide(self.u**4, share, out=np.full(len(share), np.inf), where=share > 0.0))

    @property
    def factor(self) -> Array:
        """Coverage factor of the 95 % interval, Student's t (n,)."""
        return np.asarray(special.stdtrit(np.minimum(self.dof, 1e9), 0.5 + CONFIDENCE / 2.0))

    @property
    def expanded(self) -> Array:
        """Expanded uncertainty of one reading, 95 % [N m] (n,)."""
        return self.factor * self.u

    def of_mean(self, rows: Mask) -> tuple[float, float]:
        """Standard uncertainties of the mean torque of these points: independent part, and common part [N m].

        The independent part falls with the root of their number. Each common contribution moves all points by its
        own amount at once, so their amounts are averaged before they are squared. NaN of no points.
        """
        count = int(np.count_nonzero(rows))
        if not count:
            return math.nan, math.nan
        sign = np.sign(self.torque[rows])
        independent = float(np.sqrt(np.sum(self.independent[rows] ** 2))) / count
        shared = [
            np.mean((sign if c.signed else 1.0) * np.nan_to_num(c.u[rows])) for c in self.contributions if c.common
        ]
        return independent, float(np.sqrt(np.sum(np.square(shared))))

    def _sum(self, contributions: list[Contribution]) -> Array:
        squares = (np.nan_to_num(c.u) ** 2 for c in contributions)
        return np.asarray(np.sqrt(sum(squares, np.where(np.isnan(self.torque), np.nan, 0.0))))
