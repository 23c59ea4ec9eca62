"""Effect of the other shaft: loss torque as a function of both speeds against that of the shaft's own speed alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.sim.shafts import PerShaft, other_side, per_shaft

if TYPE_CHECKING:
    from pmg.pipeline.fit.loss_fit import LossFit, LossFits
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

ALIKE = 0.995
"""Correlation, beyond the shaft's own curve, from which two terms are one: these speeds cannot split them."""

NOTHING_LEFT = 1e-3
"""Part of a term's length that the own curve must leave for it to be tested."""

MINIMUM_DOF = 5
"""Degrees of freedom that a test needs."""

LEVEL = 0.01
"""Level of the corrected p-values at which a term counts as found."""

FORMS = (
    ("other speed", "|n_other|"),
    ("other speed squared", "n_other²"),
    ("direction of the difference", "sgn(n_own − n_other)"),
    ("difference", "n_own − n_other"),
    ("direction of the pole slip", "sgn(pole slip)"),
    ("pole slip", "pole slip"),
)
"""Terms that are tried: name, and the torque in words."""


@dataclass(frozen=True)
class PlaneTerm:
    """One dependence added to the curve of a shaft's own speed.

    Parameters
    ----------
    name : str
        What the drag follows.
    form : str
        As a formula in words.
    size, size_u : float
        Drag that the term adds where it is largest on this grid, and its standard error [N m]. NaN where untested.
    share : float
        Root mean square over the readings of what it adds beyond the own curve [N m].
    f : float
        F statistic with 1 and `dof` degrees of freedom.
    dof : int
        Degrees of freedom of the noise.
    p : float
        Its p-value.
    p_holm : float
        The same, corrected by Holm over all tested terms of both shafts.
    alike : str
        Name of an earlier term, or ``own curve``, from which these speeds cannot tell it; empty where tested.
    """

    name: str
    form: str
    size: float
    size_u: float
    share: float
    f: float
    dof: int
    p: float
    p_holm: float
    alike: str = ""

    @property
    def tested(self) -> bool:
        """Whether these speeds carry a test of it."""
        return not self.alike

    @property
    def found(self) -> bool:
        """Whether it is there at 1 %, after correction."""
        return self.tested and self.p_holm < LEVEL


@dataclass(frozen=True)
class PlaneFit:
    """Own-speed curve and all testable terms together, for one shaft.

    Parameters
    ----------
    shaft : str
        ``sun`` or ``ring``.
    terms : tuple of PlaneTerm
        Each term alone added to the curve.
    rmse_line, rmse_plane : float
        Scatter about the curve alone and about the fit in both speeds [N m].
    f, p : float
        F test of all tested terms together, not corrected.
    added : int
        Terms added.
    dof : int
        Degrees of freedom of the fit in both speeds.
    """

    shaft: str
    terms: tuple[PlaneTerm, ...]
    rmse_line: float
    rmse_plane: float
    f: float
    p: float
    added: int
    dof: int


@dataclass(frozen=True)
class PlaneFits(PerShaft[PlaneFit]):
    """Both shafts."""

    @property
    def found(self) -> tuple[tuple[str, PlaneTerm], ...]:
        """Shaft and term of what is there at 1 %."""
        return tuple((fit.shaft, term) for fit in self for term in fit.terms if term.found)


def _holm(p: Array) -> Array:
    r"""p-values (m,) corrected for m tests: :math:`\max_{j \le i} (m - j + 1) p_{(j)}`, at most 1.

    References
    ----------
    S. Holm, 'A simple sequentially rejective multiple test procedure', Scandinavian Journal of Statistics 6, 1979.
    """
    order = np.argsort(p, kind="stable")
    stepped = np.maximum.accumulate((len(p) - np.arange(len(p))) * p[order])
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(stepped, 1.0)
    return corrected


def plane_columns(grid: Grid, fit: LossFit, bench: BenchParameters) -> Array:
    """The terms of `FORMS` as drag at the rows of the fit, each 1 where it is largest (m, 6)."""
    at = grid.points[fit.rows]
    speed = per_shaft(lambda side: np.where(at.rest[side], 0.0, at.speed[side]))
    own, other = speed[fit.shaft], speed[other_side(fit.shaft)]
    slip = bench.pole_slip(at.gear, *speed)
    direction = np.where(own == 0.0, 1.0, np.sign(own))
    difference = own - other
    columns = np.stack(
        [
            np.abs(other),
            other**2,
            direction * np.sign(difference),
            direction * difference,
            direction * np.sign(slip),
            direction * slip,
        ],
        axis=1,
    )
    return np.asarray(columns / np.maximum(np.abs(columns).max(axis=0), 1e-300))


