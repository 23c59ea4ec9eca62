"""Which lines a window can tell apart."""

from __future__ import annotations

import math

import pytest

from pmg.pipeline.orders.lines import lines_of, resolve
from pmg.sim.bench import BenchParameters
from pmg.sim.signals import RPM


@pytest.mark.parametrize(("gear", "sun", "ring", "ratio"), [(1, 5, 13, 13 / 5), (2, 7, 11, 11 / 7)])
def test_engaged_the_poles_of_both_rotors_are_one_line(
    bench: BenchParameters, gear: int, sun: int, ring: int, ratio: float
) -> None:
    speeds = {"sun": 600.0 * RPM, "ring": -600.0 * RPM / ratio}
    groups, left = resolve(lines_of(bench, gear), speeds, 5.0, 10_000.0)
    names = [group.name for group in groups]
    assert f"sun {sun} = ring {ring}" in names
    assert f"sun {math.lcm(2 * sun, 18)} = ring {math.lcm(2 * ring, 18)}" in names
    assert {"sun 1", "ring 1", "sun 18", "ring 18"} <= set(names)
    assert [(line.line.name, line.reason.partition(";")[0]) for line in left] == [("slip", "at rest")]


def test_neutral_they_are_two_and_pole_slip_is_a_third(bench: BenchParameters) -> None:
    groups, _ = resolve(lines_of(bench, 1), {"sun": 600.0 * RPM, "ring": -100.0 * RPM}, 5.0, 10_000.0)
    assert {"sun 5", "ring 13", "slip"} <= {group.name for group in groups}


def test_a_line_above_what_the_samples_show_says_so(bench: BenchParameters) -> None:
    groups, left = resolve(lines_of(bench, 1), {"sun": 1872.0 * RPM, "ring": -600.0 * RPM}, 5.0, 500.0)
    reasons = {line.line.name: line.reason for line in left}
    assert "at 562 Hz, above the 225 Hz" in reasons["sun 18"]
    assert all(group.frequency <= 225.0 for group in groups)


def test_a_shaft_at_rest_has_no_lines_and_the_other_keeps_its_own(bench: BenchParameters) -> None:
    groups, left = resolve(lines_of(bench, 1), {"sun": 600.0 * RPM, "ring": 0.0}, 5.0, 10_000.0)
    assert all(group.lines[0].order_sun for group in groups)
    assert {line.reason for line in left} == {"at rest; at least 2 are needed"}
    both, _ = resolve(lines_of(bench, 1), {"sun": 0.0, "ring": 0.0}, 5.0, 10_000.0)
    assert both == ()
