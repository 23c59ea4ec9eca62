"""A short form for what no mechanism explains: chosen, fitted and proved on readings it has not seen.

What is found is a shape, not physics: it describes where readings lie, and names no cause.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.held_out import compared, gain_interval, solve, touched_blocks
from pmg.pipeline.diagnosis.form.atoms import levels
from pmg.pipeline.diagnosis.form.covariates import covariates_of, rows_of
from pmg.pipeline.diagnosis.form.grammar import text_of
from pmg.pipeline.diagnosis.form.problem import Problem, choose, placebo_errors, whole_view, withheld_errors
from pmg.pipeline.diagnosis.form.search import FormFit, View, make_library, search
from pmg.pipeline.diagnosis.form.shape import Constant, Shape
from pmg.pipeline.diagnosis.grid.locate import located_families
from pmg.pipeline.diagnosis.grid.withheld import STRUCTURE_FOLDS, deal

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.candidates import GridProblem
    from pmg.pipeline.diagnosis.grid.locate import Location
    from pmg.sim.signals import Array

SMOOTH_SHARE = 0.5
"""Part of what the families' smooth columns predict of withheld readings that a form must predict to be named."""

PLACEBOS = 3
"""Exchanges of the covariates behind the placebo: one alone may by chance lie near the true order."""

MINIMUM_READINGS = 24
"""Readings of a location below which no form is looked for."""


def find_shape(whole: GridProblem, locations: tuple[Location, ...], rng: np.random.Generator) -> Shape | None:
    """A short form for the clearest location, where one holds up.

    Parameters
    ----------
    whole : GridProblem
        All readings, with the baseline free.
    locations : tuple of Location
        Clearest first. What the others follow in other signals and configurations joins the baseline.
    rng : numpy.random.Generator
        Exchanges blocks and resamples them.

    Returns
    -------
    Shape or None
        None where no form holds up, or the clearest location has too few readings or follows no covariate.
    """
    place = locations[0]
    readings = whole.readings
    rows = np.flatnonzero(rows_of(place, readings))
    covariates = covariates_of(place, readings, whole.bench, whole.model)
    if place.depends_on == ("point",) or len(rows) < MINIMUM_READINGS or not covariates:
        return None
    here = (place.signal, place.configuration)
    others = tuple(other for other in locations if (other.signal, other.configuration) != here)
    block, fold = deal(readings, STRUCTURE_FOLDS)
    as_drag = place.covariates != ("direction",)
    problem = Problem(
        left=readings.torque - whole.predicted,
        baseline=np.hstack([whole.columns, located_families(readings, whole.bench, whole.model, others)]),
        white=whole.white,
        rows=rows,
        sign=readings.direction[rows] if as_drag else np.ones(len(rows)),
        covariates=covariates,
        smooth=located_families(readings, whole.bench, whole.model, (place,)),
        block=block,
        fold=fold,
    )
    found = _hold_up(problem, rng)
    if found is None:
        return None
    return replace(found, signal=place.signal, configuration=place.configuration, as_drag=as_drag)


