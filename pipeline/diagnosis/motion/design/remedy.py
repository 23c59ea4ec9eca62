"""What to do about a diagnosis of runs in motion: on the bench, and which run is next."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.remedy import LIKELY
from pmg.pipeline.diagnosis.motion.design.next_runs import LEAST_POWER, merged
from pmg.pipeline.diagnosis.motion.places import falls_at, largest_of, where_to_look

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.design.next_runs import NextRun

REMEDIES = {
    "rotor_inertia": "check the drawing of the {shaft} rotor for parts it lacks",
    "coupling_compliance": "inspect the {shaft} coupling, its clamping and its elastomer",
    "coupling_backlash": "inspect the {shaft} coupling and take out its play",
    "pull_out_torque": "put the fitted pull-out torque into the bench file",
    "lubricant_viscosity": "log the temperature of the {shaft} bearings and warm up first",
    "magnet_temperature": "log the temperature of the magnets and warm up first",
    "torque_zero_drift": "take the zero of the {shaft} transducer before and after each run",
    "torque_gain_error": "calibrate the {shaft} torque transducer{s}",
    "torque_crosstalk": "calibrate both torque transducers against each other",
    "transducer_bandwidth": "check the filter of the {shaft} torque transducer{s}",
    "channel_delay": "check the filters and the clock of the {shaft} torque and angle channels",
    "encoder_eccentricity": "check the seat of the {shaft} encoder",
    "shaft_unbalance": "balance the {shaft} shaft",
    "coupling_misalignment": "align the {shaft} coupling",
    "presliding_friction": "inspect the {shaft} bearings and seals",
    "direction_dependent_friction": "inspect the {shaft} bearings and seals",
}
"""What to do about a mechanism; the others belong into the model."""

OF_FILE = ("pull_out_torque",)
"""Mechanisms that are mended in the file of the bench, not on it."""

INTO_MODEL = "put the law with its fitted parameters (see `diagnosis.json`) into the model of the drive"


def advice(diagnosis: MotionDiagnosis) -> str:
    """What to do: of a cause, its remedy; of several, the run that would tell; of none, where to look."""
    if diagnosis.verdict is Verdict.NAMED and diagnosis.naming is not None:
        remedies = bench_actions(diagnosis)
        every = remedies if len(remedies) == len(diagnosis.naming.best.fits) else (*remedies, INTO_MODEL)
        return f"Do: {'; '.join(every)}."
    if diagnosis.next_runs:
        return f"Do: {next_run(diagnosis)}."
    falls = diagnosis.mismatch.locations and falls_at(diagnosis, largest_of(diagnosis))
    shown = "loss curves shows the fall" if falls else "the runs shows when the torque is missing"
    return f"Do: inspect {where_to_look(diagnosis)}; the chapter on {shown}."


def bench_actions(diagnosis: MotionDiagnosis) -> tuple[str, ...]:
    """What to do on the bench about each named mechanism that can be mended there."""
    if diagnosis.naming is None or diagnosis.verdict is not Verdict.NAMED:
        return ()
    actions = []
    for fit in diagnosis.naming.best.fits:
        shaft = diagnosis.naming.shafts[fit.identifier]
        where = {"either": "sun or ring", "both": "sun and ring"}.get(shaft, shaft)
        actions.append(REMEDIES.get(fit.identifier, "").format(shaft=where, s="s" * (shaft == "both")))
    return tuple(dict.fromkeys(filter(None, actions)))


def can_be_mended(diagnosis: MotionDiagnosis) -> bool:
    """Whether something named can be mended on the bench: more than a figure of its file."""
    fits = () if diagnosis.naming is None or diagnosis.verdict is not Verdict.NAMED else diagnosis.naming.best.fits
    return any(fit.identifier in REMEDIES and fit.identifier not in OF_FILE for fit in fits)


def would_tell(diagnosis: MotionDiagnosis) -> bool:
    """Whether a run is known that would tell, more likely than not."""
    return any(run.power >= LIKELY for run in diagnosis.next_runs)


def telling_runs(diagnosis: MotionDiagnosis) -> tuple[NextRun, ...]:
    """The runs that are worth their time, each once; all of a campaign that cannot see a mechanism."""
    every = merged(diagnosis.next_runs)
    return every if diagnosis.verdict is Verdict.CONFOUNDED else tuple(r for r in every if r.power >= LEAST_POWER)


def next_run(diagnosis: MotionDiagnosis) -> str:
    """The run that tells most, or that none would tell, to go on after a colon."""
    if runs := telling_runs(diagnosis):
        return max(runs, key=lambda run: run.power).words
    best = max(run.power for run in diagnosis.next_runs)
    return f"look for the cause on the bench: of the runs that were tried the best would tell in {best:.0%}"
