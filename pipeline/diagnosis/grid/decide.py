"""The verdict: what these recordings allow to be said about the difference to the simulation."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.design.blind import confounded_shafts, slow_changes
from pmg.pipeline.diagnosis.design.next_test import confirming_test, form_test, lifting_test, next_test, repeated_test
from pmg.pipeline.diagnosis.engine.adequacy import adequacy_test
from pmg.pipeline.diagnosis.engine.catalogue import ENTRY
from pmg.pipeline.diagnosis.engine.conclusion import conclude
from pmg.pipeline.diagnosis.engine.forms import with_free_laws, with_look_alikes
from pmg.pipeline.diagnosis.engine.naming import name_candidates
from pmg.pipeline.diagnosis.engine.verdict import Absorbed, Verdict
from pmg.pipeline.diagnosis.engine.withheld import withhold
from pmg.pipeline.diagnosis.form.symbolic import find_shape
from pmg.pipeline.diagnosis.grid.candidates import GridProblem, grid_problem
from pmg.pipeline.diagnosis.grid.catalogue import MECHANISMS
from pmg.pipeline.diagnosis.grid.decoys import smooth_decoys
from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis, Rival
from pmg.pipeline.diagnosis.grid.evidence import campaign_evidence
from pmg.pipeline.diagnosis.grid.law import law_powers
from pmg.pipeline.diagnosis.grid.locate import find_mismatch, located_families
from pmg.pipeline.diagnosis.grid.outliers import without_outliers
from pmg.pipeline.diagnosis.grid.refit import about, drives_at_rest, refit
from pmg.pipeline.diagnosis.grid.withheld import prove_structure, withheld_readings
from pmg.pipeline.fit.calibration import jacobian, start_model
from pmg.pipeline.fit.span import lengths
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import predict, take_readings

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.engine.held_out import HeldOut
    from pmg.pipeline.diagnosis.grid.catalogue import GridExplanation, GridNaming
    from pmg.pipeline.diagnosis.grid.locate import CampaignMismatch
    from pmg.pipeline.diagnosis.grid.refit import Refit
    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

BEYOND_SLOW = 0.005
"""p-value from which on a blind design claims something that no slow change made: the slow changes it allows for are
smooth, real ones only nearly so."""

ROUNDS = 3
"""Times the search is made anew at most, about the baseline that was fitted together with what it found."""

JUDGE_DRAWS = 300
"""Synthetic campaigns behind the adequacy of an explanation."""

DRIVEN = "would have the bearings drive a shaft at rest"
"""Reason against a set that explains: with it, the fitted bearings would supply power to a shaft at rest."""


def diagnose(
    grid: Grid,
    fits: LossFits,
    floor: NoiseFloor,
    calibration: FittedBaseline,
    bench: BenchParameters,
    rng: np.random.Generator,
    known: Callable[[Readings], Array] | None = None,
) -> Diagnosis:
    """Test for a mismatch, locate it, search the catalogue for what makes it, and prove it on withheld readings.

    A mechanism is named when it brings more evidence than its parameters cost, beats every rival by a margin, leaves
    no more than an error of form, predicts most of the mismatch of withheld readings, and is what most parts of the
    readings name by themselves. Rivals within the margin are reported as one set with the test that would tell; so
    are sets that the parts name instead, and the causes of a mismatch that is too weak to tell an effect of another
    kind by what it leaves, or of which withheld readings prove none. Where the order of the test hides slow changes,
    only what no slow change could have made is claimed. `known` gives columns (m, k) that the baseline may follow
    besides its constants: slopes of what is already known to be there.
    """
    mismatch, outliers, floor = without_outliers(grid, fits, floor, bench, rng, known)
    readings = mismatch.readings
    blind = confounded_shafts(readings)
    allowed = slow_changes(readings, bench, calibration.model, blind) if blind else None
    if known is not None:
        allowed = known(readings) if allowed is None else np.hstack([allowed, known(readings)])
    beyond = mismatch
    if blind and mismatch.found:
        beyond = find_mismatch(readings.grid, fits, floor, bench, rng, allowed=allowed)
    said = Diagnosis(
        verdict=Verdict.CONSISTENT,
        campaign=grid.campaign,
        mismatch=beyond,
        floor=floor,
        blind=blind,
        outliers=outliers,
    )
    if not beyond.found or (blind and beyond.p_value > BEYOND_SLOW):
        verdict = Verdict.CONFOUNDED if blind else Verdict.CONSISTENT
        lifting = lifting_test(readings, bench, calibration.model, floor, blind) if blind else None
        return replace(said, verdict=verdict, mismatch=mismatch, lifting=lifting)
    first = grid_problem(readings, bench, calibration.model, whitener(readings, bench, floor), allowed)
    problem, naming = _searched(first, floor, rng)
    naming = _with_its_laws(problem, naming, floor, rng)
    conclusion = conclude(problem, MECHANISMS, naming, lambda best: _withheld(problem, best, rng))
    said = replace(said, **{f.name: getattr(conclusion, f.name) for f in fields(conclusion)})
    if not said.verdict.names:
        every = take_readings(grid, bench)
        whole = grid_problem(every, bench, start_model(fits), whitener(every, bench, floor))
        return replace(
            said,
            held_out=prove_structure(whole, beyond.locations, rng),
            absorbed=_absorbed(beyond, calibration, bench),
            shape=find_shape(first, beyond.locations, rng),
            repeated=repeated_test(problem, beyond.locations, floor),
        )
    assert conclusion.naming is not None
    best, rivals, further = conclusion.naming.best, conclusion.naming.rivals, conclusion.naming.further
    found, close = refit(problem, best.fits), len(rivals) - conclusion.naming.by_parts
    return replace(
        said,
        refit=found,
        rivals=tuple(
            Rival(e, next_test(problem, _against(e, best, rivals), e, floor), i >= close) for i, e in enumerate(rivals)
        ),
        absorbed=_swallowed(calibration, found),
        law=tuple(power for fit in best.fits for power in law_powers(problem, fit)) if best.bent else (),
        form_test=form_test(problem, best, further, floor) if further and said.verdict is Verdict.NAMED else None,
        confirming=confirming_test(problem, best.fits, floor) if said.verdict is Verdict.NAMED else None,
        decoys=None if said.weak else smooth_decoys(problem, naming, rng),
    )


def _searched(problem: GridProblem, floor: NoiseFloor, rng: np.random.Generator) -> tuple[GridProblem, GridNaming]:
    """What the catalogue says, and the problem about the baseline that was fitted together with what it names."""
    naming = name_candidates(problem, MECHANISMS, adequacy_test(campaign_evidence(problem, floor, JUDGE_DRAWS, rng)))
    for _ in range(ROUNDS):
        again = None if naming.explained and naming.remainder.adequate else about(problem, naming.best)
        if again is None:
            break
        better = name_candidates(again, MECHANISMS, adequacy_test(campaign_evidence(again, floor, JUDGE_DRAWS, rng)))
        if better.best.unexplained >= naming.best.unexplained - ENTRY:
            break
        problem, naming = again, better
    return problem, naming


def _with_its_laws(problem: GridProblem, naming: GridNaming, floor: NoiseFloor, rng: np.random.Generator) -> GridNaming:
    """What the catalogue says once laws may bend; nothing is explained if its baseline drives a shaft at rest."""
    judged = adequacy_test(campaign_evidence(problem, floor, JUDGE_DRAWS, rng))
    naming = with_look_alikes(with_free_laws(naming, problem, MECHANISMS, judged), problem)
    drives = naming.explained and drives_at_rest(problem, naming.best.fits)
    return replace(naming, explained=False, against=DRIVEN) if drives else naming


def _withheld(problem: GridProblem, explanation: GridExplanation, rng: np.random.Generator) -> HeldOut | None:
    """The proof on withheld readings; None where the effect touches too few blocks for one: it is not named then."""
    return withhold(withheld_readings(problem), MECHANISMS, explanation.fits, rng, bent=explanation.bent > 0.0)


def _against(rival: GridExplanation, best: GridExplanation, rivals: tuple[GridExplanation, ...]) -> GridExplanation:
    """What a test must tell a rival from: the leading set, or the other look-alike where the rival is a part of it."""
    parts = (other for other in rivals if rival.ids < best.ids and other.ids < best.ids and other is not rival)
    return next(parts, best)


def _swallowed(calibration: FittedBaseline, found: Refit) -> tuple[Absorbed, ...]:
    """Baseline constants alone and with the mechanisms in."""
    after = {"K_corr": found.model.correction, "b": found.model.b, "c": found.model.c, "d": found.model.d}
    rows = []
    for name in calibration.free:
        error = found.baseline_errors.get(name, float("nan"))
        known = error if np.isfinite(error) else None
        rows.append(Absorbed(name, calibration.value(name), after[name], known, calibration.standard_error(name)))
    return tuple(rows)


def _absorbed(mismatch: CampaignMismatch, calibration: FittedBaseline, bench: BenchParameters) -> tuple[Absorbed, ...]:
    """Baseline constants without and with the located families in a joint, weighted fit."""
    readings = mismatch.readings
    structure = located_families(readings, bench, calibration.model, mismatch.locations)
    if structure.shape[1] == 0:
        return ()
    slopes = jacobian(readings, bench, calibration.model, calibration.free)
    design = np.hstack([slopes, structure]) / readings.u[:, None]
    y = (readings.torque - predict(readings, bench, calibration.model)) / readings.u
    length = lengths(design)
    inverse = np.linalg.pinv(design / length, rcond=1e-8)
    change = inverse @ y / length
    error = np.sqrt(np.einsum("ij,ij->i", inverse, inverse)) / length
    first = len(calibration.names) - len(calibration.free)
    return tuple(
        Absorbed(
            name,
            before := calibration.value(name),
            before + float(change[i]),
            float(error[i]),
            calibration.standard_error(name),
        )
        for i, name in enumerate(calibration.free, start=first)
    )