def _hold_up(problem: Problem, rng: np.random.Generator) -> Shape | None:
    """The best form of a problem, where it holds up on withheld readings.

    Notes
    -----
    For every fold the form is chosen among all, and fitted with the baseline, without the withheld readings. A form
    is reported when it is worth its constants on all readings, the 95 % interval of the fall of the withheld error lies
    above zero, it predicts at least `SMOOTH_SHARE` of what the family's smooth columns predict (in squares), half of
    the folds choose a form of the same covariates, and a placebo, the same search with the covariates of whole blocks
    exchanged, gains nothing that its own interval tells from zero.
    """
    library = make_library(problem.covariates)
    view = whole_view(problem)
    leading = search(view, library)
    if not leading or leading[0].score <= 0.0:
        return None
    best = leading[0]
    touched = np.zeros(len(problem.left), dtype=bool)
    touched[problem.rows] = True
    touched &= problem.fold < STRUCTURE_FOLDS
    blocks = touched_blocks(problem.block, touched)
    if len(blocks) < 2:
        return None
    before = withheld_errors(problem, None)
    chosen = [choose(problem, library, k) for k in range(STRUCTURE_FOLDS)]
    after = withheld_errors(problem, [None if fit is None else problem.laid_out(fit.columns) for fit in chosen])
    proof = compared("", (before, after), problem.white.scale, (problem.block, touched), rng)
    rmse_smooth = math.nan
    if problem.smooth.shape[1]:
        smooth = withheld_errors(problem, [problem.smooth] * STRUCTURE_FOLDS)
        rmse_smooth = math.sqrt(float(np.mean(smooth[touched] ** 2)))
        if proof.rmse_before**2 - proof.rmse_after**2 < SMOOTH_SHARE * (proof.rmse_before**2 - rmse_smooth**2):
            return None
    if proof.gain_interval[0] <= 0.0:
        return None
    same = sum(fit is not None and fit.form.covariates == best.form.covariates for fit in chosen)
    if same < STRUCTURE_FOLDS / 2:
        return None
    constant, placebo = np.mean([np.square(placebo_errors(problem, rng)) for _ in range(PLACEBOS)], axis=0)
    if gain_interval(constant, placebo, blocks, rng)[0] > 0.0:
        return None
    rmse_constant, rmse_placebo = (math.sqrt(float(np.mean(squares[touched]))) for squares in (constant, placebo))
    constants, located, fitted = _constants(problem, view, best)
    return Shape(
        signal="",
        configuration="",
        text=text_of(best.form.formula()),
        formula=best.form.formula([repr(float(f"{c.value:.9g}")) for c in constants]),
        covariates=best.form.covariates,
        constants=constants,
        as_drag=True,
        held_out=replace(proof, placebo_gain=rmse_constant - rmse_placebo),
        rmse_smooth=rmse_smooth,
        alike=sum(fit is not None and fit.form.name == best.form.name for fit in chosen),
        folds=STRUCTURE_FOLDS,
        rows=problem.rows,
        located=located,
        fitted=fitted,
    )


def _constants(problem: Problem, view: View, fit: FormFit) -> tuple[tuple[Constant, ...], Array, Array]:
    """Constants with standard errors; what is left at the location when the baseline joins the fit; the fitted form.

    Notes
    -----
    Standard errors are those of the linearised fit, baseline free, widened where the fit leaves more than the noise. A
    step lies between two levels of its covariate: its error is their distance over the square root of twelve.
    """
    form, gram_right = fit.form, view.normal(fit.columns[:, None, :])
    size = np.linalg.solve(gram_right[0][0], gram_right[1][0])
    slopes = [fit.columns]
    for i in range(len(fit.constants)):
        step = np.zeros(len(fit.constants))
        step[i] = 1e-4 * fit.constants[i]
        up, down = (form.columns((fit.constants + s)[None, :])[:, 0] @ size for s in (step, -step))
        slopes.append(((up - down) / (2.0 * step[i]))[:, None])
    searched = np.r_[np.ones(form.linear, dtype=bool), np.array(form.searched, dtype=bool)]
    white = view.white(np.hstack(slopes)[:, searched])
    seen = white - view.basis @ (view.basis.T @ white)
    length = np.linalg.norm(seen, axis=0)
    length[length == 0.0] = np.inf
    shared = view.white(fit.columns) @ size
    rest = view.left - (shared - view.basis @ (view.basis.T @ shared))
    widened = math.sqrt(max(1.0, float(rest @ rest) / max(view.used - seen.shape[1], 1)))
    with np.errstate(divide="ignore"):
        spread = np.sqrt(np.diag(np.linalg.pinv((seen / length).T @ (seen / length), rcond=1e-10))) / length * widened
    errors = np.full(len(searched), math.nan)
    errors[searched] = np.where(np.isfinite(length), spread, math.nan)
    at = form.linear
    for atom, covariate in form.factors:
        for letter in atom.constants:
            if letter == "p" and not atom.searched:
                known = levels(np.abs(covariate.values))
                above = int(np.searchsorted(known, fit.constants[at - form.linear]))
                errors[at] = (known[min(above, len(known) - 1)] - known[max(above - 1, 0)]) / math.sqrt(12.0)
            at += 1
    values = np.r_[size, fit.constants]
    constants = tuple(
        Constant(name, float(value), float(error) if math.isfinite(error) else None, unit)
        for name, value, error, unit in zip(form.symbols, values, errors, form.units, strict=True)
    )
    whole = problem.laid_out(fit.columns)
    design = np.hstack([problem.baseline, whole])
    solution = solve(problem.white(design), problem.white(problem.left))
    located = (problem.left - problem.baseline @ solution[: problem.baseline.shape[1]])[problem.rows] * problem.sign
    return constants, located, fit.columns @ size
