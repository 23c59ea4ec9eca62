"""The verdict: what these recordings allow to be said about the difference to the simulation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.calibrate import jacobian
from pmg.pipeline.diagnose.candidates import set_stage
from pmg.pipeline.diagnose.holdout import hold_out
from pmg.pipeline.diagnose.leftover import make_judge
from pmg.pipeline.diagnose.locate import find_mismatch, located_families
from pmg.pipeline.diagnose.naming import name_mechanisms
from pmg.pipeline.diagnose.nexttest import next_test
from pmg.pipeline.diagnose.noise import repeat_contrasts
from pmg.pipeline.diagnose.refit import refit
from pmg.pipeline.diagnose.whiten import whitener
from pmg.pipeline.diagnose.withheld import withhold
from pmg.pipeline.readings import predict
from pmg.sim.mechanisms import Component

if TYPE_CHECKING:
    from pmg.pipeline.calibrate import Calibration
    from pmg.pipeline.diagnose.holdout import HeldOut
    from pmg.pipeline.diagnose.locate import Location, Mismatch
    from pmg.pipeline.diagnose.naming import Explanation, Naming
    from pmg.pipeline.diagnose.nexttest import NextTest
    from pmg.pipeline.diagnose.noise import NoiseFloor
    from pmg.pipeline.diagnose.refit import Refit
    from pmg.pipeline.fit import LossFits
    from pmg.pipeline.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid

ORDER_IS_SPEED = 0.95
"""Rank correlation of speed and order from which on a slow change cannot be told from a loss curve."""

MOST_OUTLIERS = 0.04
"""Part of the points that may be set aside because they stand out by themselves; more is no accident."""

WITHHELD_SHARE = 0.8
"""Part of the withheld mismatch, in squares beyond the noise, that a mechanism must predict to be named."""

JUDGE_DRAWS = 300
"""Synthetic campaigns behind the adequacy of an explanation."""


class Verdict(StrEnum):
    """What may be said."""

    CONSISTENT = "consistent"
    NAMED = "named"
    AMBIGUOUS = "ambiguous"
    NOT_IN_LIBRARY = "not_in_library"
    CONFOUNDED = "confounded"


@dataclass(frozen=True)
class Absorbed:
    """A baseline parameter before and after what was left out joined the fit."""

    parameter: str
    before: float
    after: float
    standard_error: float | None


@dataclass(frozen=True)
class Rival:
    """An explanation that these data cannot tell from the leading one, and the test that would.

    Parameters
    ----------
    explanation : Explanation
        The rival set of mechanisms.
    test : NextTest or None
        The test.
    """

    explanation: Explanation
    test: NextTest | None


@dataclass(frozen=True)
class Diagnosis:
    """Mismatch, place, cause and verdict.

    Parameters
    ----------
    campaign : str
        Name of the campaign.
    verdict : Verdict
        One of the five words.
    mismatch : Mismatch
        Test and locations.
    floor : NoiseFloor
        Noise it was judged against.
    blind : tuple of str
        Shafts whose points were run in the order of their speed, without repeats.
    naming : Naming or None
        What the catalogue says; None without a mismatch.
    refit : Refit or None
        Baseline and mechanisms fitted together.
    rivals : tuple of Rival
        Explanations that cannot be told from it.
    absorbed : tuple of Absorbed
        What the baseline had swallowed.
    held_out : HeldOut or None
        Error on withheld readings without and with what was left out.
    outliers : tuple of str
        Points that stand out by themselves and were set aside before the rest was judged.
    """

    campaign: str
    verdict: Verdict
    mismatch: Mismatch
    floor: NoiseFloor
    blind: tuple[str, ...] = ()
    naming: Naming | None = None
    refit: Refit | None = None
    rivals: tuple[Rival, ...] = ()
    absorbed: tuple[Absorbed, ...] = ()
    held_out: HeldOut | None = None
    outliers: tuple[str, ...] = ()


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
    """Test for a mismatch, locate it, search the catalogue for what makes it, and prove it on withheld readings.

    A mechanism is named when it brings more evidence than its parameters cost, beats every rival by a margin, leaves
    no more than an error of form, and predicts most of the mismatch of withheld readings. Rivals within the
    margin are reported as one set with the test that would tell.
    """
    mismatch, outliers = _without_outliers(grid, fits, floor, bench, rng)
    readings = mismatch.readings
    blind = confounded_shafts(readings)
    if not mismatch.found:
        verdict = Verdict.CONFOUNDED if blind else Verdict.CONSISTENT
        return Diagnosis(grid.campaign, verdict, mismatch, floor, blind, outliers=outliers)
    stage = set_stage(readings, bench, calibration.model, whitener(readings, bench, floor))
    naming = name_mechanisms(stage, make_judge(stage, floor, rng, JUDGE_DRAWS))
    if naming.explained:
        held = withhold(stage, naming.best.fits, rng)
        if _predicts(held):
            found = refit(stage, naming.best.fits)
            rivals = tuple(Rival(rival, next_test(stage, naming.best, rival, floor)) for rival in naming.rivals)
            verdict = Verdict.AMBIGUOUS if rivals else Verdict.NAMED
            swallowed = _swallowed(calibration, found)
            return Diagnosis(
                grid.campaign, verdict, mismatch, floor, blind, naming, found, rivals, swallowed, held, outliers
            )
    held_structure = hold_out(grid, fits, floor, bench, mismatch.locations, rng)
    absorbed = _absorbed(mismatch, calibration, bench)
    return Diagnosis(
        grid.campaign,
        Verdict.NOT_IN_LIBRARY,
        mismatch,
        floor,
        blind,
        naming,
        None,
        (),
        absorbed,
        held_structure,
        outliers,
    )


def _predicts(held: HeldOut) -> bool:
    """Whether a mechanism predicts most of the mismatch of withheld readings."""
    before = held.rmse_before**2 - held.noise_floor**2
    after = held.rmse_after**2 - held.noise_floor**2
    return held.rmse_after < held.rmse_before and after <= (1.0 - WITHHELD_SHARE) * before


def _without_outliers(
    grid: Grid, fits: LossFits, floor: NoiseFloor, bench: BenchParameters, rng: np.random.Generator
) -> tuple[Mismatch, tuple[str, ...]]:
    """The mismatch of the points that do not stand out by themselves, and the names of those that do.

    A single reading far from all others is a bad reading, not physics: it is set aside and told, and the rest is judged
    again, as long as they are few.
    """
    aside: list[str] = []
    mismatch = first = find_mismatch(grid, fits, floor, bench, rng)
    while mismatch.found and mismatch.locations[0].depends_on == ("point",):
        if len(aside) >= MOST_OUTLIERS * len(grid):
            return first, ()
        effect = mismatch.locations[0].effect
        row = int(mismatch.readings.row[int(np.argmax(np.abs(effect)))])
        aside.append(str(grid.points.name[row]))
        accepted = grid.accepted.copy()
        accepted[row] = False
        grid = replace(grid, accepted=accepted)
        mismatch = find_mismatch(grid, fits, floor, bench, rng)
    return mismatch, tuple(aside)


def _swallowed(calibration: Calibration, found: Refit) -> tuple[Absorbed, ...]:
    """Baseline constants alone and with the mechanisms in."""
    after = {"K_corr": found.model.correction, "b": found.model.b, "c": found.model.c, "d": found.model.d}
    rows = []
    for name in calibration.free:
        error = found.baseline_errors.get(name, float("nan"))
        rows.append(Absorbed(name, calibration.value(name), after[name], error if np.isfinite(error) else None))
    return tuple(rows)


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
