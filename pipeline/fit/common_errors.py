"""Errors that the points of a campaign share: transducers, fitted curves, correction factor and damping constants."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.calibration import jacobian, parameter_names
from pmg.pipeline.fit.span import orthonormal
from pmg.pipeline.grid.readings import take_readings
from pmg.pipeline.grid.transducer_uncertainty import CommonParts, common_parts
from pmg.sim.shafts import PerShaft, on_side

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.pipeline.fit.loss_fit import LossFit, LossFits
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array, Mask

TRANSDUCERS, CURVES, CORRECTION, DAMPING = "transducers", "curves", "K_corr", "damping"
"""Groups of common inputs."""


@dataclass(frozen=True)
class TransducerCause(PerShaft["Array"]):
    """One common error of a transducer: what one standard uncertainty of it adds to the readings [N m], (n,) each."""

    name: str


@dataclass(frozen=True)
class CommonErrorSources:
    """Common causes of n points, and how their own readings move what was fitted.

    Parameters
    ----------
    parameters : tuple of str
        Names of the k fitted parameters, as `FittedBaseline` names them.
    groups : tuple of (group, indices)
        Which parameters belong together.
    root : (k, r) array
        Effect of r unit causes on the parameters: a root of their covariance from the scatter of the readings.
    transducers : tuple of TransducerCause
        The t errors of the transducers, common to all readings.
    moved : (k, t) array
        What each of them does to the parameters.
    influence : tuple of two (k, n) arrays
        What one newton metre more of a point's reading, sun and ring, does to the parameters.
    u : tuple of two (n,) arrays
        Standard uncertainty of the readings, independent from point to point [N m].
    fitted : bool
        Whether K_corr was fitted; held otherwise.
    """

    parameters: tuple[str, ...]
    groups: tuple[tuple[str, npt.NDArray[np.intp]], ...]
    root: Array
    transducers: tuple[TransducerCause, ...]
    moved: Array
    influence: tuple[Array, Array]
    u: tuple[Array, Array]
    fitted: bool

    def __getitem__(self, rows: Mask | npt.NDArray[np.intp]) -> CommonErrorSources:
        """The same for the chosen points."""
        return replace(
            self,
            transducers=tuple(
                TransducerCause(cause.sun[rows], cause.ring[rows], cause.name) for cause in self.transducers
            ),
            influence=(self.influence[0][:, rows], self.influence[1][:, rows]),
            u=(self.u[0][rows], self.u[1][rows]),
        )

    def standard_errors(self) -> dict[str, tuple[float, float]]:
        """Of each parameter: standard uncertainty from the scatter of the readings, and from the transducers."""
        scatter, common = np.linalg.norm(self.root, axis=1), np.linalg.norm(self.moved, axis=1)
        return {name: (float(scatter[i]), float(common[i])) for i, name in enumerate(self.parameters)}


def transducer_causes(grid: Grid, bench: BenchParameters | None = None) -> tuple[TransducerCause, ...]:
    r"""The transducers' common errors at every row of a grid.

    Parameters
    ----------
    grid : Grid
        Its ``common_sun`` and ``common_ring`` are what each reading may be off by.
    bench : BenchParameters, optional
        Tolerances: the sensitivity's part of it is the same factor for every reading. Without them all is taken so.

    Notes
    -----
    What goes beyond the sensitivity is non-linearity. It is taken as one error for all engaged readings and another
    for all neutral ones, with the sign of the torque: the data sheet does not tell its course, and readings at a few
    hundredths of the range need not share it with those under load. The tare is one error for all, of either sign.
    """
    nothing, causes = np.zeros(len(grid)), []
    for shaft, torque in grid.torque.items():
        signed = np.sign(torque)
        none = CommonParts(grid.common[shaft], nothing, nothing)
        parts = none if bench is None else common_parts(grid, bench, shaft)
        found = [(f"sensitivity of the {shaft} transducer", signed * parts.sensitivity)]
        for where, rows in (("under load", grid.points.engaged), ("in neutral", ~grid.points.engaged)):
            course = np.where(rows, signed * parts.linearity, 0.0)
            found.append((f"linearity of the {shaft} transducer {where}", course))
        found.append((f"tare of the {shaft} transducer", parts.tare))
        for name, shift in found:
            if shift.any():
                effect = on_side(shaft, shift, nothing)
                causes.append(TransducerCause(effect.sun, effect.ring, name))
    return tuple(causes)


def causes_of_fits(grid: Grid, fits: LossFits, bench: BenchParameters | None = None) -> CommonErrorSources:
    """Common causes where K_corr is held and the curves are those of the neutral points.

    Parameters
    ----------
    grid : Grid
        The points.
    fits : LossFits
        The curves.
    bench : BenchParameters, optional
        Tolerances of the transducers. Without it the curves are taken as fitted to other readings than these, so that
        neither the transducers nor a point's own reading move them.
    """
    k_sun, k_ring = len(fits.sun.curve.powers), len(fits.ring.curve.powers)
    n, k = len(grid), k_sun + k_ring
    influence = np.zeros((k, n)), np.zeros((k, n))
    if bench is not None:
        at = grid.points
        influence[0][:k_sun] = _response(fits.sun, at.speed_sun, at.rest_sun)
        influence[1][k_sun:] = _response(fits.ring, at.speed_ring, at.rest_ring)
    root = np.zeros((k, k))
    root[:k_sun, :k_sun], root[k_sun:, k_sun:] = _root(fits.sun.covariance), _root(fits.ring.covariance)
    names = [f"sun[{p:g}]" for p in fits.sun.curve.powers] + [f"ring[{p:g}]" for p in fits.ring.curve.powers]
    return _causes(tuple(names), root, influence, grid, transducer_causes(grid, bench), fitted=False)


NO_WEIGHT = 1e-6
"""Root of the weight of a reading that a bisquare fit leaves out, for the division by it."""


def causes_of_calibration(grid: Grid, calibration: FittedBaseline, bench: BenchParameters) -> CommonErrorSources:
    r"""Common causes of the points of the grid that a calibration was made from.

    Notes
    -----
    Near the solution the parameters are linear in the readings, :math:`\delta\theta = (J^TWJ)^{-1}J^TW\,\delta r`.
    This carries a transducer's error into curves and constants, and correlates a point with the fit it took part in.
    Where the readings scatter by more than their uncertainty, the covariance is inflated as in
    `pmg.pipeline.fit.correction`, but not for what the transducers' tolerances :math:`s_t` alone let expect, which is
    counted by itself: :math:`\mathrm{E}[\chi^2] = \nu + \sum_t \|(I-P)Ws_t\|^2`. A parameter on its bound
    contributes what it may still be.
    """
    readings = take_readings(grid, bench)
    model, free = calibration.model, calibration.free
    names = parameter_names(model, free)
    inside = np.array([i for i, name in enumerate(names) if name not in calibration.on_bound], dtype=np.intp)
    root_weight = np.ones(len(readings)) if calibration.weights is None else np.sqrt(calibration.weights)
    u = readings.u / np.maximum(root_weight, NO_WEIGHT)
    weighted = jacobian(readings, bench, model, free)[:, inside] / u[:, None]
    length = np.linalg.norm(weighted, axis=0)
    response = np.zeros((len(names), len(readings)))
    response[inside] = np.linalg.pinv(weighted / length) / length[:, None] / u
    at, row, sun = grid.points, readings.row, readings.sun
    ratio = bench.ratio(at.gear)
    influence = np.zeros((len(names), len(grid))), np.zeros((len(names), len(grid)))
    influence[0][:, row[sun]] = response[:, sun]
    influence[1][:, row[~sun]] = response[:, ~sun]
    loaded = sun & at.engaged[row]
    influence[1][:, row[loaded]] -= response[:, loaded] / ratio[row[loaded]]
    transducers = transducer_causes(grid, bench)
    basis = orthonormal(weighted)
    expected = float(calibration.dof)
    for cause in transducers:
        of_ring = cause.ring[row] / ratio[row]
        shift = np.where(sun, cause.sun[row] - np.where(loaded, of_ring, 0.0), cause.ring[row]) / u
        expected += float(np.sum((shift - basis @ (basis.T @ shift)) ** 2))
    scale = math.sqrt(max(1.0, calibration.chi_square / expected)) if calibration.dof > 0 else 1.0
    root = scale * _root(calibration.moments)
    return _causes(names, root, influence, grid, transducers, fitted=CORRECTION in free)


def _causes(
    names: tuple[str, ...],
    root: Array,
    influence: tuple[Array, Array],
    grid: Grid,
    transducers: tuple[TransducerCause, ...],
    *,
    fitted: bool,
) -> CommonErrorSources:
    # Only of readings that took part: those of a rejected window may be no numbers at all.
    took = tuple(each.any(axis=0) for each in influence)
    shifts = [(np.where(took[0], cause.sun, 0.0), np.where(took[1], cause.ring, 0.0)) for cause in transducers]
    moved = (
        np.stack([influence[0] @ sun + influence[1] @ ring for sun, ring in shifts], axis=-1)
        if transducers
        else np.zeros((len(names), 0))
    )
    groups = []
    for group in (CURVES, CORRECTION, DAMPING):
        members = np.array([i for i, name in enumerate(names) if _group(name) == group], dtype=np.intp)
        if len(members):
            groups.append((group, members))
    return CommonErrorSources(
        names, tuple(groups), root, transducers, moved, influence, (grid.u_sun, grid.u_ring), fitted
    )


def _group(name: str) -> str:
    return CURVES if "[" in name else CORRECTION if name == CORRECTION else DAMPING


def _root(covariance: Array) -> Array:
    """A matrix whose product with its transpose is the covariance; of rows that are known to be zero, zero."""
    scale = np.sqrt(np.diag(covariance))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(safe, safe))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _response(fit: LossFit, speed: Array, rest: Mask) -> Array:
    """Change of a curve's coefficients per change of each row's torque (k, n)."""
    rows = fit.rows
    terms = fit.curve.terms(np.where(rest, 0.0, speed)[rows])
    root = np.sqrt(fit.weights)
    direction = np.where(rest, 1.0, np.sign(speed))[rows]
    found = np.zeros((terms.shape[1], len(speed)))
    found[:, rows] = np.linalg.pinv(terms * root[:, None]) * root * direction
    return found
