"""The zero of what drives a machine: the mean of recordings at rest with the drive off."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.balance.known_terms import SetTerm
from pmg.pipeline.diagnosis.balance.records.clock_of import clock_of
from pmg.pipeline.diagnosis.balance.records.recorded import REST
from pmg.pipeline.diagnosis.balance.records.smoothing import Smoother
from pmg.pipeline.diagnosis.balance.records.standing import stands
from pmg.pipeline.diagnosis.balance.records.two_shafts import second_shaft
from pmg.pipeline.recording.findings import Code, Findings
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.files.table_file import TableFile
    from pmg.pipeline.recording.findings import Finding
    from pmg.sim.signals import Array

ZERO = "constant_offset"
"""Term of the zero."""

SHORTEST = 200
"""Samples whose mean tells a zero, and its error."""

PARTS = 20
"""Stretches of a recording whose scatter gives the error of its mean."""


def with_zero(case: Case, file: TableFile[Any]) -> Case:
    """A case with the zero of its recordings at rest among its known terms, and as a finding.

    Parameters
    ----------
    case : Case
        With recordings of a zero.
    file : TableFile
        Its machine file, for errors.

    Raises
    ------
    BenchError
        When the zero is known already, each recording has one of its own, or nothing drives the machine.
    RecordingError
        When one of the recordings moves, or cannot be read.

    Notes
    -----
    The mean of the means of the recordings; its standard error by their scatter, at least by that of stretches of each.
    """
    _check(case, file)
    means, variances = [], []
    findings: list[Finding] = []
    for path in case.zero:
        force, told = _at_rest(path, case)
        parts = [float(part.mean()) for part in np.array_split(force, PARTS)]
        means.append(float(force.mean()))
        variances.append(float(np.var(parts, ddof=1)) / PARTS)
        findings += told
    zero, within = float(np.mean(means)), sum(variances) / len(means) ** 2
    between = float(np.var(means, ddof=1)) / len(means) if len(means) > 1 else 0.0
    error = math.sqrt(max(within, between))
    (term,) = (term for term in case.library if term.key == ZERO)
    names = Findings(", ".join(path.name for path in case.zero))
    shown = f"{zero:.4g} ± {error:.2g} {case.axis.push}"
    names.info(Code.CHANNEL_VALUE, case.axis.pushes, f"at rest: the zero, {shown}, is taken out", "Nothing to do.")
    known = (*case.known, SetTerm(term, np.array([zero]), error=error))
    return replace(case, known=known, findings=(*findings, *names.listed()))


def _check(case: Case, file: TableFile[Any]) -> None:
    """Refuse a zero that is known otherwise, or of nothing."""
    known = {each.term.key for each in case.known}
    faults = {
        "a zero that [model.known] gives, too": ZERO in known,
        "a zero that the baseline has free": ZERO in case.baseline,
        'a zero where zeros = "own" frees one of each recording': case.own_zeros,
        f"a zero of a {case.axis.pushes} that nobody recorded": "force" not in case.channels,
    }
    for came, is_so in faults.items():
        if is_so:
            raise file.refusal(came, "one way to know it", "Leave one of them out.", "records", "zero")


def _at_rest(path: Path, case: Case) -> tuple[Array, tuple[Finding, ...]]:
    """Force of a recording at rest (n,), and what was told in reading it."""
    findings, found = Findings(path.name), []
    clock = clock_of(path, case, findings)
    smoother = Smoother(case.prepare, 1.0 / clock.rate_hz)
    for stretch in clock.stretches:
        values = dict(stretch.channels)
        if case.ratio is not None:
            values, _ = second_shaft(values, case, findings)
        if len(stretch.time) < SHORTEST + 2 * smoother.settles:
            continue
        _, speed, noise = smoother.moved(values.get("position"), values.get("velocity"))
        if not stands(speed[smoother.settles : -smoother.settles], REST * noise[0]):
            came, do = "a machine that moves", "Leave it out of zero, or record it with the drive off."
            raise RecordingError(str(path), came, "one at rest", do)
        found.append(values["force"])
    if not found:
        came = f"{max(len(stretch.time) for stretch in clock.stretches)} samples in a row"
        expected = f"{SHORTEST + 2 * smoother.settles} or more"
        raise RecordingError(str(path), came, expected, "Record longer.")
    return np.concatenate(found), findings.listed()
