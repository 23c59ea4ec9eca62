"""The diagnosis of a recording as JSON and as sentences."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.fit.document import number
from pmg.pipeline.wording.units import MILLI

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.contest import Contest, ModelStep
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.estimate import Estimate
    from pmg.pipeline.diagnosis.balance.mismatch import Place
    from pmg.pipeline.diagnosis.engine.mismatch import Mismatch

SCHEMA = "pmg.terms-diagnosis/1"
"""Schema of the document."""


def terms_document(diagnosis: TermsDiagnosis) -> dict[str, Any]:
    """Everything that was found, as JSON; forces in N, relative errors as part of 1."""
    found = diagnosis.naming
    return {
        "schema": SCHEMA,
        "case": diagnosis.case.title,
        "verdict": str(diagnosis.verdict),
        "p_value": diagnosis.mismatch.p_value,
        "false_alarm_rate": diagnosis.mismatch.false_alarm_rate,
        "noise": {
            "standard_deviation_N": diagnosis.noise.noise.standard_deviation,
            "lags": diagnosis.noise.noise.lags,
            "samples": len(diagnosis.recorded.force),
        },
        "locations": _places(diagnosis.mismatch),
        "rounds": []
        if found is None
        else [
            {
                "entered": " + ".join(step.entered),
                "left_before": number(step.remainder.excess),
                "ranking": [
                    {
                        "id": f.identifier,
                        "gain": f.gain,
                        "cost": f.cost,
                        "shape": number(f.shape),
                        "on_bound": f.on_bound,
                    }
                    for f in step.ranking
                ],
            }
            for step in found.rounds
        ],
        "models": [_model(step) for step in diagnosis.steps],
        "refinements": [_model(step) for step in diagnosis.refinements],
        "held_out": None if diagnosis.held_out is None else diagnosis.held_out.document("N"),
        "contests": [_contest(contest) for contest in diagnosis.contests],
        "rivals": [_contest(contest)["ids"] for contest in diagnosis.contests if contest.open],
        "cannot_be_told": [
            {"ids": list(t.ids), "correlation": t.correlation, "separating_test": separating_test(diagnosis, t.ids)}
            for t in diagnosis.twins
        ],
        "absorbed": [row.document for row in diagnosis.absorbed],
        "left_over": {"p_value": diagnosis.left_over.p_value, "locations": _places(diagnosis.left_over)},
        "free_runs": _free_runs(diagnosis),
        "decoys": {
            "tried": diagnosis.further_decoys.tried,
            "entered": diagnosis.further_decoys.entered,
            "most_evidence": diagnosis.further_decoys.most_evidence,
            "most_gain_withheld": max(diagnosis.further_decoys.gains, default=None),
            "in_place_of_named": None if diagnosis.decoys is None else asdict(diagnosis.decoys),
        },
    }


def _free_runs(diagnosis: TermsDiagnosis) -> list[dict[str, Any]]:
    return [
        {
            "model": run.model,
            "record": run.record,
            "rms_error_m": number(run.error),
            "largest_error_m": number(run.largest),
            "stroke_m": run.stroke,
        }
        for run in diagnosis.free_runs
    ]


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


def _model(step: ModelStep) -> dict[str, Any]:
    return {
        "added": step.added,
        "evidence": step.evidence,
        "relative_error_fit": step.error_fit,
        "relative_error_withheld": number(step.error_withheld),
        "withheld_gain_interval_N": [number(end) for end in step.carried],
        "held_out": None if step.held is None else step.held.document("N"),
        "parameters": [_estimate(e) for e in step.fitted.estimates],
    }


def _contest(contest: Contest) -> dict[str, Any]:
    return {
        "ids": [fit.identifier for fit in contest.rival.fits],
        "open": contest.open,
        "lead": contest.lead,
        "margin": contest.margin,
        "held_out": contest.held.document("N"),
        "beside_the_named": [_estimate(e) for e in contest.given_named],
        "relative_error_fit": contest.error_fit,
        "relative_error_withheld": number(contest.error_withheld),
    }


def title_of(diagnosis: TermsDiagnosis, identifier: str) -> str:
    """Name of a term for people, in lower case."""
    term = next(t for t in diagnosis.case.library if t.identifier == identifier)
    return term.title if term.title.startswith("Coulomb") else term.title[0].lower() + term.title[1:]


def separating_test(diagnosis: TermsDiagnosis, ids: tuple[str, ...]) -> str:
    """Test that would tell some terms apart."""
    tests = {t.identifier: t.separating_test for t in diagnosis.case.library}
    return next((tests[name] for name in ids if tests[name]), "")


def percent(part: float) -> str:
    """A part of 1 in per cent."""
    return "–" if math.isnan(part) else f"{100.0 * part:.2f} %"


def headline(diagnosis: TermsDiagnosis) -> str:
    """The verdict in one or two sentences."""
    named = [title_of(diagnosis, step.added) for step in diagnosis.steps[1:]]
    first, last = diagnosis.steps[0], diagnosis.steps[-1]
    match diagnosis.verdict:
        case Verdict.CONSISTENT:
            return f"Consistent: no mismatch beyond the noise (p = {diagnosis.mismatch.p_value:.2g})."
        case Verdict.NOT_IN_LIBRARY:
            places = "; ".join(place.name for place in diagnosis.mismatch.locations[:3])
            return f"Not in the library: a mismatch that follows {places}, and no set of terms explains it."
        case Verdict.NAMED:
            head = f"Named: {', '.join(named)}."
        case _:
            rivals = [c for c in diagnosis.contests if c.open]
            sets = "; ".join(" and ".join(title_of(diagnosis, f.identifier) for f in c.rival.fits) for c in rivals)
            head = f"Ambiguous: {', '.join(named)}; or {sets}."
    return (
        f"{head} Relative force error {percent(first.error_fit)} before, {percent(last.error_fit)} after"
        + (
            ""
            if diagnosis.withheld is None
            else f"; on the withheld record {percent(first.error_withheld)} and {percent(last.error_withheld)}"
        )
        + "."
    )


def terms_lines(diagnosis: TermsDiagnosis) -> list[str]:
    """The diagnosis in a few lines."""
    lines = [headline(diagnosis), ""]
    lines += [f"{'model':<44}{'fit':>9}{'withheld':>10}  withheld blocks [N]"]
    for kind, steps in (("+ ", diagnosis.steps), ("refined by ", diagnosis.refinements)):
        for step in steps:
            name = " + ".join(diagnosis.case.baseline) if not step.added else kind + step.added
            blocks = "" if step.held is None else f"{step.held.rmse_before:.3f} -> {step.held.rmse_after:.3f}"
            if step.carried[1] < 0.0:
                blocks += "  does not carry over to the withheld record"
            lines.append(f"{name:<44}{percent(step.error_fit):>9}{percent(step.error_withheld):>10}  {blocks}".rstrip())
    lines.append("")
    if diagnosis.free_runs:
        lines.append("position simulated from the force alone, without being told where it is:")
    for run in diagnosis.free_runs:
        errors = f"{run.error / MILLI:.2f} mm rms, {run.largest / MILLI:.1f} mm at most"
        lines.append(f"  {run.model:<12}{run.record}: {errors}, of a stroke of {run.stroke / MILLI:.0f} mm")
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
