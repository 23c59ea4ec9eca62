"""Runs that a campaign may lack, each with its references for that bench."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.design.proposed_run import CHANGE_S, ProposedRun, Reference, Swing, peak_of
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.shafts import SIDES, PerShaft, other_side, per_shaft
from pmg.sim.signals import MINUTE, REVOLUTION, RPM

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline

SLOW = 3.0 * REVOLUTION
"""Speed up to which waves of a turn lie within the band, two and four times a turn as well [rad/s]."""

ROUND = 10.0 * RPM
"""Step of the speeds that are asked for [rad/s]."""

LOADED = 0.6
"""Part of the pull-out torque that a load asks for at most."""


@dataclass(frozen=True)
class Proposal:
    """Runs that are made together.

    Parameters
    ----------
    title : str
        What they are.
    runs : tuple of ProposedRun
        The runs.
    times : int
        How often they are made.
    """

    title: str
    runs: tuple[ProposedRun, ...]
    times: int = 1

    @property
    def minutes(self) -> float:
        """Time on the bench, with the change to each run [min]."""
        return self.times * sum(run.seconds + CHANGE_S for run in self.runs) / MINUTE

    @property
    def heading(self) -> str:
        """What to do."""
        return self.title if self.times == 1 else f"{self.title}, {self.times} times"

    @property
    def words(self) -> str:
        """The same with the references of the drives."""
        references = ". ".join(dict.fromkeys(run.words for run in self.runs if run.speed is not None))
        return f"{self.heading}: {references}" if references else self.heading


@dataclass(frozen=True)
class _Reach:
    """What a campaign reached: speeds of the shafts [rad/s], load of the ring [N m]."""

    top: PerShaft[float]
    load: PerShaft[float]
    ratio: float


def _reach(fitted: MotionBaseline) -> _Reach:
    poles, peak = fitted.sheet.poles, peak_of(fitted.sheet, fitted.values)

    def top(side: str) -> float:
        seen = [float(np.quantile(np.abs(s.shaft.speed), 0.99)) for s in fitted.stretches if s.side == side]
        fastest = max(seen, default=0.0)
        return ROUND * math.floor(fastest / ROUND) or fastest

    loads = [float(np.quantile(np.abs(s.torque), 0.9)) for s in fitted.stretches if s.coupled and s.side == "ring"]
    part = min(max(loads, default=0.0) / (poles.ring * peak), LOADED)
    load = per_shaft(lambda side: round(part * poles[side] * peak, 2))
    return _Reach(per_shaft(top), load, poles.ring / poles.sun)


def proposals(fitted: MotionBaseline, sides: tuple[str, ...]) -> Iterator[Proposal]:
    """Kinds of run that tell mechanisms on some shafts from others, the quick ones first.

    Speeds and loads are those that the campaign reached, so that the bench is known to bear them: none of a shaft that
    it did not turn, and none under load where it never was.
    """
    reach = _reach(fitted)
    zero = ProposedRun("zero", Manoeuvre.ZERO, 6.0)
    turned = [side for side in SIDES if reach.top[side] > 0.0]
    for side in [side for side in turned if side in sides] or turned:
        up, down = (_ramp(side, sign * reach.top[side]) for sign in (1.0, -1.0))
        yield Proposal(f"Ramp of the {side} in neutral", (up,))
        yield Proposal(f"Ramp of the {side} in neutral, backwards", (down,))
        yield Proposal(
            f"Slow ramp of the {side} in neutral", (_ramp(side, min(ROUND * math.ceil(SLOW / ROUND), reach.top[side])),)
        )
        yield Proposal(f"Dither of the {side} in neutral", (_dither(side, reach.top[side]),))
        yield Proposal(f"Zero check, and a ramp of the {side} in neutral both ways", (zero, up, down))
    if not all((reach.load.ring, reach.top.sun, reach.top.ring)):
        return
    fast = min(reach.top.sun, reach.ratio * reach.top.ring)
    yield Proposal("Engaged ramp", (_loaded_ramp("sun", fast, reach.load.ring),))
    yield Proposal(
        "Engaged ramp with the ring driving and the sun braking: the power flows backwards",
        (_loaded_ramp("ring", -fast / reach.ratio, -reach.load.sun),),
    )
    yield Proposal("Sweep of the load, engaged", (_sweep(0.4 * fast, reach.load.ring),))
    steps = tuple(_steps(part * fast, reach.load.ring) for part in (0.2, 0.5, 0.8))
    yield Proposal("Load steps, engaged, at three speeds", steps)


def _ramp(side: str, top: float) -> ProposedRun:
    """Up and down again."""
    speed = Reference(side, "speed", (0.0, 1.0, 14.0, 17.0, 29.0, 30.0), (0.0, 0.0, top, top, 0.0, 0.0))
    return ProposedRun(f"ramp of the {side} to {top / RPM:.0f}", Manoeuvre.RAMP, 30.0, speed)


def _dither(side: str, top: float) -> ProposedRun:
    """Slow swings through standstill, then quick ones about a speed."""
    mean = ROUND * round(0.35 * top / ROUND)
    swings = (Swing(max(0.03 * top, RPM), 0.3, 0.3, 0.0, 15.0), Swing(0.07 * top, 1.0, 4.0, 17.0, 29.0))
    speed = Reference(side, "speed", (0.0, 15.0, 17.0, 29.0, 30.0), (0.0, 0.0, mean, mean, 0.0), swings)
    return ProposedRun(f"dither of the {side}", Manoeuvre.DITHER, 30.0, speed)


def _loaded_ramp(drive: str, top: float, load: float) -> ProposedRun:
    """Up and down again under a load that comes and goes at standstill."""
    speed = Reference(drive, "speed", (0.0, 1.0, 14.0, 17.0, 29.0, 30.0), (0.0, 0.0, top, top, 0.0, 0.0))
    torque = Reference(other_side(drive), "torque", (0.0, 1.0, 29.0, 30.0), (0.0, load, load, 0.0))
    return ProposedRun(f"engaged ramp, {drive} driving", Manoeuvre.RAMP, 30.0, speed, torque)


def _sweep(speed: float, load: float) -> ProposedRun:
    """A load that swings ever faster."""
    driven = Reference("sun", "speed", (0.0, 4.0, 34.0), (0.0, speed, speed))
    swing = Swing(round(0.2 * load, 2), 0.5, 25.0, 5.0, 34.0)
    torque = Reference("ring", "torque", (0.0, 2.0, 34.0), (0.0, 0.6 * load, 0.6 * load), (swing,))
    return ProposedRun("sweep of the load", Manoeuvre.SWEEP, 34.0, driven, torque)


def _steps(speed: float, load: float) -> ProposedRun:
    """A load in steps."""
    driven = Reference("sun", "speed", (0.0, 4.0, 25.0), (0.0, speed, speed))
    levels = [0.2, 1.0, 0.4, 0.8, 0.6, 0.2]
    knots = [(0.0, 0.0), (1.0, levels[0] * load)]
    for k, (low, high) in enumerate(pairwise(levels), 1):
        knots += [(4.0 + 3.5 * k - 0.1, low * load), (4.0 + 3.5 * k, high * load)]
    torque = Reference("ring", "torque", *(tuple(each) for each in zip(*knots, (25.0, levels[-1] * load), strict=True)))
    return ProposedRun(f"load steps at {speed / RPM:.0f}", Manoeuvre.STEPS, 25.0, driven, torque)
