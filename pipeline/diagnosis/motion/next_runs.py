"""The run that a campaign in motion lacks, and that would tell causes apart which fit equally well."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, other_side
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.motion.smooth import SmoothRun

RUN = 0.75
"""Minutes of one run, with the change to it."""

REPEATS = 4
"""Runs of a kind that the campaign holds already, which halve what noise hides."""

BACKWARDS = -5.0
"""Speed below which a shaft ran backwards [rad/s]."""

SLOW = 3.0 * REVOLUTION
"""Speed up to which waves of a turn lie within the band, two and four times a turn as well [rad/s]."""

OF_LAG = frozenset({"transducer_bandwidth", "channel_delay", "coupling_compliance", "coupling_backlash"})
OF_REVERSAL = frozenset({"presliding_friction", "stribeck_mixed_lubrication"})
OF_SPRING = frozenset({"pull_out_torque", "torque_map_harmonic", "gear_hysteresis"})
OF_LOAD = frozenset({"torque_gain_error", "load_dependent_bearing_friction", "load_dependent_iron_loss"})
OF_TIME = frozenset({"torque_zero_drift", "magnet_temperature", "lubricant_viscosity"})
OF_TURN = frozenset({"shaft_unbalance", "coupling_misalignment", "encoder_eccentricity", "cogging"})
"""Mechanisms by what tells them from others."""


@dataclass(frozen=True)
class NextRun:
    """A run that would tell mechanisms apart.

    Parameters
    ----------
    description : str
        What to do on the bench.
    minutes : float
        How long it takes.
    separates : tuple of str
        Mechanisms that it tells apart, by id.
    """

    description: str
    minutes: float
    separates: tuple[str, ...]


@dataclass(frozen=True)
class _Kind:
    """A kind of run: what to do, which mechanisms it tells from others, whether a campaign's run is of it."""

    description: str
    tells: frozenset[str]
    is_it: Callable[[SmoothRun], bool]
    count: int = 1


def next_runs(diagnosis: MotionDiagnosis) -> tuple[NextRun, ...]:
    """The run for each rival that would tell it from the first; for a shaft left open, the run that would tell it.

    Where nothing differs, the run for each mechanism that the campaign cannot see.
    """
    naming = diagnosis.naming
    if diagnosis.verdict is Verdict.CONFOUNDED:
        lacking = [_telling(diagnosis, {each.term.identifier}, (each.term.shaft,)) for each in diagnosis.unseen]
        return tuple({run.description: run for run in lacking}.values())
    if naming is None or not diagnosis.verdict.names:
        return ()
    sides = tuple(side for side in SIDES if any(fit.place in (side, "both") for fit in naming.best.fits))
    found = [_telling(diagnosis, naming.best.ids ^ rival.ids, sides or SIDES) for rival in naming.rivals]
    found += [_telling(diagnosis, {name}, SIDES) for name, shaft in naming.shafts.items() if shaft == "either"]
    return tuple({run.description: run for run in found}.values())


def separating_run(diagnosis: MotionDiagnosis, place: int) -> str:
    """What to do to tell a rival, the one in a place among them, from the first."""
    naming = diagnosis.naming
    assert naming is not None  # a rival is one to something
    rival = naming.rivals[place]
    sides = tuple(side for side in SIDES if any(fit.place in (side, "both") for fit in naming.best.fits))
    return _telling(diagnosis, naming.best.ids ^ rival.ids, sides or SIDES).description


def _telling(diagnosis: MotionDiagnosis, ids: frozenset[str] | set[str], sides: tuple[str, ...]) -> NextRun:
    """The first kind of run that tells one of some mechanisms from others and is lacking; else more of the first."""
    runs = tuple({s.run.run.name: s.run for s in diagnosis.before.stretches}.values())
    kinds = [kind for kind in _kinds(sides) if kind.tells & ids] or list(_kinds(sides))
    named = tuple(sorted(ids))
    for kind in kinds:
        if sum(kind.is_it(run) for run in runs) < kind.count:
            return NextRun(kind.description, RUN * kind.count, named)
    first = kinds[0].description
    again = f"{first[0].lower()}{first[1:]}"
    return NextRun(f"Repeat {REPEATS} times: {again}", RUN * kinds[0].count * REPEATS, named)


def _kinds(sides: tuple[str, ...]) -> Iterator[_Kind]:
    """Kinds of run for mechanisms on some shafts, those that tell most first."""
    yield _Kind(
        "Engaged ramp with the ring driving and the sun braking: the power flows backwards",
        OF_LOAD,
        lambda run: run.run.coupled and run.run.drive == "ring",
    )
    for side in sides:
        yield _Kind(
            f"Dither of the {side} in neutral: slow swings through standstill, then quick ones about a speed",
            OF_LAG | OF_REVERSAL | {"rotor_inertia"},
            lambda run, side=side: _alone(run, side) and run.run.manoeuvre is Manoeuvre.DITHER,  # type: ignore[misc]
        )
        yield _Kind(
            f"Slow ramp of the {side} in neutral, to a speed of three turns a second",
            OF_TURN,
            lambda run, side=side: _alone(run, side) and _slow(run, side),  # type: ignore[misc]
        )
        yield _Kind(
            f"Ramp of the {side} in neutral, backwards",
            frozenset({"direction_dependent_friction"}),
            lambda run, side=side: _alone(run, side) and _backwards(run, side),  # type: ignore[misc]
        )
    yield _Kind("Sweep of the load, engaged", OF_LAG | OF_SPRING, _engaged(Manoeuvre.SWEEP))
    yield _Kind("Load steps, engaged, at three speeds", OF_SPRING | OF_LOAD, _engaged(Manoeuvre.STEPS), 3)
    yield _Kind(
        "Zero checks at the start, in the middle and at the end of the campaign",
        OF_TIME | {"torque_zero_offset"},
        lambda run: run.run.manoeuvre is Manoeuvre.ZERO,
        3,
    )


def _engaged(manoeuvre: Manoeuvre) -> Callable[[SmoothRun], bool]:
    return lambda run: run.run.coupled and run.run.manoeuvre is manoeuvre


def _alone(run: SmoothRun, side: str) -> bool:
    """Whether that shaft alone turns in neutral."""
    neutral = run.run.configuration is Configuration.NEUTRAL
    return neutral and run.run.turns[side] and not run.run.turns[other_side(side)]


def _slow(run: SmoothRun, side: str) -> bool:
    """Whether a shaft stays slow enough for the waves of its turns to be seen."""
    return run.run.manoeuvre is Manoeuvre.RAMP and float(np.abs(run.shafts[side].speed).max()) < 1.5 * SLOW


def _backwards(run: SmoothRun, side: str) -> bool:
    """Whether a shaft runs backwards for a good part of a ramp."""
    ramp = run.run.manoeuvre in (Manoeuvre.RAMP, Manoeuvre.COAST)
    return ramp and float(np.quantile(run.shafts[side].speed, 0.25)) < BACKWARDS
