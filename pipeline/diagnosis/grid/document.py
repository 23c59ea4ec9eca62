"""The diagnosis as the JSON document ``pmg.diagnosis/1``; its schema lies in the folder above."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.engine.conclusion import probabilities
from pmg.pipeline.diagnosis.form.shape import shape_document
from pmg.pipeline.diagnosis.grid.diagnosis import component_of
from pmg.pipeline.diagnosis.grid.rivals import rival_rows
from pmg.pipeline.diagnosis.grid.statement import near_decision, phrase, statement
from pmg.sim.signals import MINUTE, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.diagnosis.engine.found_set import Naming
    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.diagnosis.grid.law import LawPower
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.signals import Array

SCHEMA = "pmg.diagnosis/1"

OF_U = ("value", "after")
"""Keys of numbers to which the standard error beside them belongs."""
LEGIBLE, BESIDE_U = 6, 4
"""Significant digits of a number, and digits of one after the first of its standard error."""


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """The whole document."""
    mismatch, floor, held = diagnosis.mismatch, diagnosis.floor, diagnosis.held_out
    document = {
        "schema": SCHEMA,
        "campaign": diagnosis.campaign,
        "verdict": str(diagnosis.verdict),
        "phrase": phrase(diagnosis),
        "statement": statement(diagnosis),
        "weak": diagnosis.weak,
        "p_value": mismatch.p_value,
        "false_alarm_rate": mismatch.false_alarm_rate,
        "noise_Nm": {
            "sun": floor.sun.u,
            "ring": floor.ring.u,
            "source": f"sun: {floor.sun.source}; ring: {floor.ring.source}",
        },
        "locations": [
            {
                "signal": place.signal,
                "configuration": place.configuration,
                "component": None if (component := component_of(place)) is None else str(component),
                "depends_on": list(place.depends_on),
                "region": {name: list(span) for name, span in place.region.items()},
                "size_Nm": place.size,
                "p_value": place.p_value,
            }
            for place in mismatch.locations
        ],
        "mechanisms": _mechanisms(diagnosis),
        "rivals": rival_rows(diagnosis),
        "near_ties": near_ties(near_decision(diagnosis)),
        "form": form_of(diagnosis.naming if diagnosis.verdict.names else None, diagnosis.law),
        "absorbed": [row.document for row in diagnosis.absorbed],
        "held_out": None
        if held is None
        else held.document("Nm") | {"placebo_gain_Nm": held.placebo_gain, "expected_Nm": held.expected_after},
        "next_tests": _next_tests(diagnosis),
        "decoys": None if diagnosis.decoys is None else asdict(diagnosis.decoys),
        "design": _design(diagnosis),
        "shape": None if diagnosis.shape is None else shape_document(diagnosis.shape),
    }
    return {name: legible(value) for name, value in document.items()}


def legible(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """A JSON value whose numbers have the digits that no processor decides, and those with a standard error no more."""
    if isinstance(value, list):
        return [legible(part) for part in value]
    if isinstance(value, dict):
        u = value.get("standard_error")
        if not isinstance(u, float) or not math.isfinite(u) or u <= 0.0:
            return {name: legible(part) for name, part in value.items()}
        digits = BESIDE_U - math.floor(math.log10(u))
        return {
            name: round(part, digits) if name in OF_U and isinstance(part, float) else legible(part)
            for name, part in value.items()
        }
    return float(f"{value:.{LEGIBLE}g}") if isinstance(value, float) else value


def _design(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """Effects that the points cannot tell, whatever was read."""
    audit = diagnosis.audit
    if audit is None:
        return None
    return {
        "blind_to_slow_changes": list(diagnosis.blind),
        "unseen": [
            {"id": row.candidate.identifier, "shaft": row.candidate.shaft} for row in audit.visible if row.unseen
        ],
        "look_alike": [
            {
                "ids": [pair.one.identifier, pair.other.identifier],
                "shafts": [pair.one.shaft, pair.other.shaft],
                "correlation": pair.correlation,
                "separating_test": "" if pair.plan is None else pair.plan.description,
            }
            for pair in audit.alike
        ],
    }


def near_ties(naming: Naming[Any, Any] | None) -> list[dict[str, Any]]:
    """Sets that a rule kept behind the leading one or out of the rivals by little, and by how much evidence."""
    if naming is None:
        return []
    level = ((rival, 0.0, "the order of the catalogue") for rival in naming.level)
    missed = ((other, round(short, 2), "the margin of evidence") for other, short in naming.missed)
    return [{"ids": sorted(other.ids), "by": by, "decided_by": rule} for other, by, rule in (*level, *missed)]


def form_of(naming: Naming[Any, Any] | None, law: tuple[LawPower, ...] = ()) -> dict[str, Any] | None:
    """How the law of what is named differs from the library's form, and what explains as much; None where not."""
    if naming is None or not (naming.best.bent or naming.further):
        return None
    return {
        "explained_by_library_form": naming.best.gain,
        "taken_up_by_another_law": naming.best.bent,
        "left": naming.remainder.excess,
        "powers": [
            {
                "id": power.identifier,
                "shaft": power.shaft,
                "along": str(power.along),
                "value": power.more,
                "standard_error": power.standard_error,
            }
            for power in law
        ],
        "or_further": [fit.identifier for fit in naming.further],
    }


