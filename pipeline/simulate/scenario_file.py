"""Reading a scenario: TOML to a checked scenario, and each refusal in four parts with the place of the fault."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from pmg.pipeline.files.refusals import first_fault, keys_of, refusal
from pmg.pipeline.files.strict_tables import key_of
from pmg.pipeline.files.toml import read_toml
from pmg.pipeline.simulate.scenario import Scenario
from pmg.sim.dynamics.constants import Control
from pmg.sim.errors import BenchError
from pmg.sim.grid import Configuration
from pmg.sim.shafts import Member

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

MOST_SAMPLES = 2_000_000
"""Most samples of a simulated recording: more than an hour at 500 Hz."""
MOST_POINTS = 10_000
"""Most steady points of a scenario."""

UNITS = {Control.TORQUE: "Nm", Control.SPEED: "rpm"}
"""End of the keys of what a motor is asked for, by what it follows."""


@dataclass(frozen=True)
class ScenarioFile:
    """A scenario and the file it stands in; paths in it are relative to that file's folder."""

    path: Path
    text: str
    scenario: Scenario

    def beside(self, name: str) -> Path:
        """A file or folder that the scenario names."""
        return self.path.parent / name


def read_scenario(path: Path, what: str = "a scenario") -> ScenarioFile:
    """The scenario in a file.

    Raises
    ------
    BenchError
        When the file cannot be read, is not TOML, or asks for something unknown, out of range or contradictory.
    """
    file = read_toml(path, what)
    data = file.data
    for key, name, asked in _foreign_units(data):
        unit = next(unit for unit in UNITS.values() if not name.endswith(f"_{unit}"))
        expected = f"{name.rsplit('_', 1)[0]}_{unit}, as control_{key.split('.')[1]} is {asked}"
        raise BenchError(f"{path}: {key}", "the unit of the other control", expected, "Rename it, or change control.")
    try:
        scenario = Scenario.model_validate(data)
    except ValidationError as error:
        raise _refusal(path, first_fault(error), data) from None
    for key, came, expected, do in _contradictions(scenario):
        raise BenchError(f"{path}: {key}", came, expected, do)
    return ScenarioFile(path, file.text, scenario)


def _control(data: Mapping[str, Any], side: str) -> Control:
    bench = data.get("bench")
    by_speed = isinstance(bench, dict) and bench.get(f"control_{side}") == Control.SPEED
    return Control.SPEED if by_speed else Control.TORQUE


def _foreign_units(data: Mapping[str, Any]) -> Iterator[tuple[str, str, Control]]:
    """Keys of a motor's programme whose unit is that of the other control: full key, name, control."""
    transient = data.get("transient")
    for side in ("sun", "ring"):
        motor = transient.get(side) if isinstance(transient, dict) else None
        asked = _control(data, side)
        other = next(unit for control, unit in UNITS.items() if control is not asked)
        tables = [("", motor)] if isinstance(motor, dict) else []
        tables += [(f"{name}.", table) for _, whole in tables for name, table in whole.items()]
        for name, table in tables:
            for key in table if isinstance(table, dict) else ():
                if key.endswith(f"_{other}"):
                    yield f"transient.{side}.{name}{key}", key, asked


def _refusal(path: Path, found: Mapping[str, Any], data: Mapping[str, Any]) -> BenchError:
    """What pydantic says, in four parts; keys of a motor's programme with the unit of what it follows."""
    keys, unit = keys_of(found), ""
    if keys[:1] == ["transient"] and len(keys) > 2 and keys[1] in ("sun", "ring"):
        unit = UNITS[_control(data, keys[1])]
        keys = [*keys[:2], *(re.sub(r"_(Nm|rpm)$", f"_{unit}", key) for key in keys[2:])]
    where = f"{path}: {'.'.join(keys)}" if keys else str(path)
    return refusal(where, found, Scenario, keys[-1] if keys else "", unit)


