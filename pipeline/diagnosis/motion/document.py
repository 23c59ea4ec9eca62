"""The diagnosis of runs in motion as the JSON document ``pmg.diagnosis/1``."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.design.direct_check import BY_HAND_MIN, check_by_hand
from pmg.pipeline.diagnosis.engine.conclusion import probabilities
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.document import SCHEMA, form_of, legible, near_ties
from pmg.pipeline.diagnosis.grid.rivals import CLOSE, NONE_KNOWN, nearest_share, rival_row, why_not_named, why_open
from pmg.pipeline.diagnosis.motion.design.next_runs import LEAST_POWER
from pmg.pipeline.diagnosis.motion.design.remedy import telling_runs
from pmg.pipeline.diagnosis.motion.fitted_size import IN_ALL, FittedSize
from pmg.pipeline.diagnosis.motion.places import follows, signal_of, size_of
from pmg.pipeline.diagnosis.motion.statement import (
    effect_size,
    held_out_in_torque,
    phrase,
    row_noise_of,
    statement,
)
from pmg.pipeline.diagnosis.motion.traces import effects_of, fitted_values, named_fits, term_of
from pmg.pipeline.motion.smooth import BAND
from pmg.sim.mechanisms.base import Component

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.design.next_runs import NextRun
    from pmg.pipeline.diagnosis.motion.mismatch import MotionPlace
    from pmg.sim.signals import Array

POINTS_TO = {
    "eccentricity": "{side}_encoder",
    "inertia": "{side}_bearings",
    "drag": "{side}_bearings",
    "falling": "{side}_bearings",
    "compliance": "{side}_coupling",
    "torque rate": "{side}_coupling",
    "skew": "{side}_torque_transducer",
    "zero": "{side}_torque_transducer",
    "passage": "{side}_bearings",
    "direction": "{side}_bearings",
    "time in the run": "{side}_bearings",
    "travel since reversal": "{side}_bearings",
    "pull_out": "magnetic_gear",
    "map": "magnetic_gear",
    "pole": "magnetic_gear",
    "rate of the pole angle": "magnetic_gear",
}
"""Components by how what is followed begins."""


def motion_document(diagnosis: MotionDiagnosis) -> dict[str, Any]:
    """The whole document."""
    mismatch, noise, naming = diagnosis.mismatch, row_noise_of(diagnosis), diagnosis.naming
    effects, held = effects_of(diagnosis), held_out_in_torque(diagnosis)
    decided = diagnosis.verdict.names and not diagnosis.weak
    document = {
        "schema": SCHEMA,
        "campaign": diagnosis.campaign,
        "verdict": str(diagnosis.verdict),
        "phrase": phrase(diagnosis),
        "statement": statement(diagnosis, effects),
        "weak": diagnosis.weak,
        "p_value": mismatch.p_value,
        "false_alarm_rate": mismatch.false_alarm_rate,
        "noise_Nm": {
            "sun": noise.sun,
            "ring": noise.ring,
            "source": f"white noise of each transducer up to {BAND:g} Hz, the band of the rows",
        },
        "locations": [_location(diagnosis, place) for place in mismatch.locations],
        "mechanisms": _mechanisms(diagnosis, effects),
        "rivals": _rivals(diagnosis),
        "near_ties": near_ties(naming if decided else None),
        "form": form_of(naming if diagnosis.verdict.names else None),
        "absorbed": [row.document for row in diagnosis.absorbed],
        "held_out": None
        if held is None
        else held.document("Nm") | {"placebo_gain_Nm": held.placebo_gain, "expected_Nm": held.expected_after},
        "next_tests": _next_tests(diagnosis),
        "decoys": None if diagnosis.decoys is None else asdict(diagnosis.decoys),
        "design": {
            "blind_to_slow_changes": [],
            "unseen": [{"id": each.term.identifier, "shaft": each.term.shaft} for each in diagnosis.unseen],
            "look_alike": [],
        },
        "shape": None,
    }
    return {name: legible(value) for name, value in document.items()}


def _next_tests(diagnosis: MotionDiagnosis) -> list[dict[str, Any]]:
    """The runs that may tell; where none does, a check by hand, whose time and power are not known."""
    runs = [
        {
            "description": run.description,
            "points": [],
            "minutes": run.minutes,
            "separates": list(run.separates),
            "power": run.power,
        }
        for run in telling_runs(diagnosis)
    ]
    check, separates = check_by_hand(diagnosis.naming) if diagnosis.verdict is Verdict.AMBIGUOUS else ("", "")
    if runs or not check:
        return runs
    return [
        {
            "description": f"By hand: {check}",
            "points": [],
            "minutes": BY_HAND_MIN,
            "separates": [separates],
            "power": None,
        }
    ]


def _component_of(place: MotionPlace) -> Component | None:
    """Component that a place points to; None where it cannot tell."""
    name, side = place.family.follows, signal_of(place)
    for begins, component in POINTS_TO.items():
        if name.startswith(begins):
            return Component(component.format(side=side))
    return None


def _location(diagnosis: MotionDiagnosis, place: MotionPlace) -> dict[str, Any]:
    component = _component_of(place)
    return {
        "signal": f"torque_{signal_of(place)}",
        "configuration": place.family.configuration,
        "component": None if component is None else str(component),
        "depends_on": [follows(place)],
        "region": {},
        "size_Nm": size_of(diagnosis, place),
        "p_value": place.p_value,
    }


def _mechanisms(diagnosis: MotionDiagnosis, effects: tuple[tuple[Array, ...], ...]) -> list[dict[str, Any]]:
    naming = diagnosis.naming
    if naming is None or not diagnosis.verdict.names:
        return []
    weights, named = probabilities(diagnosis), named_fits(diagnosis)
    rows = [
        _mechanism(fit, naming.shafts[fit.identifier], weights[0], values, errors, size)
        for fit, values, errors, size in zip(
            named, diagnosis.sizes, diagnosis.size_errors, diagnosis.fitted_sizes, strict=True
        )
    ]
    others = [
        (fit, weight)
        for rival, weight in zip(naming.rivals, weights[1:], strict=True)
        for fit in rival.fits
        if fit.identifier not in {mine.identifier for mine in named}
    ]
    for fit, weight in others:
        values = fitted_values(fit)
        rows.append(_mechanism(fit, fit.place, weight, values, np.full(len(values), np.nan)))
    if others:
        effects = (*effects, *effects_of(diagnosis, tuple(fit for fit, _ in others)))
    sizes = [effect_size(diagnosis, effect)[:2] for effect in effects]
    return [row | {"rms_effect_Nm": rms, "peak_effect_Nm": peak} for row, (rms, peak) in zip(rows, sizes, strict=True)]


def _mechanism(
    fit: TermFit, shaft: str, probability: float, values: Array, errors: Array, size: FittedSize | None = None
) -> dict[str, Any]:
    parameters = [
        _parameter(quantity.name, float(value), float(error), quantity.unit)
        for quantity, value, error in zip(fit.candidate.parameters, values, errors, strict=True)
        if not quantity.fixed
    ]
    if size is not None and size.name == IN_ALL:
        parameters.insert(0, _parameter("in_all", size.value, size.error, size.unit))
    elif size is not None and (size.of_law or fit.candidate.whole):
        parameters[0] = _parameter(size.name, size.value, size.error, size.unit)
    return {
        "id": fit.identifier,
        "component": str(term_of(fit).component),
        "shaft": shaft,
        "probability": probability,
        "parameters": parameters,
    }


def _parameter(name: str, value: float, error: float, unit: str) -> dict[str, Any]:
    return {
        "name": name,
        "value": value,
        "standard_error": error if math.isfinite(error) else None,
        "unit": unit,
    }


def _telling(run: NextRun) -> str:
    """What would tell a rival; nothing where that is hardly likely."""
    return run.title if run.power >= LEAST_POWER else ""


def _rivals(diagnosis: MotionDiagnosis) -> list[dict[str, Any]]:
    """Every cause that is not excluded, with why and what would tell."""
    naming = diagnosis.naming
    if naming is None:
        return []
    if diagnosis.verdict is Verdict.NOT_IN_LIBRARY:
        share = nearest_share(naming)
        why = f"it explains {share:.0%} of the difference, but {why_not_named(naming, 'runs')}"
        return [rival_row(naming.best.fits, why)] if share >= CLOSE else []
    if diagnosis.verdict is not Verdict.AMBIGUOUS:
        return []
    rows = [
        rival_row(
            (*(() if rival.ids < naming.best.ids else naming.best.fits), *rival.fits),
            why_open(diagnosis, place),
            _telling(diagnosis.next_runs[place]),
        )
        for place, rival in enumerate(naming.rivals)
    ]
    return [*rows, NONE_KNOWN] if diagnosis.weak else rows
