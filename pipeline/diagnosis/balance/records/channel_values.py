"""Channels of one file in SI: of one length, finite, angles counted on, units checked against what the file says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.case import OUTPUT
from pmg.pipeline.importers.open_source import open_source, whole_channels
from pmg.pipeline.importers.source import channel_of
from pmg.pipeline.machine.axis import LINEAR, ROTARY
from pmg.pipeline.machine.channel import COUNT, TIMES
from pmg.pipeline.recording.checks.renewal import tell_renewals
from pmg.pipeline.recording.findings import Code, Findings
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.units import COUNT as COUNTS
from pmg.pipeline.wording.units import TEMPERATURE_UNITS
from pmg.pipeline.wording.units import declared as declared_unit
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.importers.source import ForeignSource
    from pmg.pipeline.machine.channel import Channel
    from pmg.sim.signals import Array

SAME_RATE = 1e-6
"""Part by which a rate that a file declares may differ from the one that is stated."""

WRAPPED = 0.25
"""Part of a turn by which a step of an angle may differ from a whole one to be where it begins anew."""

FILLED = 0.97
"""Part of its period that a position fills which begins anew, noise at its ends allowed for."""

COUNT_WORDS = {"count", "counts", "ticks"}
"""Units of a counter, as files spell them."""

COUNTER_BITS = 16, 24, 32
"""Widths of counters, which begin anew after so many bits."""

SPELLINGS = {"·": "", "*": "", "°": "deg", "1/min": "rpm", "U/min": "rpm", "min-1": "rpm", "µ": "u"}
"""Signs and words of units that are written in several ways."""

KNOWN_UNITS = frozenset(
    "".join(unit.split())
    for axis in (LINEAR, ROTARY)
    for units in (TIMES, TEMPERATURE_UNITS, axis.positions, axis.speeds, axis.forces)
    for unit in units
)
"""Units that a file may declare for a channel of a case, without spaces."""


OTHER_UNITS = frozenset(
    ["Nmm", "Ncm", "lbfft", "ftlbf", "lbft", "ftlb", "lbfin", "inlbf", "kgfm", "kpm", "1/s", "Hz", "lbf", "kgf"]
)
"""Units that a file may declare and that are not read, without spaces: what they are is known, and it is another."""


def channels_in_si(
    path: Path, case: Case, channels: Mapping[str, tuple[Channel, float]], findings: Findings
) -> dict[str, Array]:
    """Channels of a file in SI, all of one length and finite; times as they are.

    Parameters
    ----------
    path : Path
        The file.
    case : Case
        How it is written, and what its machine is.
    channels : mapping of str to (Channel, float)
        Names in the file, and what one unit of each is in SI.
    findings : Findings
        Receives what is told about them.

    Raises
    ------
    RecordingError
        When the file or a channel is missing, holds what is no number, or is the same throughout.
    """
    if not path.is_file():
        do = "Check the folder of the recordings."
        raise RecordingError(str(path), "no such file", "a recording", do)
    source = open_source(path, case.form, findings)
    _check_units(source, channels, findings)
    own_clock = "" if "time" in channels else _own_clock(source, channels)
    found = whole_channels(source, [*(channel.name for channel, _ in channels.values()), *filter(None, [own_clock])])
    values = {}
    for kind, (channel, unit) in channels.items():
        values[kind] = found[channel.name] * unit * _factor(source, channel, case) - case.tares.get(kind, 0.0)
    if own_clock:
        values["time"] = found[own_clock]
    lengths = {len(value) for value in values.values()}
    if len(lengths) > 1:
        came = ", ".join(f"{kind}: {len(value)}" for kind, value in values.items())
        raise RecordingError(str(path), f"channels of several lengths ({came})", "one length", "Export them together.")
    moving = [float(np.ptp(each)) > 0.0 for kind, each in values.items() if kind.endswith("position")]
    moving += [bool(each.any()) for kind, each in values.items() if kind.endswith("velocity")]
    at_rest = bool(moving) and not any(moving)  # the whole machine stands, which `stands` judges
    for kind, value in values.items():
        if kind == "time":
            continue
        bad = np.flatnonzero(~np.isfinite(value))
        where = f"{path}: {channels[kind][0].name}"
        if len(bad):
            came = f"{len(bad)} values are no numbers, the first in row {bad[0] + 1}"
            raise RecordingError(where, came, "numbers", "Mend or cut the recording.")
        may_rest = kind == "temperature" or (kind == "force" and "inertia" in case.fixed) or at_rest
        if float(np.ptp(value)) == 0.0 and not may_rest:
            do = "Check the channel; of a machine that coasts, state its inertia."
            raise RecordingError(where, "the same value throughout", "a signal", do)
    if "time" not in values:
        values["time"] = _by_rate(source, channels, lengths.pop(), case.prepare.rate_hz)
    step = float(np.median(np.diff(values["time"])))
    for kind in (kind for kind in values if kind.endswith(("force", "velocity"))):
        tell_renewals(channels[kind][0].name, values[kind], step, findings)
    for kind in (kind for kind in ("position", f"{OUTPUT}position") if kind in values):
        channel, count = channels[kind]
        widths = [2.0**bits * abs(count) for bits in COUNTER_BITS if channel.unit == COUNT]
        periods = [*widths, *(turn for turn in (case.axis.turn,) if turn)]
        values[kind] = _unwrapped(values[kind], periods, channel.name, findings)
    return values


def _own_clock(source: ForeignSource, channels: Mapping[str, tuple[Channel, float]]) -> str:
    """Channel in which the file itself gives the times of these [s]; empty where it gives none, or several."""
    clocks = {
        channel_of(source, channel.name, f"{source.path}: {channel.name}").clock for channel, _ in channels.values()
    }
    return clocks.pop() if len(clocks) == 1 else ""


def _by_rate(
    source: ForeignSource, channels: Mapping[str, tuple[Channel, float]], length: int, rate_hz: float
) -> Array:
    """Times of samples that have none (n,) [s], by the rate; one that the file declares must be the same."""
    for channel, _ in channels.values():
        declared = channel_of(source, channel.name, f"{source.path}: {channel.name}").rate_hz
        if declared is not None and abs(declared / rate_hz - 1.0) > SAME_RATE:
            where, do = f"{source.path}: {channel.name}", "Correct rate_Hz, or name the channel of the times."
            raise RecordingError(where, f"{declared:g} Hz declared", f"rate_Hz = {rate_hz:g}", do)
    return np.arange(length) / rate_hz


def _factor(source: ForeignSource, channel: Channel, case: Case) -> float:
    """Force or torque of one unit of a command: as stated, or as a variable of the file holds it."""
    factor = channel.factor
    if isinstance(factor, float | int):
        return float(factor)
    given = whole_channels(source, [factor])[factor]
    if len(given) != 1:
        came, do = f"{len(given)} values", f"Give {case.axis.factor} as a number."
        raise RecordingError(f"{source.path}: {factor}", came, "one number", do)
    return float(given[0])


def _unwrapped(angle: Array, periods: Sequence[float], name: str, findings: Findings) -> Array:
    """A position that begins anew after a turn, or a period of its counter, counted on (n,); any other as it is.

    What begins anew keeps within its period, and jumps by nearly all of its range: of the `periods` that hold it, the
    one that its jumps come nearest to is taken.
    """
    steps, reach = np.abs(np.diff(angle)), float(np.ptp(angle))
    jumps = steps[steps > 0.5 * reach]
    holding = [period for period in periods if FILLED * reach <= period]
    if not len(jumps) or not holding:
        return angle
    period = min(holding, key=lambda each: float(np.median(np.abs(jumps - each))))
    if float(np.median(np.abs(jumps - period))) < WRAPPED * period:
        message = f"it begins anew {counted(len(jumps), 'time')}, after {period:.6g}, and is counted on"
        findings.info(Code.CHANNEL_VALUE, name, message, "Nothing to do.")
        return np.asarray(np.unwrap(angle, period=period))
    if reach >= FILLED * period:
        message = f"it jumps {counted(len(jumps), 'time')} by more than half of its range of {reach:.6g}"
        do = "If it begins anew, record it more often than it does so twice: it is taken as it is."
        findings.warning(Code.CHANNEL_VALUE, name, message, do)
    return angle


def _check_units(source: ForeignSource, channels: Mapping[str, tuple[Channel, float]], findings: Findings) -> None:
    """Refuse a channel whose file declares another unit than the case; tell one that is not understood."""
    for channel, _ in channels.values():
        where = f"{source.path}: {channel.name}"
        declared = _spelled(channel_of(source, channel.name, where).unit)
        if not declared or declared == _spelled(channel.unit):
            continue
        if channel.unit == COUNT and declared_unit(declared) in COUNTS:
            continue
        if declared in COUNT_WORDS:
            do = 'Give unit = "count", and counts_per_turn or resolution of the encoder.'
            raise RecordingError(where, f"the unit {declared}", channel.unit, do)
        if declared in KNOWN_UNITS:
            do = "Correct the unit where the channel is named, or the recording."
            raise RecordingError(where, f"the unit {declared}", channel.unit, do)
        if declared in OTHER_UNITS:
            do = "Convert the channel, or declare it right in the file."
            raise RecordingError(where, f"the unit {declared}", channel.unit, do)
        message = f"the file's unit '{declared}' is not understood; {channel.unit} is taken"
        findings.warning(Code.CHANNEL_KEY, channel.name, message, "Check it: all that follows scales with it.")


def _spelled(unit: str) -> str:
    """A unit in the spelling of `KNOWN_UNITS`."""
    for sign, plain in SPELLINGS.items():
        unit = unit.replace(sign, plain)
    return "".join(unit.split())
