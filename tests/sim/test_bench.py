"""The numbers of the bench: they travel whole."""

from __future__ import annotations

import copy
import pickle

from pmg.sim.bench import BenchParameters, SourcedQuantity


def test_a_quantity_goes_to_another_process_with_unit_and_uncertainty() -> None:
    given = SourcedQuantity(2.5, "N m", 0.1)
    for other in (pickle.loads(pickle.dumps(given)), copy.deepcopy(given)):
        assert (float(other), other.unit, other.u, other.source) == (2.5, "N m", 0.1, given.source)


def test_the_whole_bench_does_too(bench: BenchParameters) -> None:
    other = pickle.loads(pickle.dumps(bench))
    assert other == bench
    assert other.motor.resistance.unit == bench.motor.resistance.unit
