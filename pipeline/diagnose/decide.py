"""The verdict: what these recordings allow to be said about the difference to the simulation."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

from pmg.pipeline.calibrate import jacobian
from pmg.pipeline.diagnose.holdout import hold_out
from pmg.pipeline.diagnose.locate import find_mismatch, located_families
from pmg.pipeline.diagnose.noise import repeat_contrasts
from pmg.pipeline.readings import predict
from pmg.sim.mechanisms import Component

if TYPE_CHECKING:
    from pmg.pipeline.calibrate import Calibration
    from pmg.pipeline.diagnose.holdout import HeldOut
    from pmg.pipeline.diagnose.locate import Location, Mismatch
    from pmg.pipeline.diagnose.noise import NoiseFloor
    from pmg.pipeline.fit import LossFits
    from pmg.pipeline.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid

SCHEMA = "pmg.diagnosis/1"


ORDER_IS_SPEED = 0.95
"""Rank correlation of speed and order from which on a slow change cannot be told from a loss curve."""


class Verdict(StrEnum):
    """What may be said."""

    CONSISTENT = "consistent"
    NAMED = "named"
    AMBIGUOUS = "ambiguous"
    NOT_IN_LIBRARY = "not_in_library"
    CONFOUNDED = "confounded"


@dataclass(frozen=True)
class Absorbed:
    """A baseline parameter before and after the located structure joined the fit."""

    parameter: str
    before: float
    after: float
    standard_error: float | None


@dataclass(frozen=True)
class Diagnosis:
    """Mismatch, place and verdict.

    Parameters
    ----------
    campaign : str
        Name of the campaign.
    verdict : Verdict
        One of the five words.
    statement : str
        The verdict in a sentence.
    mismatch : Mismatch
        Test and locations.
    floor : NoiseFloor
        Noise it was judged against.
    absorbed : tuple of Absorbed
        What the baseline had swallowed.
    held_out : HeldOut or None
        Error on withheld readings with and without the located structure.
    """

    campaign: str
    verdict: Verdict
    statement: str
    mismatch: Mismatch
    floor: NoiseFloor
    absorbed: tuple[Absorbed, ...]
    held_out: HeldOut | None


def component_of(place: Location) -> Component | None:
    """Component that the evidence points to; None where it cannot tell (load: gear, bearing or transducer)."""
    shaft = "sun" if place.signal == "torque_sun" else "ring"
    first = place.depends_on[0] if place.depends_on else ""
    if set(place.depends_on) - set(place.covariates):
        return None
    if place.configuration == "zero" or first == "direction":
        return Component(f"{shaft}_torque_transducer")
    if first == "pole_slip_speed":
        return Component.MAGNETIC_GEAR
    if first == "speed_difference":
        return Component.RELATIVE_BEARING
    if place.configuration == "neutral" and first in ("run_history", f"speed_{shaft}"):
        return Component(f"{shaft}_bearings")
    return None


def confounded_shafts(readings: Readings) -> tuple[str, ...]:
    """Shafts whose neutral points were run in the order of their speed, in a campaign without a repeated point.

    Rank correlation of speed and order of at least `ORDER_IS_SPEED`: what changes with time then looks like what
    changes with speed, and no repeat tells them apart.
    """
    at = readings.grid.points
    again = repeat_contrasts(readings)[readings.configuration != "zero"]
    if not at.ordered or again.any():
        return ()
    found = []
    for shaft, mine in (("sun", readings.sun), ("ring", ~readings.sun)):
        rows = mine & (readings.configuration == "neutral")
        speed, time = np.abs(readings.speed_own[rows]), at.started_at[readings.row[rows]]
        if len(np.unique(speed)) > 2 and abs(stats.spearmanr(np.round(speed), time).statistic) >= ORDER_IS_SPEED:
            found.append(shaft)
    return tuple(found)


def diagnose(
    grid: Grid,
    fits: LossFits,
    floor: NoiseFloor,
    calibration: Calibration,
    bench: BenchParameters,
    rng: np.random.Generator,
) -> Diagnosis:
    """Test for a mismatch, locate it, prove the location on withheld readings, and say what follows.

    The mechanism library holds the baseline only, so a mismatch is never named here: it is located and sized.
    """
    mismatch = find_mismatch(grid, fits, floor, bench, rng)
    blind = confounded_shafts(mismatch.readings)
    if not mismatch.found and blind:
        statement = (
            f"No mismatch beyond the noise (p = {mismatch.p_value:.3g}), but this campaign cannot tell: the points "
            f"were run in the order of the {' and '.join(blind)} speed and none was repeated: a slow change, however "
            "large, would pass for part of the loss curve. Repeat points spread over the grid, in random order."
        )
        return Diagnosis(grid.campaign, Verdict.CONFOUNDED, statement, mismatch, floor, (), None)
    if not mismatch.found:
        statement = (
            f"No mismatch beyond the noise (p = {mismatch.p_value:.3g} over {mismatch.tested} kinds of structure, "
            f"judged at {mismatch.false_alarm_rate:.0%})."
        )
        return Diagnosis(grid.campaign, Verdict.CONSISTENT, statement, mismatch, floor, (), None)
    held = hold_out(grid, fits, floor, bench, mismatch.locations, rng)
    return Diagnosis(
        campaign=grid.campaign,
        verdict=Verdict.NOT_IN_LIBRARY,
        statement=_statement(mismatch, held),
        mismatch=mismatch,
        floor=floor,
        absorbed=_absorbed(mismatch, calibration, bench),
        held_out=held,
    )


def _statement(mismatch: Mismatch, held: HeldOut | None) -> str:
    place = mismatch.locations[0]
    follows = " and ".join(word.replace("_", " ") for word in place.depends_on) or "nothing that was recorded"
    special = {"all": "in every configuration", "zero": "at the zero checks"}
    where = special.get(place.configuration, f"in {place.configuration} points")
    sentence = (
        f"Simulation and recordings differ (p ≤ {mismatch.p_value:.2g}): clearest in the "
        f"{place.signal.replace('torque_', '')} torque {where}, {place.size * 1e3:.1f} mN m rms, following {follows}."
    )
    if held is not None:
        low, high = held.gain_interval
        change = "falls" if low > 0.0 else ("rises" if high < 0.0 else "does not clearly fall:")
        sentence += (
            f" With that structure in (its kind chosen on all readings, its size without those withheld), the error "
            f"on withheld readings {change} from {held.rmse_before * 1e3:.2f} "
            f"to {held.rmse_after * 1e3:.2f} mN m (noise {held.noise_floor * 1e3:.2f})."
        )
    return sentence + " The library holds the baseline only: the place and shape are given, not the cause."


def _absorbed(mismatch: Mismatch, calibration: Calibration, bench: BenchParameters) -> tuple[Absorbed, ...]:
    """Baseline constants without and with the located families in a joint, weighted fit."""
    readings = mismatch.readings
    structure = located_families(readings, bench, calibration.model, mismatch.locations)
    if structure.shape[1] == 0:
        return ()
    slopes = jacobian(readings, bench, calibration.model, calibration.free)
    design = np.hstack([slopes, structure]) / readings.u[:, None]
    y = (readings.torque - predict(readings, bench, calibration.model)) / readings.u
    length = np.linalg.norm(design, axis=0)
    length[length == 0.0] = 1.0
    inverse = np.linalg.pinv(design / length, rcond=1e-8)
    change = inverse @ y / length
    error = np.sqrt(np.einsum("ij,ij->i", inverse, inverse)) / length
    first = len(calibration.names) - len(calibration.free)
    return tuple(
        Absorbed(name, before := calibration.value(name), before + float(change[i]), float(error[i]))
        for i, name in enumerate(calibration.free, start=first)
    )


MINUTES_A_POINT = 0.75
"""Bench time of one repeated point: approach, settling and a window of 5 s."""


def _spread(readings: Readings) -> list[str]:
    """Names of ten neutral points, evenly over those that were run."""
    at = readings.grid.points
    rows = np.flatnonzero(at.neutral & readings.grid.accepted)
    chosen = rows[np.linspace(0, len(rows) - 1, min(10, len(rows))).astype(int)]
    return [str(name) for name in at.name[chosen]]


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """The diagnosis as the JSON document ``pmg.diagnosis/1`` (its schema lies beside this module)."""
    mismatch, floor = diagnosis.mismatch, diagnosis.floor
    held = diagnosis.held_out
    return {
        "schema": SCHEMA,
        "campaign": diagnosis.campaign,
        "verdict": str(diagnosis.verdict),
        "p_value": mismatch.p_value,
        "false_alarm_rate": mismatch.false_alarm_rate,
        "noise_Nm": {
            "sun": floor.sun.u,
            "ring": floor.ring.u,
            "source": f"sun: {floor.sun.source}; ring: {floor.ring.source}",
        },
        "locations": [
            {
                "signal": place.signal,
                "configuration": place.configuration,
                "component": None if (component := component_of(place)) is None else str(component),
                "depends_on": list(place.depends_on),
                "region": {name: list(span) for name, span in place.region.items()},
                "size_Nm": place.size,
                "p_value": place.p_value,
            }
            for place in mismatch.locations
        ],
        "mechanisms": [],
        "rivals": [],
        "absorbed": [
            {
                "parameter": a.parameter,
                "before": a.before,
                "after": a.after,
                "standard_error": a.standard_error,
            }
            for a in diagnosis.absorbed
        ],
        "held_out": None
        if held is None
        else {
            "split": held.split,
            "rmse_before_Nm": held.rmse_before,
            "rmse_after_Nm": held.rmse_after,
            "noise_floor_Nm": held.noise_floor,
            "gain_interval_Nm": list(held.gain_interval),
        },
        "next_tests": [
            {
                "description": "Repeat ten points spread over the neutral grid, in random order, after the last point",
                "points": _spread(diagnosis.mismatch.readings),
                "minutes": 10.0 * MINUTES_A_POINT,
                "separates": ["lubricant_viscosity", "torque_zero_drift"],
                "power": None,
            }
        ]
        if diagnosis.verdict is Verdict.CONFOUNDED
        else [],
    }
