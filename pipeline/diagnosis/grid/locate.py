"""Location of a mismatch: is there one, and where, one test over all places at once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE, Mismatch, search
from pmg.pipeline.diagnosis.grid.candidates import grid_problem
from pmg.pipeline.diagnosis.grid.evidence import broad_and_narrow, campaign_evidence, swings
from pmg.pipeline.diagnosis.grid.fitting import traces
from pmg.pipeline.fit.calibration import start_model
from pmg.pipeline.fit.structure import families
from pmg.pipeline.fit.whitening import undo, whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.engine.scan import Scan
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.fit.structure import ResidualStructure
    from pmg.pipeline.fit.whitening import Whitener
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array, Mask

DRAWS = 1000
"""Synthetic campaigns behind the p-value of the whole procedure."""

MAXIMUM_LOCATIONS = 4
"""Places named at most; what is left after them is said to be left."""

SAME_TRACE = 0.9
"""Part of a located effect that another family must carry to be listed as an equal covariate."""


@dataclass(frozen=True)
class Location:
    """A place where simulation and recordings differ.

    Parameters
    ----------
    signal : str
        Reading that shows it.
    configuration : str
        ``neutral``, ``engaged``, ``zero`` or ``all``.
    covariates : tuple of str
        Those of the family that shows it most clearly; empty where no family does.
    depends_on : tuple of str
        Covariates it follows; first the family that shows it most clearly, then those that carry the same trace.
    region : dict
        Range of each quantity in which it exceeds half its peak; the names carry the units.
    size : float
        Root mean square of the effect over the readings concerned [N m], after what the baseline absorbs.
    peak : float
        Largest effect [N m].
    p_value : float
        Probability of one as clear, anywhere, in a campaign without a mismatch.
    effect : (m,) array
        The effect at each reading [N m]; zero elsewhere.
    """

    signal: str
    configuration: str
    covariates: tuple[str, ...]
    depends_on: tuple[str, ...]
    region: dict[str, tuple[float, float]]
    size: float
    peak: float
    p_value: float
    effect: Array


@dataclass(frozen=True)
class CampaignMismatch(Mismatch[Location]):
    """The outcome of the test on a campaign, with the m readings that were tested."""

    readings: Readings


def find_mismatch(
    grid: Grid,
    fits: LossFits,
    floor: NoiseFloor,
    bench: BenchParameters,
    rng: np.random.Generator,
    *,
    draws: int = DRAWS,
    false_alarm_rate: float = FALSE_ALARM_RATE,
    allowed: Array | None = None,
) -> CampaignMismatch:
    r"""Test the residual of the baseline for structure anywhere, and say where it sits.

    Parameters
    ----------
    grid : Grid
        Measured grid.
    fits : LossFits
        Curves of the neutral points (their terms are the baseline's).
    floor : NoiseFloor
        Noise of the readings and its correlation from point to point.
    bench : BenchParameters
        Ratio, pole pairs.
    rng : numpy.random.Generator
        Draws the synthetic campaigns.
    draws : int
        How many of them.
    false_alarm_rate : float
        Level of the test.
    allowed : (m, k) array, optional
        What the baseline may use besides its constants, as columns over the readings [N m per unit].

    Notes
    -----
    The readings are linearised about the fitted baseline and made white. For each family of structure, what is left
    of it after projecting out every baseline parameter (curves, K_corr, b, c, d) gives an F statistic against the
    scatter that follows no family, and so does the trace of each mechanism of the catalogue. Two more statistics a
    shaft ask whether repeats scatter more, or less, than that, and one looks at the largest single residual. The
    search over all of them is paid for (`pmg.pipeline.diagnosis.engine.mismatch`). Locations are taken one by one, each
    time with the earlier ones added to the baseline.
    """
    readings = take_readings(grid, bench)
    problem = grid_problem(readings, bench, start_model(fits), whitener(readings, bench, floor), allowed)
    candidates, narrow = broad_and_narrow(problem)
    evidence = campaign_evidence(problem, floor, draws, rng, traces(problem))
    columns, white, y = evidence.families, problem.white, evidence.y
    p_value, locations = 1.0, []
    for number, step in enumerate(search(evidence, steps=MAXIMUM_LOCATIONS, level=false_alarm_rate)):
        scan, best = step.scan, step.best
        if number == 0:
            p_value = step.p_value
        if step.p_value > false_alarm_rate:
            break
        if best >= len(columns):
            locations.append(_without_family(readings, scan, y, white, best - len(columns), step.p_value))
            break
        effect_white = scan.bases[best] @ (scan.bases[best].T @ y)
        effect = undo(white, effect_white)
        follows = best if best < len(candidates) else _carrying(candidates, scan, effect_white)
        family, also = candidates[follows], same_trace(candidates, scan, follows, effect_white)
        if best >= len(columns) - len(narrow):
            family, also = narrow[best - len(columns)], []
        others = tuple(candidates[i] for i in also)
        locations.append(_locate(readings, family, others, effect, step.p_value))
    return CampaignMismatch(p_value, false_alarm_rate, tuple(locations), len(columns), draws, readings)


def _carrying(candidates: tuple[ResidualStructure, ...], scan: Scan, effect_white: Array) -> int:
    """The family that carries most of an effect."""
    carried = [float(np.sum((basis.T @ effect_white) ** 2)) for basis in scan.bases[: len(candidates)]]
    return int(np.argmax(carried))


def located_families(
    readings: Readings, bench: BenchParameters, model: LossModel, locations: tuple[Location, ...]
) -> Array:
    """Columns (m, k) of the families that the locations follow; none where they follow no family."""
    chosen = [
        family.columns
        for family in (*families(readings, bench, model), *swings(readings))
        if any(
            (family.signal, family.configuration) == (place.signal, place.configuration)
            and family.covariates == place.covariates
            for place in locations
        )
    ]
    return np.hstack(chosen) if chosen else np.zeros((len(readings), 0))


def same_trace(candidates: tuple[ResidualStructure, ...], scan: Scan, best: int, effect_white: Array) -> list[int]:
    """Other families, of the same signal and configuration, that carry `SAME_TRACE` of a family's effect."""
    family = candidates[best]
    energy = float(effect_white @ effect_white)
    found = []
    for k, (other, basis) in enumerate(zip(candidates, scan.bases, strict=False)):
        if other.signal != family.signal or other.configuration != family.configuration or other is family:
            continue
        if float(np.sum((basis.T @ effect_white) ** 2)) >= SAME_TRACE * energy:
            found.append(k)
    return found


def _locate(
    readings: Readings, family: ResidualStructure, others: tuple[ResidualStructure, ...], effect: Array, p_value: float
) -> Location:
    """The place of an effect that a family shows, and that others carry as well."""
    touched = (family.columns != 0.0).any(axis=1)
    covariates = list(family.covariates)
    for other in others:
        covariates += [name for name in other.covariates if name not in covariates]
    strong = touched & (np.abs(effect) >= 0.5 * np.abs(effect[touched]).max())
    return Location(
        signal=family.signal,
        configuration=family.configuration,
        covariates=family.covariates,
        depends_on=tuple(covariates),
        region=_region(readings, strong),
        size=math.sqrt(float(np.mean(effect[touched] ** 2))),
        peak=float(np.abs(effect).max()),
        p_value=p_value,
        effect=np.where(touched, effect, 0.0),
    )


def _region(readings: Readings, rows: Mask) -> dict[str, tuple[float, float]]:
    at = readings.grid.points[readings.row[rows]]
    region: dict[str, Array] = {
        "sun_speed_rpm": SPEED_SUN.display(at.speed_sun),
        "ring_speed_rpm": SPEED_RING.display(at.speed_ring),
        "ring_torque_Nm": at.torque_ring,
    }
    if at.ordered:
        order = np.argsort(np.argsort(readings.grid.points.started_at, kind="stable"), kind="stable")
        region["order"] = np.asarray(order[readings.row[rows]] + 1.0)
    return {name: (round(float(v.min()), 3), round(float(v.max()), 3)) for name, v in region.items()}


def _without_family(readings: Readings, scan: Scan, y: Array, white: Whitener, which: int, p_value: float) -> Location:
    """A mismatch that no family follows: repeats against the rest, or one point that stands out."""
    residual = y - scan.baseline @ (scan.baseline.T @ y)
    tests = [
        (signal, kind)
        for signal, columns in zip(("torque_sun", "torque_ring"), scan.evidence.contrasts, strict=True)
        if columns.shape[1]
        for kind in ("time", "none")
    ]
    if which < len(tests):
        signal, kind = tests[which]
        rows = readings.of_shaft[signal.removeprefix("torque_")]
        depends_on: tuple[str, ...] = ("order",) if kind == "time" else ()
    else:
        worst = int(np.argmax(np.abs(residual)))
        rows = np.arange(len(readings)) == worst
        signal, depends_on = ("torque_sun" if readings.sun[worst] else "torque_ring"), ("point",)
    effect = np.where(rows, undo(white, residual), 0.0)
    where = np.unique(readings.configuration[rows])
    return Location(
        signal=signal,
        configuration=str(where[0]) if len(where) == 1 else "all",
        covariates=(),
        depends_on=depends_on,
        region=_region(readings, rows),
        size=math.sqrt(float(np.mean(effect[rows] ** 2))),
        peak=float(np.abs(effect).max()),
        p_value=p_value,
        effect=effect,
    )
