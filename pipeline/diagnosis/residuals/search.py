"""Which covariates the residuals of fits follow, the search paid for over all of them, both shafts and all fits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from pmg.pipeline.diagnosis.engine.evidence import Evidence
from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE, search
from pmg.pipeline.diagnosis.grid.locate import same_trace
from pmg.pipeline.diagnosis.residuals.covariates import BY_ID, Look, looks, untested
from pmg.pipeline.diagnosis.residuals.fitted import Fitted, lack_of_fit, linear_fits, outliers
from pmg.pipeline.fit.calibration import start_model
from pmg.pipeline.fit.rounding import unrounded
from pmg.pipeline.fit.whitening import synthetic_noise, undo, whitener
from pmg.pipeline.grid.readings import Readings
from pmg.sim.shafts import SIDES
from pmg.sim.signals import RESIDUAL

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.engine.mismatch import Step
    from pmg.pipeline.diagnosis.residuals.fitted import LackOfFit, Outlier
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.fit.whitening import Whitener
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array

MOST_STEPS = 8
"""Covariates that are taken out one after the other at most."""


@dataclass(frozen=True)
class Followed:
    """One covariate against the residual of one fit, on one shaft.

    Parameters
    ----------
    look : Look
        The covariate on these readings.
    drag : (m,) array
        The part of the residual that follows it, as drag [N m]; NaN where it is not looked at.
    size, size_u : float
        Root mean square of that part over the readings looked at, and its standard uncertainty [N m].
    noise_size : float
        Size that noise alone is expected to give [N m].
    shape : tuple of (where, drag)
        Mean drag [N m] at low, middle and high values of the covariate, or at each sign.
    p_value : float
        Nominal, of this covariate alone added to the fit.
    p_search : float
        Of one as clear anywhere: any covariate, shaft and fit.
    same_trace : tuple of str
        Other covariates that carry more than nine tenths of the part.
    rank : int or None
        Place among those taken out one after the other, clearest first.
    p_beyond : float
        As `p_search`, with every covariate of a smaller rank.
    """

    look: Look
    drag: Array
    size: float
    size_u: float
    noise_size: float
    shape: tuple[tuple[str, float], ...]
    p_value: float
    p_search: float
    same_trace: tuple[str, ...]
    rank: int | None
    p_beyond: float

    @property
    def stands_out(self) -> bool:
        """Whether it does, the search paid for."""
        return self.p_search <= FALSE_ALARM_RATE

    @property
    def words(self) -> str:
        """The covariate, with those that carry the same trace."""
        return " or ".join((self.look.covariate.words, *(BY_ID[name].words for name in self.same_trace)))

    @property
    def shape_description(self) -> str:
        """Its shape, drag in mN m."""
        return ", ".join(f"{RESIDUAL.display(drag):+.2f} at {where}" for where, drag in self.shape)


@dataclass(frozen=True)
class ShaftResidual:
    """Structure in the residual of one fit on one shaft.

    Parameters
    ----------
    fit : Fitted
        The fit, both shafts.
    shaft : str
        ``sun`` or ``ring``.
    lack : LackOfFit
        Scatter against the known noise.
    followed : tuple of Followed
        Every covariate that could be tested, those of a rank first, then by p-value.
    untested : dict
        Covariates that could not, with the reason.
    outliers : tuple of (Outlier, bool)
        Points that stand out, and whether they still do with the ranked covariates in.
    """

    fit: Fitted
    shaft: str
    lack: LackOfFit
    followed: tuple[Followed, ...]
    untested: dict[str, str]
    outliers: tuple[tuple[Outlier, bool], ...]


@dataclass(frozen=True)
class ResidualStudy:
    """All fits of one campaign.

    Parameters
    ----------
    parts : tuple of ShaftResidual
        Fit by fit, sun before ring.
    draws : int
        Synthetic grids behind the p-values of the search.
    """

    parts: tuple[ShaftResidual, ...]
    draws: int

    @property
    def tested(self) -> int:
        """Tests of a covariate, over shafts and fits."""
        return sum(len(part.followed) for part in self.parts)

    @property
    def p_value(self) -> float:
        """Probability of a covariate as clear as the clearest in fits that miss nothing."""
        return min((one.p_search for part in self.parts for one in part.followed), default=1.0)


_Found: TypeAlias = tuple[tuple[Followed, ...], tuple[Look, ...]]


@dataclass(frozen=True)
class _FitEvidence:
    """One fit as evidence, with the covariates that its families stand for."""

    fit: Fitted
    looks: tuple[Look, ...]
    white: Whitener
    evidence: Evidence


def study_residuals(
    analysis: Analysis, bench: BenchParameters, wanted: tuple[str, ...], draws: int, seed: int
) -> ResidualStudy:
    r"""Structure in the residuals of the wanted fits.

    Parameters
    ----------
    analysis : Analysis
        With its noise floor.
    bench : BenchParameters
        Ratio, pole pairs.
    wanted : tuple of str
        Names of `pmg.pipeline.diagnosis.residuals.fitted.FITS`; those that the analysis did not reach are left out.
    draws : int
        Synthetic grids.
    seed : int
        Their seed.

    Notes
    -----
    The machinery of the mismatch test, about other fits: whitened readings, each covariate's columns beyond the design
    against the scatter that follows none, minimum-p over synthetic grids of noise and rounding. A synthetic grid goes
    through all fits, so what they share is paid for once. The clearest joins the fit, the rest is looked at again.
    """
    floor, curves = analysis.floor, analysis.fits
    fits = linear_fits(analysis, bench, wanted)
    if floor is None or curves is None or not fits:
        return ResidualStudy((), draws)
    model = start_model(curves) if analysis.calibration is None else analysis.calibration.model
    whole = _all_readings(fits)
    trials = [_ready(fit, whole, floor, bench, model, draws, seed) for fit in fits]
    alone = [_steps(trial, np.zeros(draws), 1) for trial in trials]
    smallest = [steps[0].smallest if steps else np.zeros(draws) for steps in alone]
    parts: list[ShaftResidual] = []
    for k, trial in enumerate(trials):
        elsewhere = np.min([np.zeros(draws), *smallest[:k], *smallest[k + 1 :]], axis=0)
        steps = _steps(trial, elsewhere)
        found = _followed(trial, steps)
        ranked = [trial.looks[step.best].family.columns for step in steps if step.p_value <= FALSE_ALARM_RATE]
        explained = np.hstack([trial.fit.design[:, :0], *ranked])
        lacks = [(shaft, lack_of_fit(trial.fit, floor, bench, shaft)) for shaft in SIDES]
        parts += [_part(trial, shaft, found, explained, lack) for shaft, lack in lacks]
    return ResidualStudy(tuple(parts), draws)


def _steps(trial: _FitEvidence, elsewhere: Array, most: int = MOST_STEPS) -> list[Step]:
    """The search through one fit, paid for together with the others; repeats have a test of their own."""
    if not trial.looks:
        return []
    return list(search(trial.evidence, steps=most, level=FALSE_ALARM_RATE, elsewhere=elsewhere))


def _keys(readings: Readings) -> Array:
    return np.asarray(2 * readings.row + ~readings.sun)


def _all_readings(fits: tuple[Fitted, ...]) -> Readings:
    """Every reading that any of the fits uses, once."""
    keys = np.unique(np.concatenate([_keys(fit.readings) for fit in fits]))
    grid = fits[-1].readings.grid
    row, sun = keys // 2, keys % 2 == 0
    torque = np.where(sun, grid.torque_sun[row], grid.torque_ring[row])
    return Readings(grid, row, sun, torque, np.where(sun, grid.u_sun[row], grid.u_ring[row]))


def _ready(
    fit: Fitted, whole: Readings, floor: NoiseFloor, bench: BenchParameters, model: LossModel, draws: int, seed: int
) -> _FitEvidence:
    """The fit with its share of the synthetic grids, the same for every fit but for their fitted torques."""
    readings = fit.readings
    white, white_whole = whitener(readings, bench, floor), whitener(whole, bench, floor)
    index = np.searchsorted(_keys(whole), _keys(readings))
    found = looks(readings, bench, model)
    fitted = whole.torque.copy()
    structure = np.hstack([fit.design[:, :0], *(look.family.columns for look in found)])
    floor, fitted[index] = unrounded(readings, floor, fit.design, structure, fit.residual, white.scale)
    drawn = synthetic_noise(whole, floor, white_whole, draws, np.random.default_rng(seed), fitted=fitted)
    evidence = Evidence(
        y=white(fit.residual[:, None])[:, 0],
        baseline=white(fit.design),
        families=[white(look.family.columns) for look in found],
        groups=tuple(readings.of_shaft),
        null=white(undo(white_whole, drawn)[index]),
    )
    return _FitEvidence(fit, found, white, evidence)


def _followed(trial: _FitEvidence, steps: list[Step]) -> _Found:
    """Every covariate with what follows it, and those of which the fit leaves nothing."""
    if not steps:
        return (), ()
    first, last = steps[0], steps[-1]
    rank = {step.best: (number, step) for number, step in enumerate(steps, 1) if step.p_value <= FALSE_ALARM_RATE}
    families, found, absorbed = tuple(look.family for look in trial.looks), [], []
    for i, look in enumerate(trial.looks):
        basis = first.scan.bases[i]
        if basis.shape[1] == 0:
            absorbed.append(look)
            continue
        along = basis @ (basis.T @ trial.evidence.y)
        drag = np.where(look.rows, undo(trial.white, along) * trial.fit.readings.direction, np.nan)
        n, noise = int(look.rows.sum()), math.sqrt(float(np.mean(trial.white.scale[look.rows] ** 2)))
        carriers = same_trace(families, first.scan, i, along)
        number, step = rank.get(i, (None, last))
        found.append(
            Followed(
                look=look,
                drag=drag,
                size=math.sqrt(float(np.mean(drag[look.rows] ** 2))),
                size_u=noise / math.sqrt(n),
                noise_size=noise * math.sqrt(basis.shape[1] / n),
                shape=look.shape(drag),
                p_value=math.exp(first.nominal[i]),
                p_search=first.corrected(i),
                same_trace=tuple(dict.fromkeys(trial.looks[j].covariate.id for j in carriers)),
                rank=number,
                p_beyond=step.corrected(i),
            )
        )
    return tuple(sorted(found, key=lambda one: (one.rank or MOST_STEPS + 1, one.p_value))), tuple(absorbed)


def _part(trial: _FitEvidence, shaft: str, found: _Found, explained: Array, lack: LackOfFit) -> ShaftResidual:
    """One shaft's share of a fit."""
    followed, absorbed = found
    beyond = {one.row for one in outliers(trial.fit, shaft, explained)}
    return ShaftResidual(
        trial.fit,
        shaft,
        lack,
        tuple(one for one in followed if one.look.family.signal == f"torque_{shaft}"),
        untested(trial.fit.readings, trial.looks, absorbed, shaft),
        tuple((one, one.row in beyond) for one in outliers(trial.fit, shaft)),
    )
