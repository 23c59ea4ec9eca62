"""The diagnosis of a recording as JSON and as sentences."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.balance.errors_told import errors_sentence, percent, where_it_sticks
from pmg.pipeline.diagnosis.balance.estimate import impossible_in
from pmg.pipeline.diagnosis.balance.records.zero import zero_lines
from pmg.pipeline.diagnosis.balance.titles import (
    left_out_sentence,
    separating_test,
    taken_for_granted,
    title_of,
    titled,
    titles_of,
    why_held_back,
    with_error,
)
from pmg.pipeline.diagnosis.engine.conclusion import in_the_main_sentence
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.fit.document import number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.balance.catalogue import TermNaming
    from pmg.pipeline.diagnosis.balance.contest import Contest, ModelStep
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.estimate import Estimate
    from pmg.pipeline.diagnosis.balance.free_run import FreeRun
    from pmg.pipeline.diagnosis.balance.mismatch import Place
    from pmg.pipeline.diagnosis.engine.mismatch import Mismatch

SCHEMA = "pmg.terms-diagnosis/1"
"""Schema of the document."""


def terms_document(diagnosis: TermsDiagnosis) -> dict[str, Any]:
    """Everything that was found, as JSON; forces in N, torques in N m, relative errors as part of 1."""
    found, axis = diagnosis.naming, diagnosis.case.axis
    unit = axis.key
    return {
        "schema": SCHEMA,
        "case": diagnosis.case.title,
        "verdict": str(diagnosis.verdict),
        "p_value": diagnosis.mismatch.p_value,
        "false_alarm_rate": diagnosis.mismatch.false_alarm_rate,
        "noise": {
            f"standard_deviation_{unit}": diagnosis.noise.noise.standard_deviation,
            "lags": diagnosis.noise.noise.lags,
            "samples": len(diagnosis.recorded.force),
        },
        f"rest_speed_{axis.speed.replace('/', '_')}": diagnosis.recorded.motion.rest_speed,
        "coasts": diagnosis.recorded.coasts,
        "findings": [finding.to_dict() for finding in diagnosis.recorded.findings],
        "locations": _places(diagnosis.mismatch),
        "rounds": [] if found is None else _rounds(found),
        "models": [_model(step, unit) for step in diagnosis.steps],
        "refinements": [_model(step, unit) for step in diagnosis.refinements],
        "dropped_refinements": [_model(step, unit) for step in diagnosis.dropped],
        "impossible": [_estimate(e) for e in diagnosis.impossible],
        "held_out": None if diagnosis.held_out is None else diagnosis.held_out.document(unit),
        "contests": [_contest(contest, unit) for contest in diagnosis.contests],
        "rivals": [_ids(contest) for contest in diagnosis.contests if contest.open],
        "cannot_be_told": [
            {"ids": list(t.ids), "correlation": t.correlation, "separating_test": separating_test(diagnosis, t.ids)}
            for t in diagnosis.twins
        ],
        "absorbed": [row.document for row in diagnosis.absorbed],
        "left_over": {"p_value": diagnosis.left_over.p_value, "locations": _places(diagnosis.left_over)},
        "free_runs": _free_runs(diagnosis),
        "low_passes": [each.document for each in diagnosis.low_passes],
        "held_back": diagnosis.held_back,
        "left_out": [fit.identifier for fit in diagnosis.left_out],
        "decoys": {
            "tried": diagnosis.further_decoys.tried,
            "entered": diagnosis.further_decoys.entered,
            "most_evidence": diagnosis.further_decoys.most_evidence,
            "most_gain_withheld": max(diagnosis.further_decoys.gains, default=None),
            "in_place_of_named": None if diagnosis.decoys is None else asdict(diagnosis.decoys),
        },
    }


def _rounds(naming: TermNaming) -> list[dict[str, Any]]:
    """The rounds of the search, each with its ranking."""
    return [
        {
            "entered": " + ".join(step.entered),
            "left_before": number(step.remainder.excess),
            "ranking": [
                {
                    "id": f.identifier,
                    "variant": f.candidate.variant,
                    "gain": f.gain,
                    "cost": f.cost,
                    "shape": number(f.shape),
                    "on_bound": f.on_bound,
                }
                for f in step.ranking
            ],
        }
        for step in naming.rounds
    ]


def _free_runs(diagnosis: TermsDiagnosis) -> list[dict[str, Any]]:
    axis = diagnosis.case.axis

    def row(run: FreeRun) -> dict[str, Any]:
        unit, span = f"{axis.length}_per_s" if run.of_speed else axis.length, run.words[1]
        return {
            "model": run.model,
            "record": run.record,
            f"rms_error_{unit}": number(run.error),
            f"largest_error_{unit}": number(run.largest),
            f"{span}_{unit}": run.span,
        }

    return [row(run) for run in diagnosis.free_runs]


def _places(mismatch: Mismatch[Place]) -> list[dict[str, Any]]:
    return [{"depends_on": p.name, "p_value": p.p_value, "rms_in_noise": p.rms} for p in mismatch.locations]


def _estimate(e: Estimate) -> dict[str, Any]:
    return {
        "term": e.term,
        "parameter": e.name,
        "unit": e.unit,
        "value": e.value,
        "standard_error": number(e.standard_error),
        "interval": [number(end) for end in e.interval],
        "whitened": number(e.whitened),
        "whitened_standard_error": number(e.whitened_error),
    }


def _model(step: ModelStep, unit: str) -> dict[str, Any]:
    return {
        "added": step.added,
        "evidence": step.evidence,
        "relative_error_fit": number(step.error_fit),
        "relative_error_withheld": number(step.error_withheld),
        f"withheld_gain_interval_{unit}": [number(end) for end in step.carried],
        "held_out": None if step.held is None else step.held.document(unit),
        "parameters": [_estimate(e) for e in step.fitted.estimates],
    }


def _ids(contest: Contest) -> list[str]:
    return [fit.identifier for fit in contest.rival.fits]


def _contest(contest: Contest, unit: str) -> dict[str, Any]:
    return {
        "ids": _ids(contest),
        "open": contest.open,
        "lead": contest.lead,
        "margin": contest.margin,
        "held_out": contest.held.document(unit),
        "beside_the_named": [_estimate(e) for e in contest.given_named],
        "relative_error_fit": number(contest.error_fit),
        "relative_error_withheld": number(contest.error_withheld),
    }


SELDOM, NEVER_SLOW = 0.01, 0.1
"""Part of the time in which a machine is slower than it seldom is, and part of its largest speed from which on its
friction at standstill is not seen, but follows from the form of the drag."""

COULOMB = "coulomb"
"""Friction that a machine has at any speed."""


def headline(diagnosis: TermsDiagnosis) -> str:
    """The verdict in one or two sentences."""
    named = [titled(step.fitted.fits[-1].candidate) for step in diagnosis.steps[1:]]
    first, last = diagnosis.steps[0], diagnosis.steps[-1]
    match diagnosis.verdict:
        case Verdict.CONSISTENT:
            head = f"Consistent: no mismatch beyond the noise (p = {diagnosis.mismatch.p_value:.2g})."
        case Verdict.NOT_IN_LIBRARY if diagnosis.impossible:
            head = "Nothing is named."
        case Verdict.NOT_IN_LIBRARY if diagnosis.held_back:
            head = f"Nothing is named: {why_held_back(diagnosis)}"
        case Verdict.NOT_IN_LIBRARY:
            places = "; ".join(place.name for place in diagnosis.mismatch.locations[:3])
            head = f"Not in the library: a mismatch that follows {places}, and no set of terms explains it."
        case Verdict.NAMED:
            head = f"Named: {', '.join(named)}."
        case _:
            rivals = [c for c in diagnosis.contests if c.open]
            ids = [step.added for step in diagnosis.steps[1:]]
            shared = set(ids).intersection(*(c.rival.ids for c in rivals))
            sure = ", ".join(title for title, each in zip(named, ids, strict=True) if each in shared)
            own = [step.fitted.fits[-1] for step in diagnosis.steps[1:]]
            sets = (own, *(c.rival.fits for c in rivals))
            apart = "; or ".join(titles_of(f for f in fits if f.identifier not in shared) or "nothing" for fits in sets)
            head = f"Ambiguous: {sure}, and besides {apart}." if sure else f"Ambiguous: {apart}."
    main = in_the_main_sentence(diagnosis.naming, diagnosis.held_out) if diagnosis.verdict.names else ""
    sentences = (
        *_impossible(diagnosis),
        head,
        main,
        left_out_sentence(diagnosis),
        errors_sentence(diagnosis, first, last),
        where_it_sticks(diagnosis, last),
    )
    return " ".join(sentence for sentence in sentences if sentence)


def _impossible(diagnosis: TermsDiagnosis) -> Iterator[str]:
    """What no machine has, and what to check."""
    values = (f"{title_of(diagnosis, e.term)} of {with_error(e)}" for e in diagnosis.impossible)
    if told := " and ".join(values):
        yield f"No machine has {told}: check sign, unit and filter of the channels."
    if [e.term for e in diagnosis.impossible] != [COULOMB]:
        return
    speed = np.abs(diagnosis.recorded.motion.speed)
    slowest = float(np.quantile(speed, SELDOM))
    if slowest > NEVER_SLOW * float(speed.max()):
        at = f"{slowest:.3g} {diagnosis.case.axis.speed}"
        yield (
            f"Or that is no friction: the machine seldom ran below {at}, and this is where the drag at "
            "higher speeds would meet standstill. Record slower speeds, or a coast-down."
        )


def _why_dropped(diagnosis: TermsDiagnosis, step: ModelStep) -> str:
    """Why a refinement was dropped: values that no machine has, or else the error on the withheld record."""
    values = [
        f"{with_error(e)} of {'it' if e.term == step.added else title_of(diagnosis, e.term)}"
        for e in impossible_in(step.fitted)
    ]
    off = f"with which the withheld record is off by {percent(step.error_withheld)}"
    return f"as no machine has {' and '.join(values)}" if values else off


def terms_lines(diagnosis: TermsDiagnosis) -> list[str]:
    """The diagnosis in a few lines."""
    lines = [headline(diagnosis), *zero_lines(diagnosis.case), ""]
    lines += [f"{'model':<44}{'fit':>9}{'withheld':>10}  withheld blocks [{diagnosis.case.axis.push}]"]
    for kind, steps in (("+ ", diagnosis.steps), ("refined by ", diagnosis.refinements)):
        for step in steps:
            name = taken_for_granted(diagnosis.case, " + ") if not step.added else kind + step.added
            blocks = "" if step.held is None else f"{step.held.rmse_before:.3f} -> {step.held.rmse_after:.3f}"
            if step.carried[1] < 0.0:
                blocks += "  does not carry over to the withheld record"
            lines.append(f"{name:<44}{percent(step.error_fit):>9}{percent(step.error_withheld):>10}  {blocks}".rstrip())
    own = (e for e in diagnosis.steps[-1].fitted.estimates if e.term in diagnosis.case.baseline)
    if fitted := ", ".join(f"{e.term} {e.name} = {with_error(e)}" for e in own):
        lines.append(f"fitted: {fitted}")
    for step in diagnosis.dropped:
        lines.append(f"dropped: {titled(step.fitted.fits[-1].candidate)}, {_why_dropped(diagnosis, step)}")
    lines.append("")
    for contest in diagnosis.contests:
        ids = " + ".join(fit.identifier for fit in contest.rival.fits)
        state = "cannot be distinguished from the named" if contest.open else "is beaten"
        lines.append(f"{ids} {state}: evidence {contest.lead:.0f}, margin {contest.margin:.0f}")
    for twins in diagnosis.twins:
        if len(twins.ids) == 1:
            lines.append(f"{twins.ids[0]}: the baseline absorbs it whole. {separating_test(diagnosis, twins.ids)}.")
        else:
            lines.append(
                f"{' and '.join(twins.ids)} are one and the same here. {separating_test(diagnosis, twins.ids)}."
            )
    if diagnosis.left_over.found and diagnosis.naming is not None:
        lines.append(f"What is left still follows: {'; '.join(p.name for p in diagnosis.left_over.locations)}")
    return lines


def free_run_lines(diagnosis: TermsDiagnosis) -> list[str]:
    """How far the position or speed goes astray that a model simulates; none where nothing was simulated."""
    if not diagnosis.free_runs:
        return []
    axis, (first, *_) = diagnosis.case.axis, diagnosis.free_runs
    (shown, small), (what, span) = first.shown(axis), first.words
    lines = [f"{what} simulated from the {axis.pushes} alone, never corrected by what was measured:"]
    for run in diagnosis.free_runs:
        if math.isnan(run.error):
            lines.append(f"  {run.model:<12}{run.record}: runs away")
            continue
        errors = f"{run.error / small:.3g} {shown} rms, {run.largest / small:.3g} {shown} at most"
        lines.append(f"  {run.model:<12}{run.record}: {errors}, of a {span} of {run.span / small:.3g} {shown}")
    return [*lines, ""]
