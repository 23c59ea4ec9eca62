"""What a channel of a recording may be of a machine: by its unit, else by the words of its name."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pmg.pipeline.importers.guess.signal_kinds import (
    SPELLED_TEMPERATURES,
    is_set_point,
    kinds_by_name,
    side_of,
    unit_by_name,
    words_of,
)
from pmg.pipeline.machine.axis import LINEAR, ROTARY
from pmg.pipeline.machine.channel import COMMANDS, COUNT, TIMES
from pmg.pipeline.wording.units import COUNT as COUNTS
from pmg.pipeline.wording.units import FREQUENCY, TIME, declared

if TYPE_CHECKING:
    from pmg.pipeline.importers.guess.signal_look import SeenSignal
    from pmg.pipeline.machine.axis import Axis

ENDS = ("input", "output")
"""Shafts of a machine with two."""
END_WORDS = (
    {
        "input": "input drive in antrieb eingang motor em primary inner sun sonne",
        "output": "output load out abtrieb ausgang brake bremse secondary outer ring hohlrad",
    },
    {"input": "1", "output": "2"},
    {"input": "an", "output": "ab"},
)
"""Words of names that say which, the more certain ones first."""
MOST_AXES = 12
"""Largest number of a name that counts an axis."""
PUSH_WORDS = ("force", "kraft", "F")
"""Words of a force, beside those of a torque."""
KINDS = {"angle": "position", "speed": "velocity", "torque": "force"}
"""Kinds of channels of a shaft by those of signals; a force or a torque drives it."""
RATE_WORDS, PERIOD_WORDS = {"fs", "samplerate", "abtastrate"}, {"dt", "ts", "abtastzeit"}
"""Words of a single value that is the sample rate [Hz], and of one that is the time of a sample [s]."""
SINGLE_RATE = "a single value: the rate of the samples, or their time, by its name"
"""Why a single value is taken for that."""
BY_STEPS = "by its even steps alone; the unit is the one that gives a likely rate"
"""Why a column without a word is taken for a time, where no other is one."""
LIKELY_RATES = 20.0, 2e5
"""Rates between which a column without a unit is likely a time [Hz]."""
AS_TEMPERATURE = {"K": "K"} | dict.fromkeys(("degC", "°C", "C"), "degC")
"""Units of temperatures that a machine file knows, by how they are spelled; another one is left open."""


@dataclass(frozen=True)
class ChannelGuess:
    """A channel of a recording and what it may be.

    Parameters
    ----------
    seen : SeenSignal
        What it shows.
    kind : str
        ``position``, ``velocity``, ``force``, ``current``, ``temperature``, ``time``, ``rate``; empty where not known.
    end : str
        Shaft, one of `ENDS`; empty where no word tells it.
    unit : str
        Unit; empty where the user has to name it.
    reason : str
        Why it is taken for that, or for nothing.
    asked : bool
        Whether it was asked for by its name, and not measured.
    """

    seen: SeenSignal
    kind: str
    end: str
    unit: str
    reason: str
    asked: bool = False

    @property
    def name(self) -> str:
        """Name of the channel."""
        return self.seen.channel.name

    @property
    def certain(self) -> bool:
        """Whether it can be taken as it is."""
        return bool(self.unit) and self.unit not in (*COMMANDS, COUNT) and not self.seen.constant

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


def guess_channel(seen: SeenSignal) -> ChannelGuess:
    """What a channel may be: by its unit, else by the words of its name."""
    channel = seen.channel
    named, _ = kinds_by_name(channel.name)
    words = set(words_of(channel.name))
    end = side_of(channel.name, END_WORDS)
    unit = declared(channel.unit) or unit_by_name(channel.name, (*of_axis(LINEAR), *of_axis(ROTARY)))
    if seen.fault or seen.missing == seen.values:
        return ChannelGuess(seen, "", end, unit, seen.fault or "no value")
    of_shafts = tuple(kind for kind in named if kind in KINDS)
    kind = _kind(unit, of_shafts if end and not unit and len(of_shafts) == 1 else named, words)
    if is_set_point(channel.name) and kind != "time":
        return ChannelGuess(seen, kind, end, unit, "a set-point by its name, and not measured", asked=True)
    if seen.values == 1 and (words & (RATE_WORDS | PERIOD_WORDS) or words >= {"sample", "rate"}):
        period = bool(words & PERIOD_WORDS)
        known = TIME if period else FREQUENCY
        return ChannelGuess(seen, "rate", end, unit if unit in known else "s" if period else "Hz", SINGLE_RATE)
    if not kind and not unit and seen.rising and seen.even and seen.step != 1.0 and (likely := _likely_time(seen)):
        return ChannelGuess(seen, "time", end, likely, BY_STEPS)
    if not kind:
        reason = f"the unit {unit} does not tell" if unit else "no unit"
        return ChannelGuess(seen, "", end, unit, f"{reason}, and neither does its name")
    reason = f"unit {unit}" if unit else "by its name alone"
    if kind == "position" and seen.whole_numbers and (not unit or unit in COUNTS):
        return ChannelGuess(seen, kind, end, COUNT, f"{reason}; whole numbers, as an encoder counts")
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
    if unit in COUNTS:
        return "position" if "angle" in named else ""
    if unit in COMMANDS:
        return "force" if "torque" in named or words & set(PUSH_WORDS) else "current" if unit == "A" else ""
    for axis in (ROTARY, LINEAR):
        for kind, known in (("position", axis.positions), ("velocity", axis.speeds), ("force", axis.forces)):
            if unit in known:
                return kind
    if unit or len(named) > 1:
        return ""
    if words & set(PUSH_WORDS) and not named:
        return "force"
    return KINDS.get(named[0], named[0]) if named and named[0] != "ticks" else ""


def of_axis(axis: Axis) -> tuple[str, ...]:
    """Units that only an axis of this kind has."""
    return tuple(unit for known in (axis.positions, axis.speeds, axis.forces) for unit in known if unit not in COMMANDS)


def fits_axis(guess: ChannelGuess, axis: Axis) -> bool:
    """Whether the unit of a channel, if it has one, is of an axis of this kind."""
    return not guess.unit or guess.unit in (*COMMANDS, COUNT) or guess.unit in of_axis(axis)


def _likely_time(seen: SeenSignal) -> str:
    low, high = LIKELY_RATES
    return next((u for u, one in TIMES.items() if seen.step > 0.0 and low <= 1.0 / (seen.step * one) <= high), "")


def with_more_axes(guessed: list[ChannelGuess]) -> list[ChannelGuess]:
    """Channels of a machine of more than two axes, as numbers of their names tell: then 1 and 2 are no two ends."""
    names = [words_of(one.name) for one in guessed if one.kind in KINDS.values()]
    if not any(word.isdigit() and 2 < int(word) <= MOST_AXES for words in names for word in words):
        return guessed
    return [replace(one, end=side_of(one.name, END_WORDS[:1])) for one in guessed]


def with_other_end(guessed: list[ChannelGuess]) -> list[ChannelGuess]:
    """Channels of which each kind has one of a named shaft and one of none: that is of the other shaft."""
    ends = {one.end for one in guessed if one.kind in KINDS.values() and one.end}
    if len(ends) != 1:
        return guessed
    (other,) = set(ENDS) - ends
    found = list(guessed)
    for kind in KINDS.values():
        pair = [one for one in guessed if one.kind == kind and not one.asked]
        open_ones = [one for one in pair if not one.end]
        if len(pair) == len(ENDS) and len(open_ones) == 1:
            (one,) = open_ones
            reason = f"{one.reason}, {other} as the other one is of the {pair[1 - pair.index(one)].end}"
            found[found.index(one)] = replace(one, end=other, reason=reason)
    return found
