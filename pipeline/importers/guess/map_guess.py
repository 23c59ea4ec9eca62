"""A channel map proposed from what a file shows: a channel for each topic where one alone fits, and why."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pmg.pipeline.importers.guess.signal_kinds import (
    is_set_point,
    kind_by_unit,
    kinds_by_name,
    side_of,
    unit_by_name,
)
from pmg.pipeline.importers.guess.signal_look import SMALLEST_COUNTER
from pmg.pipeline.importers.guess.time_guess import TimeGuess, guess_time
from pmg.pipeline.recording.channels import encoder, frequency
from pmg.pipeline.wording.units import ANGLE, ELECTRIC, MILLI, declared
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.importers.guess.signal_look import SeenSignal
    from pmg.pipeline.importers.source import ForeignSource

TURNS = {"deg": 360.0, "rad": REVOLUTION, "mrad": REVOLUTION / MILLI, "rev": 1.0}
"""A turn in each unit of `ANGLE`."""
UNMAPPED = {
    "temperature": "a temperature: its topic is /daq/temperature/ and a name of the place",
    "current": "a current, which layout pmg.v1 holds no topic for",
}
"""Kinds that are known and are no torque or angle of a shaft."""
OF_SHAFTS = {"torque": frequency, "speed": encoder, "angle": encoder}
"""Kinds that become a topic of a shaft."""


@dataclass(frozen=True)
class SignalGuess:
    """A channel and what it may be.

    Parameters
    ----------
    seen : SeenSignal
        What it shows.
    kind : str
        ``torque``, ``speed``, ``angle``, ``time``, ``ticks``, ``temperature``, ``current``; empty where not known.
    side : str
        Shaft; empty where not known.
    unit : str
        Unit; empty where the user has to name it.
    reason : str
        Why it is taken for that, or for nothing.
    doubt : str
        Why it must not be taken without a look; empty where nothing speaks against it.
    keys : mapping of str to str
        Further keys of its table, as TOML writes their values.
    missing : tuple of str
        Keys that the user has to fill in.
    """

    seen: SeenSignal
    kind: str
    side: str
    unit: str
    reason: str
    doubt: str = ""
    keys: dict[str, str] = field(default_factory=dict)
    missing: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the channel."""
        return self.seen.channel.name

    @property
    def certain(self) -> bool:
        """Whether it can be mapped as it is."""
        return not self.missing and not self.doubt


@dataclass(frozen=True)
class TopicGuess:
    """A topic and the channels that may be it.

    Parameters
    ----------
    topic : str
        Topic of layout pmg.v1.
    candidates : tuple of SignalGuess
        What fits.
    """

    topic: str
    candidates: tuple[SignalGuess, ...]

    @property
    def chosen(self) -> SignalGuess | None:
        """The one that fits, where it is the only one and nothing is open."""
        one = self.candidates[0] if len(self.candidates) == 1 else None
        return one if one is not None and one.side and one.certain else None


@dataclass(frozen=True)
class MapGuess:
    """A proposed channel map.

    Parameters
    ----------
    source : ForeignSource
        The file.
    time : TimeGuess
        How rows get their time.
    topics : tuple of TopicGuess
        Torque and encoder of each shaft.
    left : tuple of SignalGuess
        Channels that are proposed for nothing.
    """

    source: ForeignSource
    time: TimeGuess
    topics: tuple[TopicGuess, ...]
    left: tuple[SignalGuess, ...]

    def document(self) -> dict[str, Any]:
        """The same as JSON."""
        topics = []
        for each in self.topics:
            chosen = each.chosen
            options = [_document(one) for one in each.candidates]
            topics.append({"topic": each.topic, "chosen": chosen.name if chosen else None, "candidates": options})
        return {"time": self.time.document(), "topics": topics, "left": [_document(one) for one in self.left]}


def guess_map(source: ForeignSource, seen: Sequence[SeenSignal]) -> MapGuess:
    """A map proposed from names, units and shapes of the channels of a file.

    Notes
    -----
    Nothing is chosen where two channels fit one topic, where no word tells the shaft, or where a unit or sensitivity
    is not known.
    """
    guessed = [_guess_signal(each) for each in seen]
    usable = [one for one in guessed if one.kind in OF_SHAFTS]
    topics, taken = [], set[str]()
    for make in (frequency, encoder):
        alike = [one for one in usable if OF_SHAFTS[one.kind] is make]
        for side in SIDES:
            fitting = [one for one in alike if one.side == side] or [one for one in alike if not one.side]
            topics.append(TopicGuess(make(side).topic, tuple(fitting)))
            taken |= {one.name for one in fitting}
    clocks = [one.seen for one in guessed if one.kind in ("time", "ticks")]
    time = guess_time(source, clocks, [one.seen for one in usable])
    taken |= {seen.channel.name for seen in clocks if seen.channel.name in time.names}
    return MapGuess(source, time, tuple(topics), tuple(one for one in guessed if one.name not in taken))


