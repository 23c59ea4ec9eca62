"""The machine file: shafts, gear, instruments, records and known terms of a machine in TOML, each number sourced."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, model_validator

from pmg.pipeline.files.strict_tables import Strict, one_of, refuse, refusing, word_of
from pmg.pipeline.files.table_file import read_table_file
from pmg.pipeline.machine.axis import LINEAR, ROTARY
from pmg.pipeline.machine.channel import TIMES, in_si
from pmg.pipeline.machine.machine import GEAR_NUMBERS, SHAFT_NUMBERS, Machine, MachineGear, MachineShaft
from pmg.pipeline.machine.quantity import stated
from pmg.pipeline.machine.tables import GearTable, ModelTable, PublishedErrors, RecordsTable, ShaftTable, TermParameter
from pmg.pipeline.wording.units import TEMPERATURE_UNITS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.machine.axis import Axis
    from pmg.pipeline.machine.quantity import Stated

SIGNED = ("ratio",)
"""Numbers that may be negative."""

MACHINE_SCHEMA = "pmg.machine/1"
"""Schema of the machine file."""

MOST_SHAFTS = 2
"""Shafts that a machine may have."""


class _MachineTable(Strict):
    schema_: Annotated[str, one_of(MACHINE_SCHEMA), Field(alias="schema")]
    title: str
    source: str = ""
    shaft: Annotated[dict[str, ShaftTable], Field(min_length=1)]
    gear: GearTable | None = None
    records: RecordsTable | None = None
    model: ModelTable = ModelTable()
    published: list[TermParameter] = Field(default_factory=list)
    published_errors: PublishedErrors = PublishedErrors()

    @model_validator(mode="after")
    def _whole(self) -> _MachineTable:
        if len(self.shaft) > MOST_SHAFTS:
            refuse(f"{len(self.shaft)} shafts", "one or two", "Leave the others out.", "shaft")
        if (self.gear is None) == (len(self.shaft) == MOST_SHAFTS):
            do = (
                'Two shafts need [gear]; kind = "none" where one goes through.'
                if self.gear is None
                else "Leave it out."
            )
            refuse(f"{len(self.shaft)} shafts", "a gear between two shafts, none of one", do, "gear")
        if self.gear is not None:
            _check_gear(self.gear, self.shaft)
        _ = _shafts_of(self), _gear_of(self)  # units and channels are checked on the way
        if self.records is not None:
            self.records.check_axis(_axis_of(next(iter(self.shaft.values()))), "records")
            if self.records.time is not None:
                with refusing("records", "time"):
                    in_si(self.records.time, TIMES)
            if self.records.temperature is not None:
                with refusing("records", "temperature"):
                    in_si(self.records.temperature, TEMPERATURE_UNITS)
            if self.records.second is not None:
                if self.gear is None:
                    refuse("files of a second shaft", "one shaft", "Leave them out.", "records", "second")
                with refusing("records", "second", "time"):
                    in_si(self.records.second.time, TIMES)
            if self.records.withheld and self.records.withheld_part is not None:
                do = "Withhold whole records or a part of each."
                refuse("both withheld and withheld_part", "one of them", do, "records", "withheld_part")
        return self


def _check_gear(gear: GearTable, shafts: Mapping[str, ShaftTable]) -> None:
    for end in ("input", "output"):
        word_of(getattr(gear, end), shafts, "gear", end)
    if gear.input == gear.output:
        refuse(f"'{gear.input}' at both ends", "two shafts", "Name the other one.", "gear", "output")
    for name, shaft in shafts.items():
        if shaft.moves == "slides":
            refuse('"slides"', 'a geared shaft that "turns"', "Describe the shafts apart.", "shaft", name, "moves")
    needed = {"rigid": ("ratio",), "magnetic": ("pole_pairs_input", "pole_pairs_output"), "none": ()}[gear.kind]
    for key in needed:
        if getattr(gear, key) is None:
            refuse("missing", f"{key} of a {gear.kind} gear", "Add it.", "gear", key)
    every = ("ratio", "pole_pairs_input", "pole_pairs_output")
    for given in (key for key in every if key not in needed and getattr(gear, key) is not None):
        refuse(f"{given} of a {gear.kind} gear", "none", "Leave it out.", "gear", given)
    for key in (key for key in needed if key != "ratio"):
        value = getattr(gear, key).value
        if value != round(value):
            refuse(f"{value:g}", "a whole number of pole pairs", "Correct the value.", "gear", key, "value")


def _axis_of(shaft: ShaftTable) -> Axis:
    return LINEAR if shaft.moves == "slides" else ROTARY


def _numbers(table: Any, known: Mapping[str, str], source: str, slides: bool, *key: str) -> dict[str, Stated]:  # noqa: ANN401 (any table)
    """Numbers that a table gives, by dotted keys."""
    found = {}
    for name, kind in known.items():
        given = table
        for word in name.split("."):
            given = getattr(given, word)
        if given is not None:
            with refusing(*key, *name.split(".")):
                found[name] = stated(given, kind, source, slides, signed=name in SIGNED)
    return found


def _shafts_of(table: _MachineTable) -> dict[str, MachineShaft]:
    found = {}
    for name, shaft in table.shaft.items():
        axis = _axis_of(shaft)
        numbers = _numbers(shaft, SHAFT_NUMBERS, table.source, axis is LINEAR, "shaft", name)
        constant = numbers.get("motor.constant")
        with refusing("shaft", name):
            count = _count_of(numbers, axis)
        with refusing("shaft", name, "channel"):
            channels = shaft.channel.of(axis, None if constant is None else constant.value, count)
        found[name] = MachineShaft(name, axis, numbers, channels)
    return found


def _count_of(numbers: Mapping[str, Stated], axis: Axis) -> float | None:
    """Way of one count of an encoder [m, rad]; None where the file does not state it."""
    for key in ("counts_per_turn", "resolution")[not axis.turn :]:
        if (given := numbers.get(f"encoder.{key}")) is not None:
            if not given.value > 0.0:
                refuse(f"{given.value:g}", "a number above zero", "Correct the value.", "encoder", key, "value")
            return axis.turn / given.value if key == "counts_per_turn" else given.value
    return None


def _gear_of(table: _MachineTable) -> MachineGear | None:
    gear = table.gear
    if gear is None:
        return None
    numbers = _numbers(gear, GEAR_NUMBERS, table.source, False, "gear")
    for name in ("ratio", "pole_pairs_input", "pole_pairs_output"):
        if name in numbers and numbers[name].value == 0.0:
            refuse("0", "a number other than zero", "Correct the value.", "gear", name, "value")
    if gear.stage is not None and gear.kind != "magnetic":
        refuse(f"stage of a {gear.kind} gear", "none", "Leave it out.", "gear", "stage")
    return MachineGear(gear.kind, gear.input, gear.output, numbers, gear.stage or 1)


def read_machine(path: Path) -> Machine:
    """The machine in a file.

    Parameters
    ----------
    path : Path
        TOML of schema `MACHINE_SCHEMA`.

    Raises
    ------
    BenchError
        When the file cannot be read, or asks for something unknown, out of range or contradictory.
    """
    file = read_table_file(path, "a machine", _MachineTable)
    table = file.table
    return Machine(
        file,
        table.title,
        _shafts_of(table),
        _gear_of(table),
        table.records,
        table.model,
        tuple(table.published),
        table.published_errors.parts,
    )
