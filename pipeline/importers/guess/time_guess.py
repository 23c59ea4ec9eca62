"""Time of the rows of a foreign file, guessed: stated by the file, a time column, a counter, or wrapped seconds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.importers.guess.signal_kinds import unit_by_name
from pmg.pipeline.recording.channels import LARGEST_RATE, SMALLEST_RATE
from pmg.pipeline.wording.units import TIME, declared

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.importers.guess.signal_look import SeenSignal
    from pmg.pipeline.importers.source import ForeignSource

WHOLE_HERTZ = 1e-6
"""Relative distance within which a guessed rate is a whole number of hertz."""


@dataclass(frozen=True)
class TimeOption:
    """One way to give rows their time.

    Parameters
    ----------
    name : str
        Channel that it takes; empty for none.
    keys : mapping of str to value
        Keys of ``[time]`` with their values.
    missing : tuple of str
        Keys that the user has to fill in.
    reason : str
        Why it may be that.
    doubt : str
        Why it must not be taken without a look.
    """

    name: str
    keys: dict[str, str | int | float]
    missing: tuple[str, ...]
    reason: str
    doubt: str = ""


@dataclass(frozen=True)
class TimeGuess:
    """Ways to give rows their time.

    Parameters
    ----------
    stated : str
        What the file says itself; then the map needs nothing.
    options : tuple of TimeOption
        What fits otherwise.
    """

    stated: str
    options: tuple[TimeOption, ...]

    @property
    def chosen(self) -> TimeOption | None:
        """The one that fits, where it is the only one and nothing is open."""
        if self.stated or len(self.options) != 1:
            return None
        one = self.options[0]
        return None if one.missing or one.doubt else one

    @property
    def names(self) -> frozenset[str]:
        """Channels that are shown here."""
        return frozenset(option.name for option in self.options)

    def document(self) -> dict[str, Any]:
        """The same as JSON."""
        chosen = self.chosen
        options = [
            {"keys": one.keys, "missing": list(one.missing), "reason": one.reason, "doubt": one.doubt}
            for one in self.options
        ]
        return {"stated": self.stated, "chosen": chosen.keys if chosen else None, "options": options}


def guess_time(source: ForeignSource, clocks: Sequence[SeenSignal], mapped: Sequence[SeenSignal]) -> TimeGuess:
    """The time of the rows.

    Parameters
    ----------
    source : ForeignSource
        The file.
    clocks : sequence of SeenSignal
        Channels that are times or ticks by unit or name.
    mapped : sequence of SeenSignal
        Channels that may become a topic.
    """
    asked = [seen.channel for seen in mapped] or list(source.channels)
    named = {channel.clock for channel in asked}
    if asked and all(named):
        return TimeGuess(f"the file gives each channel its time: {', '.join(sorted(named))}", ())
    rates = {channel.rate_hz for channel in asked}
    if len(rates) == 1 and (rate := next(iter(rates))) is not None:
        return TimeGuess(f"the file states {rate:.9g} Hz for each channel", ())
    lengths = {channel.length for channel in asked}
    options = [option for seen in clocks if seen.channel.length in lengths and (option := _option(seen)) is not None]
    return TimeGuess("", tuple(options))


def _option(seen: SeenSignal) -> TimeOption | None:
    """How a channel may be the time; None where it does not rise steadily."""
    if not seen.rising:
        return None
    name = seen.channel.name
    unit = declared(seen.channel.unit) or unit_by_name(name)
    doubt = "" if seen.even else "its steps are not even: the import asks the signals whether samples are"
    if unit not in TIME and seen.whole_numbers and (seen.wraps or unit == "1"):
        bits = 0 if seen.wraps_at is None else int(seen.wraps_at).bit_length() - 1
        keys: dict[str, str | int | float] = {"ticks": name}
        if bits and seen.wraps_at == 2.0**bits:
            keys["bits"] = bits
        width: tuple[str, ...] = () if "bits" in keys else ("bits",)
        return TimeOption(name, keys, (*width, "frequency_Hz"), seen.description(), doubt)
    known = unit if unit in TIME else ""
    missing = () if known else ("unit",)
    keys = {"source": name, **({"unit": known} if known else {})}
    rate = f", {_rate(seen, known):.9g} Hz" if known else ""
    if known and not SMALLEST_RATE < _rate(seen, known) < LARGEST_RATE:
        doubt = doubt or f"its rate would be {_rate(seen, known):.6g} Hz"
    return TimeOption(name, keys, missing, f"{seen.description()}{rate}", doubt)


def _rate(seen: SeenSignal, unit: str) -> float:
    """Rate of the typical step [Hz]."""
    rate = 1.0 / (seen.step * TIME[unit])
    return float(round(rate)) if rate >= 1.0 and abs(rate - round(rate)) <= WHOLE_HERTZ * rate else rate