def _guess_signal(seen: SeenSignal) -> SignalGuess:
    """What a channel may be: by its unit, by the words of its name, by its shape."""
    channel = seen.channel
    named, certain = kinds_by_name(channel.name)
    side, words = side_of(channel.name), f"its name says {' or '.join(named)}" if named else "its name says nothing"
    unit = declared(channel.unit) or unit_by_name(channel.name)
    of_name = "" if channel.unit or not unit else f", unit {unit} by its name"
    if seen.fault or seen.missing == seen.values:
        return SignalGuess(seen, "", side, unit, seen.fault or "no value")
    if is_set_point(channel.name):
        return SignalGuess(seen, "", side, unit, "a set-point by its name, and not measured")
    kind = kind_by_unit(unit, named) if unit else named[0] if len(named) == 1 else ""
    if not kind:
        reason = f"the unit {unit} does not tell" if unit else "no unit"
        return SignalGuess(seen, "", side, unit, f"{reason}, and {words}")
    if unit and certain and kind not in named and not (kind == "speed" and "angle" in named):
        return SignalGuess(seen, "", side, unit, f"its unit {unit} says {kind}, but {words}")
    reason = (f"unit {unit}" if unit and not of_name else words) + of_name
    if kind in UNMAPPED:
        return SignalGuess(seen, kind, side, unit, f"{reason}: {UNMAPPED[kind]}")
    if kind not in OF_SHAFTS:
        return SignalGuess(seen, kind, side, unit, reason)
    return _of_shaft(seen, kind, side, unit, reason)


def _of_shaft(seen: SeenSignal, kind: str, side: str, unit: str, reason: str) -> SignalGuess:
    """A torque, speed or angle with the keys that it needs."""
    keys: dict[str, str] = {}
    missing: list[str] = []
    doubts = ["it is constant: a set value, or nothing was connected"] if seen.constant else []
    if kind == "angle" and not unit:
        unit, found = _unit_of_angle(seen)
        reason += found
    if not unit:
        missing.append("unit")
    if kind == "torque" and unit in ELECTRIC:
        missing.append("Nm_per_unit")
    if kind == "angle" and unit in ANGLE and seen.wraps:
        if seen.wraps_at == TURNS[unit]:
            keys["wraps_at"] = f"{seen.wraps_at!r}"
            reason += f", begins anew at {seen.wraps_at:.9g} as {unit} do"
        else:
            missing.append("wraps_at")
    if kind == "angle" and unit == "1":
        bits = 0 if seen.wraps_at is None else int(seen.wraps_at).bit_length() - 1
        if not seen.whole_numbers:
            doubts.append("counts would be whole numbers")
        elif seen.wraps and (seen.wraps_at is None or seen.wraps_at != 2.0**bits):
            doubts.append("it begins anew at no power of two: have it written as an angle")
        elif seen.wraps:
            keys["bits"] = str(bits)
            reason += f", begins anew at 2^{bits}"
    turn = TURNS.get(unit, SMALLEST_COUNTER)
    if kind == "angle" and unit and seen.jumps and seen.high - seen.low > turn / 2.0:
        doubts.append("it jumps: where it begins anew is not seen")
    reason += f", {side} by its name" if side else ", and no word tells the shaft"
    return SignalGuess(seen, kind, side, unit, reason, "; ".join(doubts), keys, tuple(missing))


def _unit_of_angle(seen: SeenSignal) -> tuple[str, str]:
    """Unit of an angle by where it begins anew, and the words for that."""
    for unit, turn in TURNS.items():
        if seen.wraps_at == turn:
            return unit, ""
    if seen.whole_numbers and seen.wraps_at is not None and seen.wraps_at >= 2.0**8 and seen.wraps_at != 360.0:
        return "1", ", whole numbers that begin anew at a power of two, as counters do"
    return "", ""


def _document(guess: SignalGuess) -> dict[str, Any]:
    return {
        "source": guess.name,
        "kind": guess.kind,
        "side": guess.side,
        "unit": guess.unit,
        "reason": guess.reason,
        "doubt": guess.doubt,
        "keys": guess.keys,
        "missing": list(guess.missing),
        "seen": guess.seen.document(),
    }