def _contradictions(scenario: Scenario) -> Iterator[tuple[str, str, str, str]]:
    """What each table allows by itself and all of them together do not: key, came, expected, do."""
    bench, point, grid, output = scenario.bench, scenario.point, scenario.grid, scenario.output
    neutral, recorded = bench.configuration is Configuration.NEUTRAL, "mcap" in output.formats
    if neutral and bench.held is Member.RING:
        yield "bench.held", "ring, in neutral", "carrier: a free carrier turns by the field alone", "Engage the gear."
    if bench.held is Member.RING and not scenario.assumptions.carrier_in_map:
        yield "assumptions.carrier_in_map", "false, with the ring held", "true", "Take one of them out."
    if point is not None:
        given = point.model_fields_set
        allowed = ({"speed_sun_rpm", "speed_ring_rpm"},) if neutral else _ENGAGED_POINTS
        if given not in allowed:
            sets = " or ".join(" and ".join(map(key_of, sorted(names))) for names in allowed)
            came = " and ".join(map(key_of, sorted(given))) or "nothing"
            yield "point", came, f"{sets} in {bench.configuration}", "Give these two."
    if point is not None and "torque_sun_nm" in point.model_fields_set and bench.history == "run":
        came = "run, with a point given by its torques"
        yield "bench.history", came, "settled: a speed that is sought has no history", "Give the point's speed."
    if grid is not None:
        second, other = ("speed_ring_rpm", "load_nm") if neutral else ("load_nm", "speed_ring_rpm")
        key = key_of(second)
        if getattr(grid, second) is None:
            yield f"grid.{key}", "missing", f"the second levels of a grid in {bench.configuration}", f"Add {key}."
        if getattr(grid, other) is not None:
            yield f"grid.{key_of(other)}", f"in {bench.configuration}", key, f"Replace it by {key}."
        count = len(grid.speed_sun_rpm) * len(getattr(grid, second) or ())
        if count > MOST_POINTS:
            yield "grid", f"{count} points", f"at most {MOST_POINTS}", "Take fewer levels."
        if recorded and count * output.seconds * output.rate_hz > 100 * MOST_SAMPLES:
            came = f"{count} points of {output.seconds:g} s at {output.rate_hz:g} Hz"
            yield "output.seconds", came, f"at most {100 * MOST_SAMPLES} samples", "Record less, or leave mcap out."
    run = scenario.transient
    if run is not None:
        yield from _knots(scenario)
        if recorded and run.duration_s * output.rate_hz > MOST_SAMPLES:
            came = f"{output.rate_hz:g} Hz over {run.duration_s:g} s"
            yield "output.rate_Hz", came, f"at most {MOST_SAMPLES} samples", "Lower the rate, or leave mcap out."
        if neutral and run.start == "steady":
            yield "transient.start", "steady, in neutral", "rest", "Begin at rest and ramp to the speeds."
    if scenario.response is not None:
        if neutral or (point is None and run is None):
            came = "in neutral" if neutral else "without a state to stand on"
            yield "response", came, "an engaged bench, with [point] or [transient] beside it", "Add what is missing."
        if getattr(bench, f"control_{scenario.response.side}") is Control.SPEED:
            came, side = "a motor that follows speed", scenario.response.side
            yield "response.side", came, "one that follows torque", f"Set bench.control_{side} to torque."


_ENGAGED_POINTS = ({"speed_sun_rpm", "torque_ring_nm"}, {"torque_sun_nm", "torque_ring_nm"})


def _knots(scenario: Scenario) -> Iterator[tuple[str, str, str, str]]:
    """Programmes whose two columns do not fit."""
    assert scenario.transient is not None
    for side in ("sun", "ring"):
        motor = getattr(scenario.transient, side)
        if motor is None or motor.points is None:
            continue
        times, values = motor.points.times_s, motor.points.values
        key = f"transient.{side}.points"
        if len(times) != len(values):
            yield key, f"{len(times)} times and {len(values)} values", "one value for each time", "Complete the lists."
        if any(later <= earlier for earlier, later in pairwise(times)):
            yield f"{key}.times_s", "times that do not increase", "increasing times", "Sort them."
