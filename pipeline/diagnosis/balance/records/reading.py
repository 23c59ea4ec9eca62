"""Recordings of a machine read, differentiated and put one after the other for the regression."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.term import (
    ELAPSED,
    NOISY,
    OUT,
    OUT_ANGLE,
    STEPS,
    TEMPERATURE,
    TURNED_BEFORE,
    Motion,
)
from pmg.pipeline.diagnosis.balance.records.clock_of import clock_of
from pmg.pipeline.diagnosis.balance.records.consistency import check_limits, check_motion, check_nominal
from pmg.pipeline.diagnosis.balance.records.lags import with_lags
from pmg.pipeline.diagnosis.balance.records.recorded import REST, inertia_of, joined, with_known
from pmg.pipeline.diagnosis.balance.records.row_noise import noise_of_steps, with_row_noise
from pmg.pipeline.diagnosis.balance.records.smoothing import Smoother
from pmg.pipeline.diagnosis.balance.records.standing import stands
from pmg.pipeline.diagnosis.balance.records.two_shafts import second_shaft
from pmg.pipeline.recording.findings import Code, Finding, Findings
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.importers.clocks.clock import EvenStretch
    from pmg.sim.signals import Array

COASTS = 0.1
"""Force that is recorded, over that of a known inertia, below which a machine is taken to coast."""

KEPT = 0.4
"""Part of the thinned rate up to which the decimation keeps a force."""

CLEAR, ABOVE = 1.25, 1.6
"""Low-pass of the motion over that frequency: the least that cuts little of the acceleration, and the one proposed."""

LEAST = 40
"""Thinned samples of the shortest stretch that is used: the decimation needs 28."""

FEWEST = 1000
"""Fewest samples of a regression; below, neither noise nor structure can be judged."""


@dataclass(frozen=True)
class _Read:
    """One recording, differentiated."""

    name: str
    motion: Motion
    findings: tuple[Finding, ...]

    def part(self, rows: slice) -> _Read:
        """Some of its samples."""
        return replace(self, motion=self.motion.part(rows))


def read_recordings(case: Case) -> tuple[Recorded, Recorded | None]:
    """The recordings that a case fits, and those that it withholds (None without any).

    Raises
    ------
    RecordingError
        When a file or a channel is missing, not finite, of another rate, or too short.

    Notes
    -----
    Position passes a zero-phase Butterworth low-pass, speed and acceleration are central differences of it, of fourth
    order, and force and every column of the regression are decimated by the same zero-phase filter. A speed that was
    recorded passes the same low-pass; where there is no position, it is the integral of it. The machine counts as at
    rest below `REST` standard deviations of what noise makes of the speed.

    References
    ----------
    A. Janot, M. Gautier, M. Brunot, 'Data Set and Reference Models of EMPS', 2019.
    """
    resting: list[Finding] = []
    fit, withheld = (_moving(paths, case, resting) for paths in (case.fit, case.withheld))
    if case.withheld_part is not None:
        cut = [round((1.0 - case.withheld_part) * len(one.motion.time)) for one in fit]
        withheld = [
            replace(one.part(slice(at, None)), name=f"{one.name}, withheld part", findings=())
            for one, at in zip(fit, cut, strict=True)
        ]
        fit = [one.part(slice(None, at)) for one, at in zip(fit, cut, strict=True)]
        fit, withheld = ([one for one in part if _long_enough(one, case)] for part in (fit, withheld))
        if not fit or not withheld:
            came, do = "stretches too short to withhold a part of", "Withhold whole recordings by name."
            raise RecordingError(", ".join(path.name for path in case.fit), came, "longer stretches", do)
    fitted = _together(fit, case)
    fitted = replace(fitted, findings=(*case.findings, *resting, *fitted.findings))
    return fitted, _together(withheld, case, fitted) if withheld else None


class _StandsError(RecordingError):
    """A recording, or a stretch of one, in which the machine never moves; with the name of its file."""

    def __init__(self, path: Path, came: str, do: str) -> None:
        super().__init__(str(path), came, "a machine that moves", do)
        self.file = path.name


def _moving(paths: Sequence[Path], case: Case, resting: list[Finding]) -> list[_Read]:
    """Recordings read; of those in which the machine stands, it is told that they are left out.

    Raises
    ------
    RecordingError
        When it stands in all of them.
    """
    found, still = [], list[_StandsError]()
    for path in paths:
        try:
            found += _read(path, case)
        except _StandsError as fault:
            still.append(fault)
    if still and not found:
        raise still[0]
    for each in still:
        told = Findings(each.file)
        told.warning(Code.CHANNEL_VALUE, "speed", f"{each.came}: left out", each.do)
        resting += told.listed()
    return found


def _long_enough(read: _Read, case: Case) -> bool:
    return len(read.motion.time) >= LEAST * case.prepare.keep_every


def _together(read: Sequence[_Read], case: Case, of: Recorded | None = None) -> Recorded:
    """Recordings one after the other, enough of them."""
    motion = joined([one.motion for one in read])
    found = with_known([one.name for one in read], motion, case, [f for one in read for f in one.findings], of)
    fewest = (FEWEST if of is None else LEAST) * case.prepare.keep_every  # noise is judged where terms are fitted
    if (left := len(found.force) * case.prepare.keep_every) < fewest:
        came = f"{left} samples once the ends that filters spoil, and where it stands, are left out"
        names = ", ".join(one.name for one in read)
        kept = case.prepare.keep_every
        expected = f"{fewest} or more: {fewest // kept} of which one in {kept} is kept (keep_every)"
        raise RecordingError(names, came, expected, "Record longer, or lower keep_every.")
    smoother = Smoother(case.prepare, motion.sample_time)
    found = with_row_noise(found, inertia_of(case, found.baseline), smoother)
    return with_lags(found, case) if of is None else found


def _read(path: Path, case: Case) -> list[_Read]:
    """The stretches of one recording on an even clock, differentiated, without the ends that filters spoil."""
    findings = Findings(path.name)
    clock = clock_of(path, case, findings)
    _tell_band(case, clock.rate_hz, findings)
    smoother = Smoother(case.prepare, 1.0 / clock.rate_hz)
    fewest = _fewest(smoother, case)
    whole = [stretch for stretch in clock.stretches if len(stretch.time) >= fewest]
    if not whole:
        most = max(len(stretch.time) for stretch in clock.stretches)
        raise RecordingError(str(path), f"{most} samples in a row", f"{fewest} or more", "Record longer.")
    for short in (stretch for stretch in clock.stretches if len(stretch.time) < fewest):
        message = f"the {len(short.time)} samples from {short.start:g} s are left out: filters need {fewest}"
        findings.info(Code.SAMPLES_GAP, "time", message, "Nothing to do, or record without pauses.")
    name = case.label(path)
    begun = clock.stretches[0].start
    found, still, told = list[tuple[str, Motion]](), list[_StandsError](), list[Finding]()
    for k, stretch in enumerate(whole, 1):
        own = Findings(path.name)  # what is said of a stretch that stands is of noise
        try:
            motion = _moved(path, stretch, begun, smoother, case, own)
        except _StandsError as fault:
            still.append(fault)
            message = f"the machine stands in the {len(stretch.time)} samples from {stretch.start:g} s: left out"
            findings.info(Code.SAMPLES_GAP, "time", message, "Nothing to do.")
        else:
            found.append((name if len(whole) == 1 else f"{name} ({k})", motion))
            told += [each for each in own.listed() if each not in told]
    if not found:
        raise still[0]
    said = (*findings.listed(), *told)
    return [_Read(called, motion, said if k == 0 else ()) for k, (called, motion) in enumerate(found)]


def _tell_band(case: Case, rate_hz: float, findings: Findings) -> None:
    """Tell a low-pass below what the thinned force keeps, or at its edge: the acceleration is cut there alone."""
    kept = KEPT * rate_hz / case.prepare.keep_every
    if case.prepare.keep_every == 1 or case.prepare.low_pass_hz >= CLEAR * kept:
        return
    if case.prepare.low_pass_hz >= 0.99 * kept:
        message = f"low_pass_Hz = {case.prepare.low_pass_hz:g} cuts the acceleration near {kept:.4g} Hz, not the force"
        do = f"If the machine sticks or jerks at reversals: low_pass_Hz = {ABOVE * kept:.3g}, or raise keep_every."
        findings.info(Code.CHANNEL_VALUE, "low_pass_Hz", message, do)
        return
    message = f"low_pass_Hz = {case.prepare.low_pass_hz:g}, but the thinned force holds all up to {kept:.4g} Hz"
    do = "Raise keep_every or low_pass_Hz: what is cut in the motion alone is taken for a mismatch."
    findings.warning(Code.CHANNEL_VALUE, "low_pass_Hz", message, do)


def _fewest(smoother: Smoother, case: Case) -> int:
    """Samples in a row that filters need."""
    ends = 8 * case.prepare.order + 2 * _dropped(smoother, case) + 2
    return ends + LEAST * case.prepare.keep_every


def _dropped(smoother: Smoother, case: Case) -> int:
    """Samples at either end that filters spoil, with two torques those of the slower one."""
    if case.prepare.drop is not None:
        return case.prepare.drop
    return smoother.settles if case.ratio is None else smoother.settles_further


def _moved(
    path: Path, stretch: EvenStretch, begun: float, smoother: Smoother, case: Case, findings: Findings
) -> Motion:
    """Position, speed, acceleration and force of one stretch of a recording that began at a time [s]."""
    values, time, given = dict(stretch.channels), stretch.time, case.prepare
    drop = _dropped(smoother, case)
    check_motion(values, smoother, findings)
    check_limits(values, findings)
    check_nominal(values, case.nominal, case.axis.push, findings)
    besides = {key: values[key] for key in (TEMPERATURE,) if key in values}
    if case.ratio is not None:
        values, load = second_shaft(values, case, findings)
        besides[OUT] = smoother.smoothed_further(load)
    position, speed, noise = smoother.moved(values.get("position"), values.get("velocity"))
    if "velocity" not in values:
        besides[STEPS] = noise_of_steps(values["position"], position, smoother)
    if case.ratio is not None:
        besides[OUT_ANGLE] = position / case.ratio
    besides[ELAPSED] = time - begun
    inner = slice(drop, -drop)
    rest_speed = REST * noise[0] if given.rest_speed is None else given.rest_speed
    besides[TURNED_BEFORE] = np.full_like(time, _turned_before(position[: drop + 1], speed[: drop + 1], rest_speed))
    if given.rest_speed is None and stands(speed[inner], rest_speed):
        came = f"a speed of {np.abs(speed[inner]).max():.3g} {case.axis.speed} at most, which may be noise"
        raise _StandsError(path, came, _of_rest(path, values.get("force"), case))
    acceleration = smoother.slope(speed)[inner]
    besides[NOISY] = np.zeros_like(time)
    besides[NOISY][inner] = smoother.noise_in(acceleration, noise[1], of_position="velocity" not in values)
    force = _acting(values.get("force", np.zeros_like(time))[inner], acceleration, case, findings)
    return Motion(
        time[inner],
        position[inner],
        speed[inner],
        acceleration,
        force,
        0.0 * force,
        rest_speed,
        (0,),
        {key: each[inner] for key, each in besides.items()},
        REST * noise[1],
    )


def _of_rest(path: Path, force: Array | None, case: Case) -> str:
    """What to do with a record at rest: its mean is the zero, where the drive was off."""
    check = "Check the channels and their units."
    if force is None or not case.shaft:
        return check
    zero = f"its mean, {float(np.mean(force)):.4g} {case.axis.push}"
    return f'{check} If the drive was off, [records] zero = ["{path.name}"] takes {zero}, for the zero.'


def _turned_before(position: Array, speed: Array, rest_speed: float) -> float:
    """Way to the last sample since the sense changed last [m, rad]; one unit where it did not."""
    moves = np.flatnonzero(np.abs(speed) > rest_speed)
    other = moves[np.sign(speed[moves]) != np.sign(speed[moves[-1]])] if len(moves) else moves
    return float(np.abs(np.diff(position[other[-1] :])).sum()) if len(other) else 1.0


def _acting(force: Array, acceleration: Array, case: Case, findings: Findings) -> Array:
    """Force that drives the machine (n,): zero where it is next to nothing beside that of a known inertia."""
    inertia = case.fixed.get("inertia", 0.0)
    needed = inertia * float(np.sqrt(np.mean(acceleration**2)))
    size = float(np.sqrt(np.mean(force**2)))
    if case.ratio is not None or not 0.0 < size < COASTS * needed:
        return force
    findings.info(
        Code.CHANNEL_VALUE,
        case.axis.pushes,
        f"{size:.3g} {case.axis.push} rms beside {needed:.3g} {case.axis.push} for the acceleration of the inertia: "
        "the machine is taken to coast, without any",
        "Nothing to do; if it was driven, correct the inertia that is fixed.",
    )
    return 0.0 * force
