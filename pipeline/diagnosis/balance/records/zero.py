"""The zero of what drives a machine: the mean of recordings at rest with the drive off, taken out of each channel."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

from pmg.pipeline.diagnosis.balance.case import OUTPUT
from pmg.pipeline.diagnosis.balance.estimate import T_95
from pmg.pipeline.diagnosis.balance.known_terms import SetTerm
from pmg.pipeline.diagnosis.balance.records.clock_of import clocks_apart
from pmg.pipeline.diagnosis.balance.records.recorded import REST
from pmg.pipeline.diagnosis.balance.records.smoothing import Smoother
from pmg.pipeline.diagnosis.balance.records.standing import creeps, stands
from pmg.pipeline.recording.findings import Code, Findings
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
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

FORCES = ("force", f"{OUTPUT}force")
"""Channels that have a zero."""


def with_zero(case: Case, file: TableFile[Any]) -> Case:
    """A case that takes the zeros of its recordings at rest out of what drives it, and tells them.

    What the zero of the balance may still be off by is a known term of size zero with that error.

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
    Of each channel the mean of the means of the recordings. Its standard error is the scatter of these, at least that
    of stretches within each; that of a few recordings is made larger by Student's t, so that as many standard errors as
    elsewhere hold 95 %.
    """
    _check(case, file)
    findings: list[Finding] = []
    means: dict[str, list[float]] = {kind: [] for kind in FORCES if kind in case.channels}
    variances: dict[str, list[float]] = {kind: [] for kind in means}
    for path in case.zero:
        values, told = _at_rest(path, case)
        findings += told
        for kind in means:
            parts = [float(part.mean()) for part in np.array_split(values[kind], PARTS)]
            means[kind].append(float(values[kind].mean()))
            variances[kind].append(float(np.var(parts, ddof=1)) / PARTS)
    tares = {kind: float(np.mean(each)) for kind, each in means.items()}
    errors = {kind: _error(means[kind], variances[kind]) for kind in means}
    names = Findings(", ".join(path.name for path in case.zero))
    for kind, tare in tares.items():
        shown = f"{tare:.4g} ± {errors[kind]:.2g} {case.axis.push}"
        channel, _ = case.channels[kind]
        names.info(Code.CHANNEL_VALUE, channel.name, f"at rest: the zero, {shown}, is taken out", "Nothing to do.")
    (term,) = (term for term in case.library if term.key == ZERO)
    error = math.hypot(errors["force"], errors.get(f"{OUTPUT}force", 0.0) / (case.ratio or 1.0))
    known = (*case.known, SetTerm(term, np.zeros(1), error=error))
    return replace(case, known=known, tares=tares, findings=(*findings, *names.listed()))


def _error(means: list[float], variances: list[float]) -> float:
    """Standard error of a mean of means, each with its variance."""
    count = len(means)
    within = sum(variances) / count**2
    if count < 2:
        return math.sqrt(within)
    wider = float(stats.t.ppf(0.975, count - 1)) / T_95
    return math.sqrt(max(within, wider**2 * float(np.var(means, ddof=1)) / count))


def _check(case: Case, file: TableFile[Any]) -> None:
    """Refuse a zero that is known otherwise, or of nothing."""
    known = {each.term.key for each in case.known}
    faults = {
        "a zero that [model.known] gives, too": ZERO in known,
        "a zero that the baseline has free": ZERO in case.baseline,
        'a zero where zeros = "own" frees one of each recording': case.own_zeros,
    }
    for came, is_so in faults.items():
        if is_so:
            raise file.refusal(came, "one way to know it", "Leave one of them out.", "records", "zero")
    if "force" not in case.channels:
        came, expected = f"no channel of a {case.axis.pushes}", f"a {case.axis.pushes} that was recorded"
        raise file.refusal(came, expected, "Leave zero out: a machine that coasts has none.", "records", "zero")


def _at_rest(path: Path, case: Case) -> tuple[Mapping[str, Array], tuple[Finding, ...]]:
    """Channels that have a zero of a recording at rest (n,), and what was told in reading it."""
    findings = Findings(path.name)
    found: dict[str, list[Array]] = {}
    for clock in clocks_apart(path, case, findings):
        smoother = Smoother(case.prepare, 1.0 / clock.rate_hz)
        fewest = SHORTEST + 2 * smoother.settles
        if max(len(stretch.time) for stretch in clock.stretches) < fewest:
            came = f"{max(len(stretch.time) for stretch in clock.stretches)} samples in a row"
            raise RecordingError(str(path), came, f"{fewest} or more", "Record longer.")
        for stretch in (each for each in clock.stretches if len(each.time) >= fewest):
            for speed, deviation in _speeds(stretch.channels, smoother):
                _check_rest(path, speed, REST * deviation, case)
            for kind in FORCES:
                if kind in stretch.channels:
                    found.setdefault(kind, []).append(stretch.channels[kind])
    return {kind: np.concatenate(each) for kind, each in found.items()}, findings.listed()


def _speeds(values: Mapping[str, Array], smoother: Smoother) -> Iterator[tuple[Array, float]]:
    """Speed of each shaft that is seen (n,), without the ends that filters spoil, and the deviation of its noise."""
    for end in ("", OUTPUT):
        position, velocity = values.get(f"{end}position"), values.get(f"{end}velocity")
        if position is not None or velocity is not None:
            _, speed, noise = smoother.moved(position, velocity)
            yield speed[smoother.settles : -smoother.settles], noise[0]


def _check_rest(path: Path, speed: Array, rest_speed: float, case: Case) -> None:
    """Refuse a recording in which a shaft moves: its friction would be taken for a zero."""
    if not stands(speed, rest_speed):
        came, do = "a machine that moves", "Leave it out of zero, or record it with the drive off."
        raise RecordingError(str(path), came, "one at rest", do)
    if creeps(speed):
        came = f"a machine that creeps, at {float(speed.mean()):.2g} {case.axis.speed} in the mean"
        do = "Leave it out of zero: its friction would be taken for one. Of a speed channel that is off, correct it."
        raise RecordingError(str(path), came, "one at rest", do)
