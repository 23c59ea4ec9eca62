"""A machine file proposed from what a recording shows: channels by names, units and shapes, for the user to confirm."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.importers.guess.signal_kinds import (
    SPELLED_TEMPERATURES,
    is_set_point,
    kinds_by_name,
    side_of,
    unit_by_name,
    words_of,
)
from pmg.pipeline.importers.guess.signal_look import look_at
from pmg.pipeline.importers.open_source import whole_channels
from pmg.pipeline.importers.rows import WHOLE_RATE
from pmg.pipeline.machine.axis import LINEAR, ROTARY
from pmg.pipeline.machine.channel import COMMANDS, TIMES
from pmg.pipeline.wording.units import declared
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pmg.pipeline.importers.guess.signal_look import SeenSignal
    from pmg.pipeline.importers.source import ForeignSource
    from pmg.pipeline.machine.axis import Axis
    from pmg.sim.signals import Array

ENDS = ("input", "output")
"""Shafts of a machine with two."""
END_WORDS = (
    {
        "input": "input drive in antrieb eingang motor sun sonne",
        "output": "output load out abtrieb ausgang brake bremse ring hohlrad",
    },
    {"input": "1", "output": "2"},
)
"""Words of names that say which, the more certain ones first."""
PUSH_WORDS = ("force", "kraft")
"""Words of a force, beside those of a torque."""
KINDS = {"angle": "position", "speed": "velocity", "torque": "force"}
"""Kinds of channels of a shaft by those of signals; a force or a torque drives it."""
LIKELY_RATES = 20.0, 2e5
"""Rates between which a column without a unit is likely a time [Hz]."""
AS_TEMPERATURE = {"K": "K"} | dict.fromkeys(("degC", "°C", "C"), "degC")
"""Units of temperatures that a machine file knows, by how they are spelled; another one is left open."""
SURE = 0.98
"""Correlation of two speeds from which on their ratio is that of a gear."""


@dataclass(frozen=True)
class ChannelGuess:
    """A channel of a recording and what it may be.

    Parameters
    ----------
    seen : SeenSignal
        What it shows.
    kind : str
        ``position``, ``velocity``, ``force``, ``current``, ``temperature``, ``time``; empty where not known.
    end : str
        Shaft, one of `ENDS`; empty where no word tells it.
    unit : str
        Unit; empty where the user has to name it.
    reason : str
        Why it is taken for that, or for nothing.
    """

    seen: SeenSignal
    kind: str
    end: str
    unit: str
    reason: str

    @property
    def name(self) -> str:
        """Name of the channel."""
        return self.seen.channel.name

    @property
    def certain(self) -> bool:
        """Whether it can be taken as it is."""
        return bool(self.unit) and self.unit not in COMMANDS and not self.seen.constant

    def document(self) -> dict[str, Any]:
        """The same as JSON."""
        return {
            "source": self.name,
            "kind": self.kind,
            "shaft": self.end,
            "unit": self.unit,
            "reason": self.reason,
            "seen": self.seen.document(),
        }


@dataclass(frozen=True)
class MachineGuess:
    """A machine as a recording shows it.

    Parameters
    ----------
    source : ForeignSource
        The recording.
    axis : Axis
        Whether it slides or turns.
    channels : mapping of (str, str) to tuple of ChannelGuess
        What may be each channel, by shaft and kind; the shaft is ``shaft`` where there is one.
    time, temperature : tuple of ChannelGuess
        What may be the time, and a temperature.
    rate_hz : float or None
        Samples per second [Hz]; None where nothing tells it.
    ratio : float or None
        Speed of the input over that of the output; None where the speeds do not show one.
    against : bool
        Whether both torques put power in most of the time, so that one of them counts what comes out.
    left : tuple of ChannelGuess
        Channels that are taken for nothing.
    apart : mapping of str to str
        Kinds of channels that cannot be set side by side on both shafts, and why.
    """

    source: ForeignSource
    axis: Axis
    channels: Mapping[tuple[str, str], tuple[ChannelGuess, ...]]
    time: tuple[ChannelGuess, ...]
    temperature: tuple[ChannelGuess, ...]
    rate_hz: float | None
    ratio: float | None
    against: bool
    left: tuple[ChannelGuess, ...]
    apart: Mapping[str, str] = field(default_factory=dict)

    @property
    def shafts(self) -> tuple[str, ...]:
        """Names of the shafts, the input first."""
        return tuple(dict.fromkeys(end for end, _ in self.channels))

    def chosen(self, end: str, kind: str) -> ChannelGuess | None:
        """The one channel that fits, where nothing is open."""
        fitting = self.channels.get((end, kind), ())
        return fitting[0] if len(fitting) == 1 and fitting[0].certain else None

    def document(self) -> dict[str, Any]:
        """The same as JSON."""
        channels = [
            {"channel": kind, "chosen": one.name if (one := self.chosen(end, kind)) else None}
            | {"shaft": end, "candidates": [each.document() for each in fitting]}
            for (end, kind), fitting in self.channels.items()
        ]
        return {
            "channels": channels,
            "time": [one.document() for one in self.time],
            "temperature": [one.document() for one in self.temperature],
            "rate_hz": self.rate_hz,
            "ratio": self.ratio,
            "apart": dict(self.apart),
            "left": [one.document() for one in self.left],
        }


def guess_machine(source: ForeignSource) -> MachineGuess:
    """A machine proposed from names, units and shapes of the channels of one of its recordings.

    Notes
    -----
    Two shafts are proposed where words of names tell of both. The ratio of a gear is the slope of one speed over the
    other. Set-points are left aside, a current where a torque was measured. Where two channels fit, a unit is not
    known, or a current or voltage lacks its factor, the line is left open.
    """
    guessed = [_guess_channel(seen) for seen in look_at(source)]
    units = [one.unit for one in guessed if one.kind in KINDS.values()]
    axis = LINEAR if any(unit in _of_axis(LINEAR) for unit in units) else ROTARY
    fitting = [one for one in guessed if one.kind in (*KINDS.values(), "current") and _fits(one, axis)]
    two = {one.end for one in fitting} >= set(ENDS) and axis is ROTARY
    found: dict[tuple[str, str], tuple[ChannelGuess, ...]] = {}
    for end in ENDS if two else ("shaft",):
        ours = [one for one in fitting if one.end == end or not two]
        for kind in KINDS.values():
            of_kind = tuple(one for one in ours if one.kind == kind)
            if kind == "force":
                of_kind = of_kind or tuple(one for one in ours if one.kind == "current")
            if of_kind:
                found[end, kind] = of_kind
    time = tuple(one for one in guessed if one.kind == "time" and one.seen.rising)
    warm = tuple(one for one in guessed if one.kind == "temperature")
    taken = {one.name for ones in (*found.values(), time, warm) for one in ones}
    left = tuple(one for one in guessed if one.name not in taken)
    guess = MachineGuess(source, axis, found, time, warm, _rate(source, time), None, False, left)
    return _with_shapes(guess) if two else guess


def _guess_channel(seen: SeenSignal) -> ChannelGuess:
    """What a channel may be: by its unit, else by the words of its name."""
    channel = seen.channel
    named, _ = kinds_by_name(channel.name)
    words = set(words_of(channel.name))
    end = side_of(channel.name, END_WORDS)
    unit = declared(channel.unit) or unit_by_name(channel.name, (*_of_axis(LINEAR), *_of_axis(ROTARY)))
    if seen.fault or seen.missing == seen.values:
        return ChannelGuess(seen, "", end, unit, seen.fault or "no value")
    of_shafts = tuple(kind for kind in named if kind in KINDS)
    kind = _kind(unit, of_shafts if end and not unit and len(of_shafts) == 1 else named, words)
    if is_set_point(channel.name) and kind != "time":
        return ChannelGuess(seen, "", end, unit, "a set-point by its name, and not measured")
    if not kind:
        reason = f"the unit {unit} does not tell" if unit else "no unit"
        return ChannelGuess(seen, "", end, unit, f"{reason}, and neither does its name")
    reason = f"unit {unit}" if unit else "by its name alone"
    unit = AS_TEMPERATURE.get(unit, "") if kind == "temperature" else unit
    if kind == "time" and not unit:
        reason = "by its name alone; the unit is the one that gives a likely rate"
        return ChannelGuess(seen, kind, end, _likely_time(seen), reason)
    return ChannelGuess(seen, kind, end, unit, reason + (f", {end} by its name" if end else ""))


def _kind(unit: str, named: tuple[str, ...], words: set[str]) -> str:
    """Kind of a channel; empty where neither unit nor name tells."""
    if unit in TIMES:
        return "time"
    if unit in SPELLED_TEMPERATURES:
        return "temperature"
    if unit in COMMANDS:
        return "force" if "torque" in named or words & set(PUSH_WORDS) else "current" if unit == "A" else ""
    for axis in (ROTARY, LINEAR):
        for kind, known in (("position", axis.positions), ("velocity", axis.speeds), ("force", axis.forces)):
            if unit in known:
                return kind
    if unit or len(named) > 1:
        return ""
    if words & set(PUSH_WORDS):
        return "force"
    return KINDS.get(named[0], named[0]) if named and named[0] != "ticks" else ""


def _of_axis(axis: Axis) -> tuple[str, ...]:
    """Units that only an axis of this kind has."""
    return tuple(unit for known in (axis.positions, axis.speeds, axis.forces) for unit in known if unit not in COMMANDS)


def _fits(guess: ChannelGuess, axis: Axis) -> bool:
    return not guess.unit or guess.unit in COMMANDS or guess.unit in _of_axis(axis)


def _likely_time(seen: SeenSignal) -> str:
    low, high = LIKELY_RATES
    return next((u for u, one in TIMES.items() if seen.step > 0.0 and low <= 1.0 / (seen.step * one) <= high), "")


def _rate(source: ForeignSource, time: Iterable[ChannelGuess]) -> float | None:
    """Sample rate by a time column, else as the file declares it [Hz]."""
    for one in time:
        if one.unit:
            rate = 1.0 / (one.seen.step * TIMES[one.unit])
            return float(round(rate) if abs(rate - round(rate)) <= WHOLE_RATE * rate else f"{rate:.9g}")
    rates = {channel.rate_hz for channel in source.channels} - {None}
    return rates.pop() if len(rates) == 1 else None


def _with_shapes(guess: MachineGuess) -> MachineGuess:
    """The ratio that the speeds show, and whether the torques count against each other; open where they stand apart."""
    single = {key: ones[0] for key, ones in guess.channels.items() if len(ones) == 1 and not ones[0].seen.constant}
    known = {**guess.axis.positions, **guess.axis.speeds, **guess.axis.forces}
    pairs: dict[str, list[Array]] = {}
    apart: dict[str, str] = {}
    for kind in KINDS.values():
        ends = [single[end, kind] for end in ENDS if (end, kind) in single]
        if len(ends) < len(ENDS) or len({bool(one.unit) for one in ends}) > 1:
            continue  # their units are known of both, or of none
        rates = sorted({rate for one in ends if (rate := one.seen.channel.rate_hz) is not None})
        try:
            values = whole_channels(guess.source, [one.name for one in ends])
        except RecordingError as fault:
            apart[kind] = fault.came
            continue
        if len(rates) > 1:
            apart[kind] = f"rates of {' and '.join(f'{rate:g}' for rate in rates)} Hz"
            continue
        pairs[kind] = [values[each.name] * known.get(each.unit, 1.0) for each in ends]
    slopes = (_slope(*pairs[kind]) for kind in ("velocity", "position") if kind in pairs)
    ratio = next((found for found in slopes if found is not None), None)
    against = False
    if ratio is not None and "force" in pairs:
        against = float(np.nanmean(np.sign(pairs["force"][0] * pairs["force"][1] * ratio))) > 0.0
    return replace(guess, ratio=ratio, against=against, apart=apart)


def _slope(one: Array, other: Array) -> float | None:
    """How much faster one changes than the other, in four digits; None where they do not go together."""
    both = np.isfinite(one) & np.isfinite(other)
    a, b = one[both] - one[both].mean(), other[both] - other[both].mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    if not size > 0.0 or abs(float(a @ b)) < SURE * size:
        return None
    return float(f"{float(a @ b) / float(b @ b):.4g}")
