"""How large the errors of a model are, on the record of its fit and on the withheld one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.drive_faults import DEAD_ZONE
from pmg.pipeline.diagnosis.balance.library.elastic import BACKLASH
from pmg.pipeline.diagnosis.balance.proof import telling

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.contest import ModelStep
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis

FAR = 2.0
"""Error on the withheld record over that of the fit from which on a model may not carry over."""

FALLS_TO = 0.5
"""Error on the withheld record with a cause, over that without, up to which the cause carries over."""

MOSTLY = 0.5
"""Part of the square of an error from which on it is said which samples make it."""

UNSURE = {DEAD_ZONE: "its command changes sign in the dead zone, ", BACKLASH: "its load meets the end of the gap, "}
"""Where else single samples have noise of their own, once nobody knows what a named term does there."""

NEXT_TO_NOTHING = 0.9
"""Relative error of the fit from which on a model explains next to nothing: noise alone makes it 1."""

MOST_PART = 10.0
"""Relative error from which on a number says nothing."""


def percent(part: float) -> str:
    """A part of 1 in per cent; of what is ten times as large as the whole, only that."""
    if math.isnan(part):
        return "–"
    return f"{100.0 * part:.2f} %" if part < MOST_PART else f"more than {100.0 * MOST_PART:.0f} %"


def errors_sentence(diagnosis: TermsDiagnosis, first: ModelStep, last: ModelStep) -> str:
    """Errors of the first model and the last, on the record of the fit and on the withheld one, if there is one."""
    pushes, steps = diagnosis.case.axis.pushes, (first, last) if last is not first else (first,)
    told = f"Relative {pushes} error {_in_turn([percent(step.error_fit) for step in steps])}"
    if diagnosis.withheld is not None:
        told = f"{told}; on the withheld record {_in_turn([percent(step.error_withheld) for step in steps])}"
    if said := what_it_misses(diagnosis, last):
        return f"{told}: {said}."
    if diagnosis.withheld is None:
        return f"{told}."
    if last.error_withheld <= FAR * last.error_fit:
        return f"{told}."
    if last is not first and last.error_withheld > FALLS_TO * first.error_withheld:
        return f"{told}: it does not carry over."
    times = last.error_withheld / last.error_fit if last.error_fit > 0.0 else math.inf
    return f"{told}, which is {times:.2g} times that of the fit."


def what_it_misses(diagnosis: TermsDiagnosis, step: ModelStep) -> str:
    """That a model explains next to nothing of what was measured; empty where it explains more."""
    if not step.error_fit > NEXT_TO_NOTHING:
        return ""
    return f"the model explains next to nothing of the {diagnosis.case.axis.pushes} that was measured"


def where_it_sticks(diagnosis: TermsDiagnosis, last: ModelStep) -> str:
    """What the errors are but for samples near standstill, where these make most of them; else empty."""
    shared = diagnosis.noise.noise
    parts, others = [], []
    for recorded in filter(None, (diagnosis.recorded, diagnosis.withheld)):
        moves = telling(recorded.noise_of_rows(shared.standard_deviation), shared)
        left, whole = last.fitted.left(recorded), recorded.force + recorded.known
        if not moves.any() or not left.any() or not whole[moves].any():
            return ""
        parts.append(1.0 - float(np.sum(left[moves] ** 2) / np.sum(left**2)))
        others.append(percent(float(np.linalg.norm(left[moves]) / np.linalg.norm(whole[moves]))))
    if parts[0] < MOSTLY:
        return ""
    most = f"{100.0 * parts[0]:.3g} % is of samples"
    unsure = "".join(UNSURE[fit.identifier] for fit in last.fitted.fits if fit.candidate.outcomes is not None)
    where = f"where the machine sticks or turns, {unsure}or steps of its encoder show"
    withheld = f", and {others[1]} on the withheld record" if len(others) > 1 else ""
    return f"Of the squared error {most} {where}; in all others the relative error is {others[0]}{withheld}."


def _in_turn(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{words[0]} before, {words[1]} after"