def _mechanisms(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    naming, found = diagnosis.naming, diagnosis.refit
    if naming is None or found is None:
        return []
    weights = probabilities(diagnosis)
    rows = []
    for fit, values, errors in zip(naming.best.fits, found.values, found.standard_errors, strict=True):
        shaft = naming.shafts[fit.candidate.identifier]
        row = _mechanism(fit, shaft, weights[0])
        row["parameters"] = _parameters(fit, values, errors)
        other = naming.on_the_other_shaft(fit)
        if other is not None:
            row["parameters"] += _parameters(other, other.values, None)[: len(other.candidate.sizes)]
        rows.append(row)
    for rival, weight in zip(diagnosis.rivals, weights[1:], strict=True):
        known = {row["id"] for row in rows}
        new = [fit for fit in rival.explanation.fits if fit.candidate.identifier not in known]
        rows += [_mechanism(fit, naming.place_in(rival.explanation, fit), weight) for fit in new]
    return rows


def mechanism_facts(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The mechanisms of the leading set with their parameters, each with its standard uncertainty u or null.

    `probability` is the weight of the set among what cannot be separated. Where the shaft cannot be determined
    either, the parameters of both shafts stand beside each other.
    """
    if diagnosis.naming is None or diagnosis.refit is None:
        return []
    kinds = [fit.candidate.kind for fit in diagnosis.naming.best.fits]
    return [
        mechanism_fact(row, kind.title, {p.name: p.meaning for p in kind.parameters()})
        for row, kind in zip(_mechanisms(diagnosis), kinds, strict=False)  # those of rivals follow
    ]


def mechanism_fact(row: Mapping[str, Any], title: str, meanings: Mapping[str, str]) -> dict[str, Any]:
    """A mechanism of a document as a summary tells it: with its title, and what each parameter means, or its name."""
    parameters = [
        {
            "name": p["name"],
            "meaning": meanings.get(p["name"], p["name"].replace("_", " ")),
            "value": p["value"],
            "u": p["standard_error"],
            "unit": p["unit"],
        }
        for p in row["parameters"]
    ]
    kept = {name: row[name] for name in ("shaft", "probability")}
    return {"id": row["id"], "title": title, **kept, "parameters": parameters}


def _mechanism(fit: CandidateFit, shaft: str, probability: float) -> dict[str, Any]:
    return {
        "id": fit.candidate.identifier,
        "component": str(fit.candidate.kind.component_on(fit.candidate.shaft)),
        "shaft": shaft,
        "probability": probability,
        "parameters": _parameters(fit, fit.values, None),
        "rms_effect_Nm": fit.size,
        "peak_effect_Nm": float(np.abs(fit.effect).max()),
    }


def _parameters(fit: CandidateFit, values: Array, errors: Array | None) -> list[dict[str, Any]]:
    spread = [math.nan] * len(values) if errors is None else errors.tolist()
    return [
        {
            "name": parameter.name,
            "value": float(value),
            "standard_error": error if math.isfinite(error) else None,
            "unit": parameter.unit,
        }
        for parameter, value, error in zip(fit.candidate.parameters, values, spread, strict=True)
    ]


def _next_tests(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    return [
        {
            "description": test.plan.description,
            "points": _set_points(test.plan.points),
            "minutes": test.plan.seconds / MINUTE,
            "separates": list(test.separates),
            "power": test.power,
        }
        for test in diagnosis.next_tests
    ]


def _set_points(at: OperatingPoints) -> list[str]:
    """The points of a test in words, in their order: what to set on the bench."""
    lines = []
    for i, configuration in enumerate(at.configuration):
        sun, ring = SPEED_SUN.display(at.speed_sun[i]), SPEED_RING.display(at.speed_ring[i])
        if configuration == "zero":
            lines.append("zero check, shafts free and at rest")
        elif configuration == "neutral":
            lines.append(f"neutral, sun {sun:.0f} rpm, ring {ring:.0f} rpm")
        else:
            lines.append(f"engaged, {at.drive[i]} drives, sun {sun:.0f} rpm, ring torque {at.load_set[i]:.2f} N m")
    return lines
