"""Channels of a machine's recordings, and how they are filtered and thinned, as files name them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import BeforeValidator, model_validator

from pmg.pipeline.files.strict_tables import Strict, number_within, refuse, refusing, within, word_of
from pmg.pipeline.wording.units import TIME

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.machine.axis import Axis

TIMES = {unit: TIME[unit] for unit in ("s", "ms", "us", "ns")}
"""Units of a time channel, and what one is in SI."""

COUNT = "count"
"""Unit of a position that is counted: the encoder of the shaft says what one is."""

COMMANDS = ("V", "A", "%")
"""Units of a command, of which a factor makes a force or a torque."""


def _newton(value: object) -> object:
    return value if isinstance(value, str) else number_within(value, -1e9, 1e9, "N or N m")


def _direction(value: object) -> object:
    if value not in (1, -1):
        refuse(repr(value), "1 or -1", "Give -1 where the channel counts the other way.")
    return value


class Channel(Strict):
    """A channel of the recordings: column or variable, and its unit there; of a command, what one unit of it makes."""

    name: str
    unit: str
    newton_per_unit: Annotated[str | float, BeforeValidator(_newton)] | None = None
    newton_metre_per_unit: Annotated[str | float, BeforeValidator(_newton)] | None = None
    sign: Annotated[int, BeforeValidator(_direction)] = 1

    @property
    def factor(self) -> str | float:
        """Force or torque per unit of a command: a number, or the name of a variable of the file."""
        given = self.newton_per_unit if self.newton_metre_per_unit is None else self.newton_metre_per_unit
        return 1.0 if given is None else given


def in_si(channel: Channel, known: Mapping[str, float]) -> tuple[Channel, float]:
    """A channel, and what one unit of it is in SI, its sign included.

    Raises
    ------
    RefusalError
        The unit is none of these.
    """
    word_of(channel.unit, known, "unit")
    return channel, channel.sign * known[channel.unit]


def with_constant(channel: Channel, axis: Axis, constant: float | None) -> Channel:
    """A current with the motor's constant as its factor [N/A, N m/A], where it has none; any other as it is."""
    if constant is None or channel.unit != "A" or getattr(channel, axis.factor) is not None:
        return channel
    return channel.model_copy(update={axis.factor: constant})


def check_factor(channel: Channel, axis: Axis, *, drives: bool) -> None:
    """Refuse a command without its factor, and a factor where none belongs.

    Raises
    ------
    RefusalError
        It is so.
    """
    for key in ("newton_per_unit", "newton_metre_per_unit"):
        given = getattr(channel, key)
        if given is not None and (key != axis.factor or not drives):
            refuse(f"{given}", f"{axis.factor} of a {axis.pushes} only", "Leave it out.", key)
        if given == 0.0:
            refuse("0", "a factor other than zero", "Correct the value.", key)
    if channel.unit in COMMANDS and getattr(channel, axis.factor) is None:
        motor = " or, of a current, motor.constant of the shaft" if channel.unit == "A" else ""
        refuse("missing", f"{axis.push} of one {channel.unit}", f"Add {axis.factor}{motor}.", axis.factor)


class PrepareTable(Strict):
    """A zero-phase Butterworth low-pass, samples left out at both ends, decimation.

    Left out are as many samples as the filter takes to settle, unless `drop` says otherwise; below the rest speed the
    machine counts as at rest, by default where noise hides that it moves.
    """

    rate_hz: Annotated[float, within(1.0, 1e6, "Hz")]
    low_pass_hz: float
    order: Annotated[int, within(1, 8)] = 4
    drop: Annotated[int, within(1, 100_000)] | None = None
    keep_every: Annotated[int, within(1, 100)] = 1
    rest_speed_m_s: Annotated[float, within(0.0, 10.0, "m/s")] | None = None
    rest_speed_rad_s: Annotated[float, within(0.0, 1000.0, "rad/s")] | None = None

    @model_validator(mode="after")
    def _below_half_the_rate(self) -> PrepareTable:
        with refusing("low_pass_Hz"):
            number_within(self.low_pass_hz, 0.01, 0.49 * self.rate_hz, "Hz")
        return self

    @property
    def rest_speed(self) -> float | None:
        """Speed below which the machine counts as at rest [SI]; None where the data say it."""
        return self.rest_speed_m_s if self.rest_speed_rad_s is None else self.rest_speed_rad_s

    def check_axis(self, axis: Axis, *key: str) -> None:
        """Refuse a rest speed in the unit of the other axis; `key` leads to the table.

        Raises
        ------
        RefusalError
            It is in that.
        """
        given = {"m": self.rest_speed_m_s, "rad": self.rest_speed_rad_s}
        for length in (length for length, value in given.items() if value is not None and length != axis.length):
            name = f"rest_speed_{length}_s"
            refuse(name, f"rest_speed_{axis.length}_s", "Give it in the unit of the axis.", *key, name)
