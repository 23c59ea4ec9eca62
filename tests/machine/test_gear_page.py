"""What follows from the pole numbers: the six modes of table 2.2, cogging factor, harmonics; the page of the bench."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.machine.gear_page import shown_bench
from pmg.pipeline.machine.pole_numbers import cogging_factor, operating_modes, space_harmonics
from pmg.pipeline.machine.show import shown_machine
from pmg.sim.bench import GearParameters, SourcedQuantity, load_bench
from pmg.sim.shafts import Member

GEAR = load_bench().gear1
pairs = st.integers(1, 40)


def gear_of(sun: int, ring: int) -> GearParameters:
    return replace(GEAR, pole_pairs_sun=SourcedQuantity(sun, "1"), pole_pairs_ring=SourcedQuantity(ring, "1"))


@given(pairs, pairs)
def test_every_mode_keeps_the_pole_pair_relation_and_loses_no_power(sun: int, ring: int) -> None:
    modes = operating_modes(gear_of(sun, ring), sun + ring)
    assert len({(mode.input, mode.output, mode.fixed) for mode in modes}) == 6
    for mode in modes:
        speed, torque = (dict(zip(Member, values, strict=True)) for values in (mode.speeds, mode.torques))
        turned = sun * speed[Member.SUN] + ring * speed[Member.RING]
        assert turned == pytest.approx((sun + ring) * speed[Member.CARRIER], rel=1e-12, abs=1e-9)
        assert speed[mode.fixed] == 0.0
        assert speed[mode.input] / speed[mode.output] == pytest.approx(mode.ratio)
        assert sum(torque.values()) == pytest.approx(0.0, abs=1e-9 * max(map(abs, torque.values())))
        taken_in = torque[mode.input] * speed[mode.input]
        assert taken_in > 0.0
        assert taken_in == pytest.approx(-torque[mode.output] * speed[mode.output])


def test_the_modes_of_the_thesis() -> None:
    """Table 2.2 and the pull-outs of table 3.1; with the sun fixed by equation 2.8, where the table slips."""
    modes = {(mode.input, mode.output): mode for mode in operating_modes(GEAR, 18)}
    s, r, c = Member
    wanted = {(s, r): -13 / 5, (r, s): -5 / 13, (s, c): 18 / 5, (c, s): 5 / 18, (c, r): 13 / 18, (r, c): 18 / 13}
    assert {ends: mode.ratio for ends, mode in modes.items()} == pytest.approx(wanted)
    assert modes[s, r].torques == pytest.approx((2.57, 6.68, -9.25), abs=0.005)


@pytest.mark.parametrize(("pole_pairs", "factor"), [(5, 2), (13, 2), (7, 2), (11, 2), (9, 18)])
def test_cogging_factor(pole_pairs: int, factor: int) -> None:
    assert cogging_factor(pole_pairs, 18) == factor


@given(pairs, pairs)
def test_the_modulated_fundamental_of_each_rotor_drives_the_other(sun: int, ring: int) -> None:
    waves = space_harmonics(gear_of(sun, ring), sun + ring)
    found = {(w.of, w.drives): w for w in waves if w.magnet == 1 and w.modulation == -1 and w.drives}
    assert found[Member.SUN, Member.RING].speed == pytest.approx(-sun / ring)
    assert found[Member.RING, Member.SUN].speed == pytest.approx(-ring / sun)


def test_the_page_holds_every_number_and_marks_those_without_uncertainty() -> None:
    document, lines = shown_bench(load_bench())
    text = "\n".join(lines)
    assert "gear 1: 18 iron poles = 5 + 13 pole pairs" in text
    assert "72 degrees" in text
    assert "27.69 degrees" in text
    assert document["numbers"]["motor"]["bus_voltage"]["value"] == 560.0
    assert text.count("(no uncertainty stated)") == sum(
        number["u"] is None for section in document["numbers"].values() for number in section.values()
    )
    assert text.count("Politecnico di Torino") == 1, "a work is named once"
    assert list(document["gears"]) == ["1", "2"]
    of_machine, shown = shown_machine("thesis-gear-1")
    assert of_machine["gears"]["1"] == document["gears"]["1"]
    assert any("operating modes" in line for line in shown)
