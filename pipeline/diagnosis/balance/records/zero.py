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
from pmg.pipeline.diagnosis.balance.records.standing import CREEPS, PLAIN_CREEP, mean_speed, stands
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
    kinds = [kind for kind in FORCES if kind in case.channels]
    shares = np.array([1.0, 1.0 / (case.ratio or 1.0)][: len(kinds)])
    read = []
    for path in case.zero:
        values, told = _at_rest(path, case)
        findings += told
        read.append([_mean(path, values[kind]) for kind in kinds])
    means, variances = np.moveaxis(np.array(read), 2, 0)  # (recordings, kinds) each
    tares = dict(zip(kinds, means.mean(axis=0).tolist(), strict=True))
    errors = {kind: _error(means[:, k], variances[:, k]) for k, kind in enumerate(kinds)}
    names = Findings(", ".join(path.name for path in case.zero))
    found = replace(case, tares=tares, tare_errors=errors)
    for name, zero in _taken_out(found):
        names.info(Code.CHANNEL_VALUE, name, f"at rest: {zero}", "Nothing to do.")
    (term,) = (term for term in case.library if term.key == ZERO)
    known = (*case.known, SetTerm(term, np.zeros(1), error=_error(means @ shares, variances @ shares**2)))
    return replace(found, known=known, findings=(*findings, *names.listed()))


def _taken_out(case: Case) -> list[tuple[str, str]]:
    """Each channel that has a zero, and what is taken out of it in words; both torques may be called the same."""
    sizes = ((kind, f"{tare:.4g} ± {case.tare_errors[kind]:.2g} {case.axis.push}") for kind, tare in case.tares.items())
    return [(case.channels[kind][0].name, f"the zero, {size}, is taken out") for kind, size in sizes]


def zero_lines(case: Case) -> list[str]:
    """What recordings at rest take out of each channel, a line each; none without such recordings."""
    files = ", ".join(path.name for path in case.zero)
    return [f"{files}: at rest; {name}: {told}" for name, told in _taken_out(case)]


def words_of_zero(case: Case) -> str:
    """What recordings at rest say of the zero, or what none of them leaves open, in a sentence or two."""
    if lines := zero_lines(case):
        return f"{'. '.join(lines)}."
    return (
        "Coulomb friction with an offset is F+ forwards and F- backwards, as is Coulomb friction that depends on "
        "direction: only a record at rest, or the machine turned around, can tell the two apart."
    )


def _mean(path: Path, values: Array) -> tuple[float, float]:
    """Mean of a channel at rest (n,), and its variance: by stretches of it, at least that of its resolution."""
    steps = np.abs(np.diff(values))
    if not steps.any():
        came, do = f"{float(values[0]):.4g} throughout", "The zero is not resolved: leave the recording out of zero."
        raise RecordingError(str(path), came, "a force or torque with its noise", do)
    parts = [float(part.mean()) for part in np.array_split(values, PARTS)]
    spread = float(np.var(values))
    resolution = float(steps[steps > 0.0].min())
    unresolved = resolution**2 / 12.0 if spread < resolution**2 else 0.0
    return float(values.mean()), max(float(np.var(parts, ddof=1)) / PARTS, unresolved)


def _error(means: Array, variances: Array) -> float:
    """Standard error of a mean of means (n,), each with its variance."""
    count = len(means)
    within = float(variances.sum()) / count**2
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
            for speed, deviation, of_position in _speeds(stretch.channels, smoother):
                _check_rest(path, speed, REST * deviation, case, None if of_position else findings)
            for kind in FORCES:
                if kind in stretch.channels:
                    found.setdefault(kind, []).append(stretch.channels[kind])
    return {kind: np.concatenate(each) for kind, each in found.items()}, findings.listed()


def _speeds(values: Mapping[str, Array], smoother: Smoother) -> Iterator[tuple[Array, float, bool]]:
    """Speed of each shaft that is seen (n,), without the ends that filters spoil, the deviation of its noise.

    And whether it is made of a position, so that it is off by nothing.
    """
    for end in ("", OUTPUT):
        position, velocity = values.get(f"{end}position"), values.get(f"{end}velocity")
        if position is not None or velocity is not None:
            _, speed, noise = smoother.moved(position, velocity if position is None else None)
            yield speed[smoother.settles : -smoother.settles], noise[0], position is not None


def _check_rest(path: Path, speed: Array, rest_speed: float, case: Case, findings: Findings | None) -> None:
    """Refuse a recording in which a shaft moves: its friction would be taken for a zero.

    A small mean of a recorded speed may be an offset of its channel: that is told (with `findings`).
    """
    if not stands(speed, rest_speed):
        came, do = "a machine that moves", "Leave it out of zero, or record it with the drive off."
        raise RecordingError(str(path), came, "one at rest", do)
    mean, error = mean_speed(speed)
    if abs(mean) <= PLAIN_CREEP * error:
        return
    shown = f"{mean:.2g} ± {error:.1g} {case.axis.speed} in the mean"
    if findings is None or abs(mean) > CREEPS * rest_speed:
        do = "Leave it out of zero: its friction would be taken for one."
        raise RecordingError(str(path), f"a machine that creeps, at {shown}", "one at rest", do)
    do = "If it crept, leave it out of zero: its friction is in that. If the speed channel is off, nothing."
    findings.warning(Code.CHANNEL_VALUE, "speed", f"at rest: {shown}", do)
