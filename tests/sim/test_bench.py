"""The numbers of the bench: they travel whole."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from pmg.sim.bench import BenchParameters, SourcedQuantity


def test_a_quantity_goes_to_another_process_with_unit_and_uncertainty() -> None:
    given = SourcedQuantity(2.5, "N m", 0.1)
    for other in (pickle.loads(pickle.dumps(given)), copy.deepcopy(given)):
        assert (float(other), other.unit, other.u, other.source) == (2.5, "N m", 0.1, given.source)


def test_the_whole_bench_does_too(bench: BenchParameters) -> None:
    other = pickle.loads(pickle.dumps(bench))
    assert other == bench
    assert other.motor.resistance.unit == bench.motor.resistance.unit


def test_the_poles_do_not_slip_while_the_gear_holds_and_slip_at_a_speed_of_each_stage(bench: BenchParameters) -> None:
    gear, ring = np.array([1, 2, 1, 2]), np.array([-50.0, -70.0, 0.0, 3.0])
    sun = np.array([130.0, 110.0, 10.0, 1.0])
    assert bench.ratio(gear) == pytest.approx([13 / 5, 11 / 7, 13 / 5, 11 / 7])
    assert bench.pole_slip(gear, sun, ring) == pytest.approx([0.0, 0.0, 50.0, 40.0], abs=1e-9)