def _plane_fit(grid: Grid, fit: LossFit, bench: BenchParameters) -> PlaneFit:
    root = np.sqrt(fit.weights)
    at = grid.points
    own, rest = at.speed[fit.shaft][fit.rows], at.rest[fit.shaft][fit.rows]
    line = fit.curve.terms(np.where(rest, 0.0, own)) * root[:, None]
    basis, _ = np.linalg.qr(line / np.linalg.norm(line, axis=0))
    left = fit.residuals * root
    left = left - basis @ (basis.T @ left)
    rss, n, k = float(left @ left), len(left), line.shape[1]
    columns = plane_columns(grid, fit, bench) * root[:, None]
    length = np.linalg.norm(columns, axis=0)
    beyond = columns - basis @ (basis.T @ columns)
    terms, kept = _alone(beyond, length, left, n - k - 1)
    left_over, added = rss, 0
    if kept:
        remains = np.linalg.norm(beyond, axis=0)
        vectors, singular, _ = np.linalg.svd(beyond[:, kept] / remains[kept], full_matrices=False)
        joint = vectors[:, singular > 1e-6 * singular[0]]
        added = joint.shape[1]
        left_over = max(rss - float(np.sum((joint.T @ left) ** 2)), 1e-300)
    rest_dof = n - k - added
    together = ((rss - left_over) / added) / (left_over / rest_dof) if added and rest_dof >= MINIMUM_DOF else math.nan
    return PlaneFit(
        fit.shaft,
        terms,
        rmse_line=math.sqrt(rss / (n - k)),
        rmse_plane=math.sqrt(left_over / rest_dof) if rest_dof > 0 else math.nan,
        f=together,
        p=float(stats.f.sf(together, added, rest_dof)) if math.isfinite(together) else math.nan,
        added=added,
        dof=rest_dof,
    )


def _alone(beyond: Array, length: Array, left: Array, dof: int) -> tuple[tuple[PlaneTerm, ...], list[int]]:
    """Each term of `FORMS` tested by itself, and which of them these speeds tell from the curve and from one another.

    Parameters
    ----------
    beyond : (m, 6) array
        What the own curve leaves of the terms, weighted.
    length : (6,) array
        Length of the terms before.
    left : (m,) array
        What the own curve leaves of the readings, weighted.
    dof : int
        Degrees of freedom with one term more.
    """
    remains, rss, n = np.linalg.norm(beyond, axis=0), float(left @ left), len(left)
    kept: list[int] = []
    terms = []
    for i, (name, form) in enumerate(FORMS):
        alike = "own curve" if remains[i] <= NOTHING_LEFT * max(length[i], 1e-300) or dof < MINIMUM_DOF else ""
        for j in kept if not alike else ():
            if abs(float(beyond[:, i] @ beyond[:, j])) > ALIKE * remains[i] * remains[j]:
                alike = FORMS[j][0]
                break
        if alike:
            terms.append(PlaneTerm(name, form, *(math.nan,) * 4, dof, math.nan, math.nan, alike))
            continue
        kept.append(i)
        size = float(beyond[:, i] @ left) / remains[i] ** 2
        explained = size**2 * remains[i] ** 2
        noise = max(rss - explained, 1e-300) / dof
        f = explained / noise
        u, share = math.sqrt(noise) / remains[i], abs(size) * remains[i] / math.sqrt(n)
        terms.append(PlaneTerm(name, form, size, u, share, f, dof, float(stats.f.sf(f, 1, dof)), math.nan))
    return tuple(terms), kept


def plane_fits(grid: Grid, fits: LossFits, bench: BenchParameters) -> PlaneFits:
    r"""Whether a shaft's drag depends on more than its own speed.

    Parameters
    ----------
    grid : Grid
        The grid that the curves were fitted to.
    fits : LossFits
        The curves; their terms, rows and weights are used again.
    bench : BenchParameters
        Pole pairs, for the pole-slip speed :math:`p_s\omega_s + p_r\omega_r`, which vanishes when engaged.

    Notes
    -----
    Beside the own curve, six dependences are tried one by one, as drag :math:`\mathrm{sgn}(\omega)\,T`: on the
    magnitude of the other speed and its square, on the difference of the speeds (direction, as dry friction between the
    shafts, and magnitude, as viscous), and on the pole slip (direction, as hysteresis, and magnitude, as eddy
    currents). With a linear term in the own curve, difference and pole slip come down to the other speed and are one.
    Each has the F test of one added term, :math:`F = (R_0 - R_1) / (R_1/(n - k - 1))`, with the scatter that is left as
    the noise; the p-values are corrected by Holm over both shafts. A term that these speeds cannot tell from an earlier
    one, or from the own curve, is named and not tested. For a robust fit the tests take Huber's weights as given and
    are approximate. Readings that wander together in the order of the test make the p-values too small.
    """
    both = [_plane_fit(grid, fit, bench) for fit in fits]
    tested = [(i, j) for i, fit in enumerate(both) for j, term in enumerate(fit.terms) if term.tested]
    corrected = _holm(np.array([both[i].terms[j].p for i, j in tested]))
    for (i, j), value in zip(tested, corrected, strict=True):
        terms = list(both[i].terms)
        terms[j] = replace(terms[j], p_holm=float(value))
        both[i] = replace(both[i], terms=tuple(terms))
    return PlaneFits(*both)
