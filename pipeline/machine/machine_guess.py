"""A machine file proposed from what a recording shows: channels by names, units and shapes, for the user to confirm."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.importers.guess.signal_look import look_at
from pmg.pipeline.importers.open_source import whole_channels
from pmg.pipeline.importers.rows import WHOLE_RATE
from pmg.pipeline.machine.axis import LINEAR, ROTARY
from pmg.pipeline.machine.channel import TIMES
from pmg.pipeline.machine.channel_guess import (
    BY_STEPS,
    ENDS,
    KINDS,
    LIKELY_RATES,
    ChannelGuess,
    fits_axis,
    guess_channel,
    of_axis,
    with_more_axes,
    with_other_end,
)
from pmg.pipeline.wording.units import FREQUENCY, TIME
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from pmg.pipeline.importers.source import ForeignSource
    from pmg.pipeline.machine.axis import Axis
    from pmg.sim.signals import Array

PUSHES = (("force", False), ("current", False), ("force", True), ("current", True))
"""What drives a shaft, the best first: its kind, and whether it was asked for and not measured."""
MOTIONS = ("velocity", "position")
"""What shows how fast a shaft turns, the better first."""
SURE = 0.98
"""Correlation of two speeds from which on their ratio is that of a gear."""


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

    @property
    def rate_by_steps(self) -> bool:
        """Whether the sample rate is that of a column which is the time by its even steps alone."""
        doubtful = map(_rate_of_steps, (one for one in self.time if one.reason == BY_STEPS))
        return self.rate_hz is not None and any(abs(rate / self.rate_hz - 1.0) <= WHOLE_RATE for rate in doubtful)

    def chosen(self, end: str, kind: str) -> ChannelGuess | None:
        """The one channel that fits, where nothing is open."""
        fitting = self.channels.get((end, kind), ())
        told = len(self.shafts) == 1 or all(one.end for one in fitting)
        return fitting[0] if len(fitting) == 1 and fitting[0].certain and told else None

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
    Two shafts are proposed where words of names tell of both, or of one where each kind has two channels. The ratio of
    a gear is the slope of one speed over the other. A current is left aside where a torque was measured, and a
    set-point but for the command of a drive whose torque and current nobody measured. Where two channels fit, a unit
    is not known, or a current or voltage lacks its factor, the line is left open.
    """
    guessed = with_other_end(with_more_axes([guess_channel(seen) for seen in look_at(source)]))
    units = [one.unit for one in guessed if one.kind in KINDS.values()]
    axis = LINEAR if any(unit in of_axis(LINEAR) for unit in units) else ROTARY
    fitting = [one for one in guessed if one.kind in (*KINDS.values(), "current") and fits_axis(one, axis)]
    two = {one.end for one in fitting if not one.asked} >= set(ENDS) and axis is ROTARY
    ended = {one.kind for one in fitting if one.end}
    loose = [one for one in fitting if not one.end and one.kind in MOTIONS and one.kind not in ended]
    found: dict[tuple[str, str], tuple[ChannelGuess, ...]] = {}
    for end in ENDS if two else ("shaft",):
        ours = [one for one in fitting if one.end == end or not two or (end == ENDS[0] and one in loose)]
        for kind in KINDS.values():
            drives = PUSHES if kind == "force" else ((kind, False),)
            sets = (tuple(one for one in ours if (one.kind, one.asked) == each) for each in drives)
            if of_kind := next(filter(None, sets), ()):
                found[end, kind] = of_kind
    rising = [one for one in guessed if one.kind == "time" and one.seen.rising]
    time = tuple([one for one in rising if one.reason != BY_STEPS] or rising)
    warm = tuple(one for one in guessed if one.kind == "temperature" and not one.asked)
    taken = {one.name for ones in (*found.values(), time, warm) for one in ones}
    left = tuple(one for one in guessed if one.name not in taken)
    guess = MachineGuess(source, axis, found, time, warm, _rate(source, time, guessed), None, False, left)
    return _with_shapes(guess) if two else guess


def _rate(source: ForeignSource, time: Sequence[ChannelGuess], guessed: Iterable[ChannelGuess]) -> float | None:
    """Sample rate [Hz] by a time column, else as the file declares it, by a single value, or by even steps."""
    clock = next((one for one in time if one.unit), None)
    of_clock = set() if clock is None else {_rate_of_steps(clock)}
    declared = {channel.rate_hz for channel in source.channels if channel.rate_hz is not None}
    single = {rate for one in guessed if one.kind == "rate" and (rate := _single_rate(one)) is not None}
    by_steps = clock is not None and clock.reason == BY_STEPS
    found = (declared or single or of_clock) if by_steps else (of_clock or declared or single)
    if len(found) != 1:
        return None
    (rate,) = found
    return float(round(rate) if abs(rate - round(rate)) <= WHOLE_RATE * rate else f"{rate:.9g}")


def _rate_of_steps(clock: ChannelGuess) -> float:
    """Rate at which a time column with a unit steps [Hz]."""
    return 1.0 / (clock.seen.step * TIMES[clock.unit])


def _single_rate(one: ChannelGuess) -> float | None:
    """Rate that a single value states [Hz]; None of one that no recorder has."""
    value, (low, high) = one.seen.low, LIKELY_RATES
    if not value > 0.0:
        return None
    rate = value * FREQUENCY[one.unit] if one.unit in FREQUENCY else 1.0 / (value * TIME[one.unit])
    return rate if low <= rate <= high else None


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
    slopes = (_slope(*pairs[kind]) for kind in MOTIONS if kind in pairs)
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
