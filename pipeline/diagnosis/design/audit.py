"""Detectability of effects in a campaign: before it is run, or after, from its points and its noise alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.diagnosis.design.next_test import distance, longer_problem
from pmg.pipeline.diagnosis.design.plans import Plan, possible_plans
from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE
from pmg.pipeline.diagnosis.engine.separation import ENOUGH, power_to_separate
from pmg.pipeline.diagnosis.grid.candidates import Candidate, CandidateFit, GridProblem, candidates, grid_problem
from pmg.pipeline.diagnosis.grid.catalogue import GridExplanation
from pmg.pipeline.fit.structure import families
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import take_readings

if TYPE_CHECKING:
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array

ALIKE = 0.95
"""Correlation of two signatures, each freed from the baseline, from which on they are look-alikes."""

DIGITS = 6
"""Decimals of a correlation that count in a comparison: those after them are rounding, which the processor decides, and
pairs equal to them stand in the order of the catalogue."""

RESEMBLING = 0.5
"""Correlation from which on a pair that can be separated is shown to people in addition to the look-alikes."""

UNSEEN = 0.999
"""Part of an effect's power that the baseline takes up from which on it cannot be seen at all."""

LARGEST_SCALING = 1e6
"""Sizes beyond this many typical ones are not given: the campaign cannot see it."""


@dataclass(frozen=True)
class Visibility:
    """Detectability of one mechanism.

    Parameters
    ----------
    candidate : Candidate
        The mechanism and its shaft.
    absorbed : float
        Part of its power that the calibrated baseline takes up.
    size_50, size_95 : float
        Smallest root mean square effect that is detected with 50 and 95 % power [N m]; inf where never.
    values_50 : (k,) array
        Its parameters at the former: typical ones, sizes scaled.
    """

    candidate: Candidate
    absorbed: float
    size_50: float
    size_95: float
    values_50: Array

    @property
    def unseen(self) -> bool:
        """Whether these points cannot see it at any size."""
        return self.absorbed > UNSEEN or not math.isfinite(self.size_50)


@dataclass(frozen=True)
class LookAlike:
    """Two mechanisms, or one on either shaft, that leave the same trace or nearly so.

    Parameters
    ----------
    one, other : Candidate
        The pair.
    correlation : float
        Of the first one's trace with the best imitation by the other.
    plan : Plan or None
        The test that would tell them apart; None where none of those known would, or none is needed.
    power : float
        Its power, for effects of three times the size that is detected in half the cases.
    """

    one: Candidate
    other: Candidate
    correlation: float
    plan: Plan | None
    power: float


@dataclass(frozen=True)
class Audit:
    """Detectability of effects in a campaign.

    Parameters
    ----------
    problem : GridProblem
        Its points and noise.
    visible : tuple of Visibility
        Every mechanism on every shaft.
    alike : tuple of LookAlike
        Pairs that these points cannot tell apart, closest first.
    apart : tuple of LookAlike
        All other pairs of what can be seen, closest first: these points tell them apart.
    """

    problem: GridProblem
    visible: tuple[Visibility, ...]
    alike: tuple[LookAlike, ...]
    apart: tuple[LookAlike, ...] = ()

    @property
    def resembling(self) -> tuple[LookAlike, ...]:
        """Those of `apart` that come closest."""
        return tuple(pair for pair in self.apart if pair.correlation >= RESEMBLING)


def audit_design(grid: Grid, bench: BenchParameters, model: LossModel, floor: NoiseFloor) -> Audit:
    r"""Audit a campaign's points; its readings are not looked at.

    Parameters
    ----------
    grid : Grid
        The points, run or planned.
    bench : BenchParameters
        The bench.
    model : LossModel
        Baseline about which effects are taken.
    floor : NoiseFloor
        Noise of one point.

    Notes
    -----
    An effect e is whitened and freed from what curves, K_corr, b, c and d can take up:
    :math:`\lambda = \|(I-P)We\|^2` is the noncentrality it brings. It is detected in half the cases where
    :math:`\sqrt\lambda` equals the normal quantile of the level shared among all structures looked for (Bonferroni),
    and in 95 % at 1.645 above. Mechanisms that are not proportional to their size are scaled up as such all the same.
    """
    readings = take_readings(grid, bench)
    problem = grid_problem(readings, bench, model, whitener(readings, bench, floor))
    looked_for = len(families(readings, bench, model)) + len(candidates())
    threshold = float(stats.norm.isf(0.5 * FALSE_ALARM_RATE / looked_for))
    found = tuple(_visibility(problem, candidate, threshold) for candidate in candidates())
    fits = {seen.candidate: problem.fitted(seen.candidate, seen.values_50) for seen in found if not seen.unseen}
    pairs = _resembling(problem, fits)
    alike = [pair for pair in pairs if pair.correlation >= ALIKE]
    longer = tuple(
        (plan, longer_problem(problem, plan, floor)) for plan in (possible_plans(grid.points, bench) if alike else ())
    )
    apart = tuple(pair for pair in pairs if pair.correlation < ALIKE)
    return Audit(problem, found, tuple(_with_test(pair, fits, longer) for pair in alike), apart)


