"""A magnetic machine file as a bench: the thesis's own numbers, another gear's, and what cannot be."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import pytest
from tests.machine.gears import gear_file

from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.magnetic import bench_of, remarks_on_bench
from pmg.pipeline.machine.shipped import machine_path
from pmg.sim.bench import load_bench
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("stage", [1, 2])
def test_the_gears_of_the_thesis_ship_with_its_numbers(stage: int) -> None:
    machine = read_machine(machine_path(f"thesis-gear-{stage}"))
    bench, thesis = bench_of(machine), load_bench()
    assert bench == thesis
    assert remarks_on_bench(machine) == ()
    changed = {f"gear{stage}"} | {each.name for each in fields(thesis) if not each.name.startswith("gear")}
    for section in changed - {"stages"}:
        for number in fields(getattr(thesis, section)):
            own, theirs = (getattr(getattr(each, section), number.name) for each in (bench, thesis))
            assert (own.unit, own.u) == (theirs.unit, theirs.u)
            assert theirs.source.citation.rpartition(", ")[2] in own.source.citation


def test_numbers_of_another_gear_replace_those_of_the_thesis(tmp_path: Path) -> None:
    machine = read_machine(gear_file(tmp_path))
    bench, thesis = bench_of(machine), load_bench()
    assert bench.gear1.ratio == pytest.approx(2.75)
    assert bench.carrier.iron_poles == pytest.approx(15.0)
    assert bench.gear1.pull_out_torque_sun == pytest.approx(8.0)
    assert bench.gear1.pull_out_torque_carrier == pytest.approx(30.0)
    assert bench.gear1.pull_out_torque_sun.u == pytest.approx(0.4)
    assert (bench.transducer_sun.nominal_torque, bench.transducer_ring.nominal_torque) == (10.0, 20.0)
    assert bench.transducer_sun.sensitivity_tolerance == pytest.approx(0.001)
    assert bench.motor.resistance == 2.5
    assert bench.shafts.inertia_sun == pytest.approx(6e-4)
    assert "data sheet" in bench.motor.resistance.source.citation
    assert (bench.gear2, bench.bearings, bench.rotors) == (thesis.gear2, thesis.bearings, thesis.rotors)
    lent, limits = remarks_on_bench(machine)
    assert limits.message.startswith("the motors' limits are the thesis bench's: 560 V, 29.7 A.")
    assert lent.message.startswith("taken from the thesis bench: ")
    for key in ("shaft.motor.inertia", "shaft.ring.inertia", "shaft.coupling.stiffness", "gear.bearings"):
        assert key in lent.message
    assert "gear.pull_out" not in lent.message
    assert "shaft.sun.inertia" not in lent.message


def test_ends_may_be_named_the_other_way_round(tmp_path: Path) -> None:
    turned = (
        ('input = "sun"\noutput = "ring"', 'input = "ring"\noutput = "sun"'),
        ("pole_pairs_input = { value = 4", "pole_pairs_input = { value = 11"),
        ("pole_pairs_output = { value = 11", "pole_pairs_output = { value = 4"),
        ("pull_out_torque_output", "pull_out_torque_input"),
    )
    assert bench_of(read_machine(gear_file(tmp_path, *turned))) == bench_of(read_machine(gear_file(tmp_path)))


def test_numbers_that_do_not_agree_are_told(tmp_path: Path) -> None:
    changes = (
        ("iron_poles = 15", "iron_poles = 14"),
        ("pull_out_torque_output = ", 'pull_out_torque_input = { value = 7, unit = "N m" }\npull_out_torque_output = '),
    )
    told = " ".join(
        remark.message
        for remark in remarks_on_bench(read_machine(gear_file(tmp_path, *changes)))
        if remark.severity == "warning"
    )
    assert "14 iron poles; expected 15" in told
    assert "of the ring 22 N m; expected 19.25 N m" in told


@pytest.mark.parametrize(
    ("old", "new", "came"),
    [
        ("[shaft.ring]\n", '[shaft.ring.motor]\nresistance = { value = 3, unit = "ohm" }\n', "2.5 ohm .sun. and 3 ohm"),
        ("pole_pairs_input = { value = 4", "pole_pairs_input = { value = 4.5", "expected a whole number"),
        ("[gear]", "[gear]\nstage = 3", "expected 1 to 2"),
        ("{ value = 22, ", "{ value = 0, ", "expected a number above zero"),
        ('kind = "magnetic"', 'kind = "rigid"', "ratio of a rigid gear"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, old: str, new: str, came: str) -> None:
    with pytest.raises(BenchError, match=came):
        bench_of(read_machine(gear_file(tmp_path, (old, new))))


def test_only_a_magnetic_gear_between_sun_and_ring_is_a_bench() -> None:
    with pytest.raises(BenchError, match="a gear of kind 'rigid'"):
        bench_of(read_machine(machine_path("two-stage-gearbox")))
