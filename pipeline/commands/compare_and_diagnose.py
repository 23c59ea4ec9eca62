"""An analysed campaign compared with the simulator: residuals, diagnosis, and the model that comes of it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.analysis.comparison import compare
from pmg.pipeline.analysis.tolerance import Tolerance, agreements
from pmg.pipeline.diagnosis.design.audit import audit_design
from pmg.pipeline.diagnosis.grid.decide import diagnose
from pmg.pipeline.diagnosis.grid.document import mechanism_facts
from pmg.pipeline.diagnosis.grid.zeros import zero_columns
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.model.apply_model import apply_model, found_together
from pmg.pipeline.model.compared_campaign import ComparedCampaign
from pmg.pipeline.model.extreme_steady_points import extreme_steady_points
from pmg.pipeline.model.model_file import model_of, model_text
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from pmg.pipeline.analysis.comparison import Residuals
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.options import AnalysisOptions
    from pmg.pipeline.grid.readings import Readings
    from pmg.pipeline.model.apply_model import Carried
    from pmg.pipeline.model.model_file import Model
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

DIAGNOSIS = "diagnosis.json"
"""Name of the diagnosis next to the report."""

SEED = 20260101
"""Seed of the synthetic campaigns behind a p-value; named in the report."""


@dataclass(frozen=True)
class SimulatedCampaign:
    """A campaign measured and simulated.

    Parameters
    ----------
    residuals : Residuals
        Measured less simulated, with the calibrated baseline or with the given model as it came.
    carried : Carried or None
        The given model.
    plain : Gearbox
        With the calibrated baseline.
    """

    residuals: Residuals
    carried: Carried | None
    plain: Gearbox


def compare_and_diagnose(
    analysis: Analysis,
    options: AnalysisOptions,
    bench: BenchParameters,
    rng: np.random.Generator,
    given: Model | None = None,
    *,
    beside_motion: bool = False,
) -> ComparedCampaign | None:
    """Simulate, compare and diagnose an analysed campaign.

    Parameters
    ----------
    analysis : Analysis
        Of the campaign by itself.
    options : AnalysisOptions
        Choices of that analysis.
    bench : BenchParameters
        The bench.
    rng : numpy.random.Generator
        Draws the synthetic campaigns behind a p-value.
    given : Model, optional
        A model to simulate instead of the calibrated baseline. Its mechanisms are then known to be there: the
        diagnosis looks at what remains, and their parameters are as free in it as those of the baseline.
    beside_motion : bool
        Whether the campaign holds runs in motion, too, which tell the zeros of the transducers: they are free here.

    Returns
    -------
    ComparedCampaign or None
        None where the analysis reached no calibration.
    """
    simulated = simulate_campaign(analysis, options, bench, given)
    return None if simulated is None else diagnose_campaign(analysis, simulated, bench, rng, beside_motion)


def simulate_campaign(
    analysis: Analysis, options: AnalysisOptions, bench: BenchParameters, given: Model | None = None
) -> SimulatedCampaign | None:
    """Simulate an analysed campaign, and subtract; None where the analysis reached no calibration."""
    if analysis.calibration is None or analysis.fits is None or analysis.floor is None:
        return None
    plain = Gearbox.calibrated(bench, analysis.calibration.model)
    carried = None if given is None else apply_model(given, analysis, options, bench)
    gearbox = plain if carried is None else carried.gearbox
    grid = analysis.grid
    residuals = compare(grid, steady(gearbox, grid.points, grid.campaign), bench, analysis.calibration)
    return SimulatedCampaign(residuals, carried, plain)


def diagnose_campaign(
    analysis: Analysis,
    simulated: SimulatedCampaign,
    bench: BenchParameters,
    rng: np.random.Generator,
    beside_motion: bool = False,
) -> ComparedCampaign:
    """Diagnose what a simulated campaign leaves, and make the model that comes of it."""
    grid, carried = analysis.grid, simulated.carried
    left = analysis if carried is None else carried.analysis
    assert analysis.calibration is not None
    assert left.calibration is not None
    assert left.fits is not None
    assert left.floor is not None
    free: list[Callable[[Readings], Array]] = []
    if carried is not None and carried.here.parts:
        free.append(carried.slopes)
    if beside_motion:
        free.append(partial(zero_columns, bench=bench, model=left.calibration.model))
    known = (lambda readings: np.hstack([columns(readings) for columns in free])) if free else None
    diagnosis = diagnose(left.grid, left.fits, left.floor, left.calibration, bench, rng, known)
    audit = audit_design(left.grid, bench, left.calibration.model, left.floor)
    diagnosis = replace(diagnosis, audit=audit, outliers=(*left.outliers, *diagnosis.outliers))
    if carried is None:
        model = shown = model_of(grid, analysis.calibration, diagnosis)
    else:
        model, shown = found_together(carried, analysis, diagnosis), carried.model
    after = (*baseline_mechanisms(shown.baseline, bench), *shown.mechanisms(bench))
    ends = extreme_steady_points(grid, bench, simulated.plain.mechanisms, after) if shown.parts else ()
    return ComparedCampaign(simulated.residuals, diagnosis, model, carried, ends)


def summary_facts(
    grid: Grid,
    judged: ComparedCampaign | None,
    bench: BenchParameters,
    tolerances: Mapping[str, tuple[float, float]] | None = None,
) -> dict[str, Any]:
    """Facts that `report.summary` adds for programs: points, verdict, mechanisms, counts of the comparison.

    Parameters
    ----------
    grid : Grid
        The analysed grid.
    judged : ComparedCampaign or None
        What it says about the simulator; without it only the points are compared.
    bench : BenchParameters
        Data sheets of the transducers.
    tolerances : mapping, optional
        Tolerances that were set, by quantity: absolute [SI] and relative.
    """
    points = {"accepted": int(grid.accepted.sum()), "rejected": int((~grid.accepted).sum())}
    if judged is None:
        return {"points": points}
    given = {name: Tolerance(*parts) for name, parts in (tolerances or {}).items()}
    return {
        "points": points,
        "diagnosis": str(judged.diagnosis.verdict),
        "mechanisms": mechanism_facts(judged.diagnosis),
        "tolerance": agreements(judged.residuals, bench, given).counts,
    }


def leave_diagnosis(document: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Write a diagnosis into its file next to a report, and return it as the file has it."""
    text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n"
    write_atomic(folder / DIAGNOSIS, text.encode())
    found: dict[str, Any] = json.loads(text)
    return found


def leave_model(judged: ComparedCampaign, path: Path, given: Path | None) -> dict[str, Any]:
    """Write the model after this campaign, and say where, and what was predicted; a given one is not written over."""
    found: dict[str, Any] = {"model": None, "prediction": None}
    if given is None or path.resolve() != given.resolve():
        write_atomic(path, model_text(judged.model).encode())
        found["model"] = str(path)
    if judged.carried is not None:
        found["prediction"] = [asdict(prediction) for prediction in judged.carried.predictions]
    return found
