"""Printed numbers are the same on every type of core and with one thread or two: `pytest -k processors`."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.diagnosis.grid.candidates import candidates, grid_problem
from pmg.pipeline.diagnosis.grid.decide import diagnose
from pmg.pipeline.diagnosis.grid.document import diagnosis_document
from pmg.pipeline.diagnosis.grid.fitting import fit_candidate
from pmg.pipeline.diagnosis.grid.refit import refit
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.sim.bench import load_bench
from pmg.sim.grid import Grid
from tests.bench.processors import ROOT, TYPES, cores_in_use, leaves, on, taken
from tests.nature import Nature, campaign_points, measure
from tests.recovery.test_planted import thermal_factor


def numbers_of_a_diagnosis(grid: Grid, rng: np.random.Generator) -> str:
    """The document of a diagnosis as it is written."""
    bench = load_bench()
    analysis = analyse(grid, AnalysisOptions(), bench)
    assert analysis.fits is not None
    assert analysis.floor is not None
    assert analysis.calibration is not None
    found = diagnose(analysis.grid, analysis.fits, analysis.floor, analysis.calibration, bench, rng)
    return json.dumps(diagnosis_document(found), indent=1)


def numbers_of_a_fit(grid: Grid) -> str:
    """Noise floor, calibration, a bearing that warms, and all of them fitted together."""
    bench = load_bench()
    analysis = analyse(grid, AnalysisOptions(), bench)
    assert analysis.floor is not None
    assert analysis.calibration is not None
    readings = take_readings(analysis.grid, bench)
    white = whitener(readings, bench, analysis.floor)
    problem = grid_problem(readings, bench, analysis.calibration.model, white)
    (warming,) = (c for c in candidates() if (c.identifier, c.shaft) == ("lubricant_viscosity", "ring"))
    fit = fit_candidate(problem, warming)
    together = refit(problem, (fit,))
    values = [analysis.floor.sun.u, analysis.floor.ring.u, *analysis.calibration.values, *fit.values, fit.gain]
    values += [*together.values[0], *together.standard_errors[0], *together.prediction]
    return " ".join(f"{value:.8g}" for value in values)


def print_numbers() -> None:
    """Print the types of core in use, a diagnosis, a fit in the order of the test, and what a command prints."""
    rng = np.random.default_rng(3)
    at = campaign_points("random", rng)
    few = at[(np.arange(len(at)) % 3 == 0) | at.zero | at.engaged]
    few = replace(few, started_at=np.full(len(few), np.nan))
    power = Nature().drag(Nature().ring, at.speed_ring) * np.abs(at.speed_ring)
    told = [" ".join(cores_in_use())]
    told.append(numbers_of_a_diagnosis(measure(Nature(), few, rng, sun_gain=0.04)[0], rng))
    warming = thermal_factor(at.started_at, power)
    told.append(numbers_of_a_fit(measure(Nature(), at, rng, ring_factor=warming)[0]))
    told.append(CliRunner().invoke(app, ["design", str(ROOT / "raw" / "plans" / "thesis.toml")]).output)
    sys.stdout.write("\n".join(told))


def test_numbers_are_the_same_on_every_processor(tmp_path: Path) -> None:
    """One run a type, with one and two threads in turn; two alike where there is no choice of type."""
    types = [core for core in TYPES if taken(core)] if cores_in_use() else []
    runs = [(core, 1 + i % 2) for i, core in enumerate(types or ["", ""])]
    words = ["-c", "from tests.test_processors import print_numbers; print_numbers()"]
    told = {}
    for core, threads in runs if len(types) != 1 else [*runs, (types[0], 2)]:
        used, told[core, threads] = on(core, threads, words, tmp_path).split("\n", 1)
        assert not core or set(used.split()) == {core}
    (first, printed), *others = told.items()
    assert '"id": "torque_gain_error"' in printed
    for other, text in others:
        assert text == printed, f"{other} prints other numbers than {first} (core, threads)"
    if not types:
        pytest.skip("the linear algebra here is no OpenBLAS whose type of core can be chosen; only a repeat is proven")


def test_a_difference_between_processors_is_found_with_its_place() -> None:
    one, other = {"a": [1.0, {"b": None}], "c": []}, {"a": [1.0, {"b": 2}], "c": []}
    assert set(leaves(one)) - set(leaves(other)) == {(".a.1.b", None)}
