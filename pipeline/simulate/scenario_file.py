"""Reading a scenario: TOML to a checked scenario, and each refusal in four parts with the place of the fault."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

from pmg.pipeline.files.strict_tables import key_of
from pmg.pipeline.files.table_file import TableFile, read_table_file
from pmg.pipeline.simulate.scenario import Scenario
from pmg.pipeline.simulate.scenario_words import unit_of_motor
from pmg.sim.dynamics.constants import Control
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, Member

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MOST_SAMPLES = 2_000_000
"""Most samples of a simulated recording: more than an hour at 500 Hz."""
MOST_POINTS = 10_000
"""Most steady points of a scenario."""

ScenarioFile: TypeAlias = TableFile[Scenario]
"""A scenario and the file it stands in; paths in it are relative to that file's folder."""


def read_scenario(path: Path, what: str = "a scenario") -> ScenarioFile:
    """The scenario in a file.

    Raises
    ------
    BenchError
        When the file cannot be read, is not TOML, or asks for something unknown, out of range or contradictory.
    """
    file = read_table_file(path, what, Scenario, unit_of=unit_of_motor)
    for key, came, expected, do in _contradictions(file.table):
        raise file.refusal(came, expected, do, *key.split("."))
    return file


def _contradictions(scenario: Scenario) -> Iterator[tuple[str, str, str, str]]:
    """Faults of tables that are sound one by one but not together: key, came, expected, do."""
    bench, point, grid, output = scenario.bench, scenario.point, scenario.grid, scenario.output
    neutral, recorded = bench.configuration is Configuration.NEUTRAL, "mcap" in output.formats
    if neutral and bench.held is not Member.CARRIER:
        yield (
            "bench.held",
            f"{bench.held}, in neutral",
            "carrier: a free carrier turns by the field alone",
            "Engage the gear.",
        )
    if bench.held is not Member.CARRIER and not scenario.assumptions.carrier_in_map:
        yield "assumptions.carrier_in_map", f"false, with the {bench.held} held", "true", "Take one of them out."
    if bench.held is Member.SUN:
        steady = [name for name in ("point", "grid", "pairs") if getattr(scenario, name) is not None]
        if steady:
            came, do = f"sun, with [{steady[0]}], whose speeds are the sun's", 'Begin a run with start = "steady".'
            yield "bench.held", came, "[transient] and [response]", do
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
    yield from _pairs(scenario)
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
            yield "response", came, "an engaged bench, with [point] or [transient]", "Add what is missing."
        if getattr(bench, f"control_{scenario.response.side}") is Control.SPEED:
            came, side = "a motor that follows speed", scenario.response.side
            yield "response.side", came, "one that follows torque", f"Set bench.control_{side} to torque."


_ENGAGED_POINTS = ({"speed_sun_rpm", "torque_ring_nm"}, {"torque_sun_nm", "torque_ring_nm"})


def _pairs(scenario: Scenario) -> Iterator[tuple[str, str, str, str]]:
    """Pairs that do not fit together, or where they cannot be."""
    pairs = scenario.pairs
    if pairs is None:
        return
    if scenario.bench.configuration is Configuration.NEUTRAL:
        yield "pairs", "in neutral", "an engaged bench", "Name both speeds in [grid], or engage the gear."
    speeds, torques = len(pairs.speed_sun_rpm), len(pairs.torque_ring_nm)
    if speeds != torques:
        came = f"{speeds} speeds and {torques} torques"
        yield "pairs", came, "one torque for each speed", "Complete the lists."
    if speeds > MOST_POINTS:
        yield "pairs", f"{speeds} points", f"at most {MOST_POINTS}", "Take fewer."


def _knots(scenario: Scenario) -> Iterator[tuple[str, str, str, str]]:
    """Programmes whose two columns do not fit."""
    assert scenario.transient is not None
    for side in SIDES:
        motor = getattr(scenario.transient, side)
        if motor is None or motor.points is None:
            continue
        times, values = motor.points.times_s, motor.points.values
        key = f"transient.{side}.points"
        if len(times) != len(values):
            yield key, f"{len(times)} times and {len(values)} values", "one value for each time", "Complete the lists."
        if any(later <= earlier for earlier, later in pairwise(times)):
            yield f"{key}.times_s", "times that do not increase", "increasing times", "Sort them."