def _visibility(problem: GridProblem, candidate: Candidate, threshold: float) -> Visibility:
    values = np.array([p.typical for p in candidate.parameters])
    effect = problem.effect(candidate, values)
    whole, seen = problem.white(effect[:, None])[:, 0], problem.beyond_baseline(effect)
    power, left = float(whole @ whole), float(seen @ seen)
    touched = effect[effect != 0.0]
    rms = float(np.sqrt(np.mean(touched**2))) if touched.size else 0.0
    absorbed = 1.0 - left / power if power > 0.0 else 1.0
    if left <= 0.0 or power <= 0.0 or threshold / math.sqrt(left) > LARGEST_SCALING:
        return Visibility(candidate, absorbed, math.inf, math.inf, values)
    scale = threshold / math.sqrt(left)
    at_50 = values.copy()
    at_50[: len(candidate.sizes)] *= scale
    further = (threshold + float(stats.norm.isf(0.05))) / math.sqrt(left)
    return Visibility(candidate, absorbed, scale * rms, further * rms, at_50)


def _resembling(problem: GridProblem, fits: dict[Candidate, CandidateFit]) -> list[LookAlike]:
    """Similarity of the traces of each pair, closest first; of two mechanisms, on the worst shafts."""
    blank = replace(problem, left=np.zeros(len(problem.readings)))
    free = {c: blank.take_out(replace(fit, seen=np.zeros(len(problem.readings)))) for c, fit in fits.items()}
    pairs: dict[frozenset[str], LookAlike] = {}
    for one, fit in fits.items():
        length = float(fit.seen @ fit.seen)
        for other in fits if length > 0.0 else ():
            if one is other or (one.kind is other.kind and "both" in (one.shaft, other.shaft)):
                continue
            same = one.kind is other.kind
            key = frozenset((one.shaft, other.shaft, one.identifier) if same else (one.identifier, other.identifier))
            rest = free[other].beyond_baseline(fit.effect)
            correlation = math.sqrt(max(0.0, 1.0 - float(rest @ rest) / length))
            known = pairs.get(key)
            if known is None or round(correlation, DIGITS) > round(known.correlation, DIGITS):
                pairs[key] = LookAlike(one, other, correlation, None, 0.0)
    return sorted(pairs.values(), key=lambda pair: -round(pair.correlation, DIGITS))


SURE_SIZE = 3.0
"""Effects of this many times the size detected in half the cases are taken to rate a separating test."""


def _with_test(
    pair: LookAlike, fits: dict[Candidate, CandidateFit], longer: tuple[tuple[Plan, GridProblem], ...]
) -> LookAlike:
    """The pair with the shortest test that has enough power, else the one with most."""
    best: tuple[Plan, float] | None = None
    for plan, problem in longer:
        sets = []
        for candidate in (pair.one, pair.other):
            values = fits[candidate].values.copy()
            values[: len(candidate.sizes)] *= SURE_SIZE
            sets.append(GridExplanation((problem.fitted(candidate, values),), problem))
        one = sets[0]
        power = power_to_separate(_imitation(problem, one, sets[1]))
        better = best is None or (plan.seconds < best[0].seconds if min(power, best[1]) >= ENOUGH else power > best[1])
        if better:
            best = plan, power
    if best is None or best[1] < 0.05:
        return pair
    return replace(pair, plan=best[0], power=best[1])


def _imitation(problem: GridProblem, one: GridExplanation, other: GridExplanation) -> float:
    """Noncentrality of one against the other at whatever size imitates it best."""
    seen_one, seen_other = one.fits[0].seen, other.fits[0].seen
    length = float(seen_other @ seen_other)
    scale = float(seen_one @ seen_other) / length if length > 0.0 else 0.0
    fit = other.fits[0]
    values = fit.values.copy()
    values[: len(fit.candidate.sizes)] *= scale
    return distance(problem, one, GridExplanation((problem.fitted(fit.candidate, values),), problem))
