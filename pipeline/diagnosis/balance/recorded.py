"""Recordings of a machine read, differentiated and thinned for the regression."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import decimate

from pmg.pipeline.diagnosis.balance.axis import LINEAR, ROTARY
from pmg.pipeline.diagnosis.balance.case_file import TIMES
from pmg.pipeline.diagnosis.balance.smoothing import Smoother
from pmg.pipeline.diagnosis.balance.term import Motion
from pmg.pipeline.importers.open_source import open_source, whole_channels
from pmg.pipeline.importers.source import channel_of
from pmg.pipeline.recording.findings import Code, Findings
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.case_file import Case
    from pmg.pipeline.diagnosis.balance.term import Motion, Term
    from pmg.pipeline.importers.source import ForeignSource
    from pmg.pipeline.recording.findings import Finding
    from pmg.sim.signals import Array

COASTS = 0.1
"""Force that is recorded, over that of a known inertia, below which a machine is taken to coast."""

RATE_TOLERANCE = 0.01
"""Part by which a time step may differ from that of the stated rate."""

REST = 4.0
"""Standard deviations of the noise of the speed below which a machine counts as at rest."""

WRAPPED = 0.25
"""Part of a turn by which a step of an angle may differ from a whole one to be where it begins anew."""

SPELLINGS = {"·": "", "*": "", "°": "deg", "1/min": "rpm", "U/min": "rpm", "min-1": "rpm", "µ": "u"}
"""Signs and words of units that are written in several ways."""

KNOWN_UNITS = frozenset(
    "".join(unit.split())
    for axis in (LINEAR, ROTARY)
    for units in (TIMES, axis.positions, axis.speeds, axis.forces)
    for unit in units
)
"""Units that a file may declare for a channel of a case, without spaces."""

FEWEST = 1000
"""Fewest samples of a regression; below, neither noise nor structure can be judged."""


@dataclass(frozen=True)
class Recorded:
    """A recording ready for the regression.

    Parameters
    ----------
    name : str
        File name.
    motion : Motion
        At the full sample rate.
    keep_every : int
        Decimation.
    force : (n,) array
        Thinned force [N, N m], known terms taken out; zero of a machine that coasts.
    known : (n,) array
        Thinned force of the terms whose amplitude is known [N, N m].
    findings : tuple of Finding
        What was lost in reading it.
    """

    name: str
    motion: Motion
    keep_every: int
    force: Array
    known: Array
    findings: tuple[Finding, ...] = ()

    @property
    def coasts(self) -> bool:
        """Whether nothing drives the machine."""
        return not self.motion.force.any()

    @property
    def size(self) -> float:
        """Root of the sum of squares of the force; of that of the known terms where the machine coasts."""
        return float(np.linalg.norm(self.known if self.coasts else self.force + self.known))

    def thin(self, columns: Array) -> Array:
        """Every column filtered and decimated like the force (parallel filtering)."""
        return _thin(columns, self.keep_every)

    def columns(self, term: Term[Motion], shape: float = float("nan")) -> Array:
        """Thinned columns of a term (n, amplitudes), per unit."""
        return self.thin(term.columns(self.motion, shape))

    @property
    def time(self) -> Array:
        """Time of the thinned samples [s]."""
        return np.asarray(self.motion.time[:: self.keep_every])


def _thin(columns: Array, keep_every: int) -> Array:
    """Filtered without phase and decimated along the first axis."""
    if keep_every == 1:
        return columns
    return np.asarray(decimate(columns, keep_every, axis=0, zero_phase=True))


def read_recording(path: Path, case: Case) -> Recorded:
    """A recording read and prepared the way its case says.

    Raises
    ------
    RecordingError
        When the file or a channel is missing, not finite, of another rate, or too short.

    Notes
    -----
    Position passes a zero-phase Butterworth low-pass, speed and acceleration are central differences of it, and force
    and every column of the regression are decimated by the same zero-phase filter. A speed that was recorded passes
    the same low-pass; where there is no position, it is the integral of it. The machine counts as at rest below
    `REST` standard deviations of what noise makes of the speed.

    References
    ----------
    A. Janot, M. Gautier, M. Brunot, 'Data Set and Reference Models of EMPS', 2019.
    """
    findings = Findings(path.name)
    values = _channels(path, case, findings)
    time, given = values["time"], case.prepare
    steps = np.diff(time) * given.rate_hz
    wrong = np.flatnonzero(np.abs(steps - 1.0) > RATE_TOLERANCE)
    if len(wrong):
        came = f"{len(wrong)} of {len(steps)} steps differ from 1/{given.rate_hz:g} s, "
        came += f"the first after {time[wrong[0]]:g} s"
        raise RecordingError(f"{path}: time", came, "even sampling at prepare.rate_Hz", "Correct rate or unit of time.")
    smoother = Smoother(given, float((time[-1] - time[0]) / max(len(time) - 1, 1)))
    drop = smoother.settles if given.drop is None else given.drop
    fewest = max(FEWEST * given.keep_every, 8 * given.order) + 2 * drop
    if len(time) < fewest:
        raise RecordingError(str(path), f"{len(time)} samples", f"{fewest} or more", "Record longer, or thin less.")
    position, speed, noise = smoother.moved(values.get("position"), values.get("velocity"))
    inner = slice(drop, -drop)
    rest_speed = REST * noise if given.rest_speed is None else given.rest_speed
    if given.rest_speed is None and float(np.abs(speed[inner]).max()) <= rest_speed:
        came = f"a speed of {np.abs(speed[inner]).max():.3g} {case.axis.speed} at most, which may be noise"
        raise RecordingError(str(path), came, "a machine that moves", "Check the channels and their units.")
    acceleration = smoother.slope(speed)[inner]
    force = _acting(values.get("force", np.zeros_like(time))[inner], acceleration, case, findings)
    motion = Motion(time[inner], position[inner], speed[inner], acceleration, force, 0.0 * force, rest_speed)
    return _with_model(path.name, motion, case, findings.listed())


def _acting(force: Array, acceleration: Array, case: Case, findings: Findings) -> Array:
    """Force that drives the machine (n,): zero where it is next to nothing beside that of a known inertia."""
    inertia = case.fixed.get("inertia", 0.0)
    needed = inertia * float(np.sqrt(np.mean(acceleration**2)))
    size = float(np.sqrt(np.mean(force**2)))
    if not 0.0 < size < COASTS * needed:
        return force
    findings.info(
        Code.CHANNEL_VALUE,
        case.axis.pushes,
        f"{size:.3g} {case.axis.push} rms beside {needed:.3g} {case.axis.push} for the acceleration of the inertia: "
        "the machine is taken to coast, without any",
        "Nothing to do; if it was driven, correct baseline.fixed.inertia.",
    )
    return 0.0 * force


def _with_model(name: str, motion: Motion, case: Case, findings: tuple[Finding, ...]) -> Recorded:
    """The recording with what the baseline gives, and with the known terms taken out of the force."""
    terms = {term.identifier: term for term in case.library}
    columns = {key: terms[key].columns(motion, float("nan"))[:, 0] for key in case.baseline}
    known = np.zeros_like(motion.force)
    for key, value in case.fixed.items():
        known = known + value * columns[key]
    free = np.stack([columns[key] for key in case.baseline if key not in case.fixed], axis=1)
    thinned = _thin(np.c_[motion.force, known, free], case.prepare.keep_every)
    rest = thinned[:, 0] - thinned[:, 1]
    solution = np.linalg.lstsq(thinned[:, 2:], rest, rcond=None)[0]
    whole = replace(motion, modelled=known + free @ solution)
    return Recorded(name, whole, case.prepare.keep_every, rest, thinned[:, 1], findings)


def _channels(path: Path, case: Case, findings: Findings) -> dict[str, Array]:
    """Channels of a file in SI, all of one length and finite; without a force that is zero throughout."""
    if not path.is_file():
        do = "Check record.folder, or name the folder of the recordings with --data."
        raise RecordingError(str(path), "no such file", "a recording", do)
    source = open_source(path, case.form, findings)
    _check_units(source, case, findings)
    found = whole_channels(source, [channel.name for channel, _ in case.channels.values()])
    values = {}
    for kind, (channel, unit) in case.channels.items():
        factor = channel.factor
        if isinstance(factor, str):
            given = whole_channels(source, [factor])[factor]
            if len(given) != 1:
                came = f"{len(given)} values"
                raise RecordingError(f"{path}: {factor}", came, "one number", f"Give {case.axis.factor} as a number.")
            factor = float(given[0])
        values[kind] = found[channel.name] * unit * factor
    if "position" in values and case.axis.turn:
        values["position"] = _unwrapped(values["position"], case.axis.turn, findings)
    lengths = {len(value) for value in values.values()}
    if len(lengths) > 1:
        came = ", ".join(f"{kind}: {len(value)}" for kind, value in values.items())
        raise RecordingError(str(path), f"channels of several lengths ({came})", "one length", "Export them together.")
    for kind, value in values.items():
        bad = np.flatnonzero(~np.isfinite(value))
        if len(bad):
            came = f"{len(bad)} values are no numbers, the first in row {bad[0] + 1}"
            raise RecordingError(
                f"{path}: {case.channels[kind][0].name}", came, "numbers", "Mend or cut the recording."
            )
        if float(np.ptp(value)) == 0.0 and not (kind == "force" and "inertia" in case.fixed):
            do = "Check the channel; of a machine that coasts, set baseline.fixed.inertia."
            raise RecordingError(f"{path}: {case.channels[kind][0].name}", "the same value throughout", "a signal", do)
    return values


def _unwrapped(angle: Array, turn: float, findings: Findings) -> Array:
    """An angle that begins anew at each turn, counted on (n,) [rad]; any other as it is."""
    steps = np.diff(angle)
    jumps = np.abs(np.abs(steps) - turn) < WRAPPED * turn
    if not jumps.any() or np.abs(steps[~jumps]).max(initial=0.0) > 0.5 * turn:
        return angle
    message = f"it begins anew {counted(int(jumps.sum()), 'time')}, and is counted on"
    findings.info(Code.CHANNEL_VALUE, "position", message, "Nothing to do.")
    return np.asarray(np.unwrap(angle, period=turn))


def _check_units(source: ForeignSource, case: Case, findings: Findings) -> None:
    """Refuse a channel whose file declares another unit than the case; tell one that is not understood."""
    for channel, _ in case.channels.values():
        where = f"{source.path}: {channel.name}"
        declared = _spelled(channel_of(source, channel.name, where).unit)
        if not declared or declared == _spelled(channel.unit):
            continue
        if declared in KNOWN_UNITS:
            do = "Correct the unit in the case, or the file."
            raise RecordingError(where, f"the unit {declared}", channel.unit, do)
        message = f"the file's unit '{declared}' is not understood; {channel.unit} is taken, as the case says"
        findings.info(Code.CHANNEL_KEY, channel.name, message, "Check it.")


def _spelled(unit: str) -> str:
    """A unit in the spelling of `KNOWN_UNITS`."""
    for sign, plain in SPELLINGS.items():
        unit = unit.replace(sign, plain)
    return "".join(unit.split())
