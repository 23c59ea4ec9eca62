"""The words of a scenario: ranges, and what a motor is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AliasChoices, Field, model_validator

from pmg.pipeline.files.strict_tables import Strict, refuse, within
from pmg.sim.dynamics.constants import Control
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.files.toml import Key

Rpm = Annotated[float, within(-20_000.0, 20_000.0, "rpm")]
Torque = Annotated[float, within(-1e3, 1e3, "N m")]
Asked = Annotated[float, within(-20_000.0, 20_000.0, "N m or rpm")]
Instant = Annotated[float, within(-1e6, 1e6, "s")]
Length = Annotated[float, within(1e-6, 1e6, "s")]
Frequency = Annotated[float, within(1e-4, 1e6, "Hz")]
Amplitude = Annotated[float, within(0.0, 1e3, "N m")]


UNITS = {Control.TORQUE: "Nm", Control.SPEED: "rpm"}
"""End of the keys of what a motor is asked for, by what it follows."""


def _by_unit(name: str) -> AliasChoices:
    return AliasChoices(*(f"{name}_{unit}" for unit in UNITS.values()))


def _control(data: Mapping[str, Any], side: str) -> Control:
    bench = data.get("bench")
    by_speed = isinstance(bench, dict) and bench.get(f"control_{side}") == Control.SPEED
    return Control.SPEED if by_speed else Control.TORQUE


def unit_of_motor(data: Mapping[str, Any], key: Key) -> str:
    """End of the keys of a motor's programme, by what the motor of that place follows; empty elsewhere."""
    asked = key[:1] == ("transient",) and len(key) > 2 and key[1] in SIDES
    return UNITS[_control(data, str(key[1]))] if asked else ""


def refuse_foreign_units(data: Mapping[str, Any]) -> None:
    """Refuse a key of a motor's programme whose unit is that of the other control."""
    transient = data.get("transient")
    for side in SIDES:
        motor = transient.get(side) if isinstance(transient, dict) else None
        asked = _control(data, side)
        other = next(unit for control, unit in UNITS.items() if control is not asked)
        tables: list[tuple[tuple[str, ...], Any]] = [((), motor)] if isinstance(motor, dict) else []
        tables += [((name,), table) for _, whole in tables for name, table in whole.items()]
        for names, table in tables:
            for key in table if isinstance(table, dict) else ():
                if key.endswith(f"_{other}"):
                    expected = f"{key.rsplit('_', 1)[0]}_{UNITS[asked]}, as control_{side} is {asked}"
                    do = "Rename it, or change control."
                    refuse("the unit of the other control", expected, do, "transient", side, *names, key)


class Ramp(Strict):
    """From one value to another."""

    to: Asked = Field(validation_alias=_by_unit("to"))
    over_s: Length
    begin_s: Instant = 0.0
    start: Asked = Field(default=0.0, validation_alias=_by_unit("start"))


class RampStep(Strict):
    """A step with a rise time."""

    to: Asked = Field(validation_alias=_by_unit("to"))
    at_s: Instant
    rise_s: Length = 1e-3
    start: Asked = Field(default=0.0, validation_alias=_by_unit("start"))


class Knots(Strict):
    """Straight lines between knots."""

    times_s: Annotated[list[Instant], Field(min_length=1)]
    values: Annotated[list[Asked], Field(min_length=1)] = Field(validation_alias=_by_unit("values"))


class RecordedProgramme(Strict):
    """A programme from a column of a CSV file."""

    file: str
    time: str = "time_s"
    value: str


class SineSweep(Strict):
    """A sine on top, its frequency running from one value to another."""

    amplitude: Asked = Field(validation_alias=_by_unit("amplitude"))
    from_hz: Frequency
    to_hz: Frequency
    begin_s: Instant = 0.0
    over_s: Length


_FORMS = ("hold", "ramp", "step", "points", "recorded")


class Motor(Strict):
    """Demand on a motor: one form, and a sweep on top of it."""

    hold: Asked | None = Field(default=None, validation_alias=_by_unit("hold"))
    ramp: Ramp | None = None
    step: RampStep | None = None
    points: Knots | None = None
    recorded: RecordedProgramme | None = None
    sweep: SineSweep | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Motor:
        given = [name for name in _FORMS if getattr(self, name) is not None]
        if len(given) != 1:
            came = f"{' and '.join(given)} together" if given else "nothing that says what is asked for"
            refuse(came, f"exactly one of {', '.join(_FORMS)}; a sweep comes on top", "Leave one.")
        return self
