"""What a set of runs in motion permits: inertias, loss curves, stiffness, and the run that would tell more."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from pmg.pipeline.preflight.abilities import IN_PART, NO, YES, Ability
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.pipeline.wording.plurals import counted
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, other_side

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.motion.stored import JudgedRun

NOUNS = {
    Manoeuvre.RAMP: "ramp",
    Manoeuvre.COAST: "coast-down",
    Manoeuvre.STEPS: "load-step run",
    Manoeuvre.SWEEP: "sweep",
    Manoeuvre.DITHER: "dither",
}
SLOWEST = 2.0
"""Acceleration [rad/s^2] below which a ramp cannot tell inertia from drag: 2 mN m of a rotor's 1e-3 kg m^2."""
EVEN = 0.2
"""Part of the largest change of speed that one to the other side must have to count."""
CROSSING = 1.0
"""Speed [rad/s] to both sides of rest that a reversal has."""


def motion_summary(runs: Sequence[JudgedRun]) -> tuple[str, ...]:
    """Manoeuvres of a set of runs by configuration and turning shafts, a line each."""
    groups: dict[str, list[JudgedRun]] = {}
    for run in runs:
        if run.record.sound:
            groups.setdefault(_where(run), []).append(run)
    lines = [f"{where}: {_named(group)}" for where, group in groups.items()]
    aside = [run.record.point for run in runs if not run.record.sound]
    return (*sorted(lines), *([f"set aside: {', '.join(aside)}"] if aside else []))


def _where(run: JudgedRun) -> str:
    if run.configuration is Configuration.ENGAGED:
        return f"engaged, {run.drive} drives"
    return f"{run.configuration}, {' and '.join(side for side in SIDES if run.record.turns[side])} turning"


def motion_abilities(runs: Sequence[JudgedRun]) -> tuple[Ability, ...]:
    """What a set of runs in motion permits, why not, and the run that would unlock it.

    Parameters
    ----------
    runs : sequence of JudgedRun
        Of one campaign; those that are set aside do not count.
    """
    sound = [run for run in runs if run.record.sound]
    engaged = [run for run in sound if run.configuration is Configuration.ENGAGED]
    neutral = [run for run in sound if run.configuration is Configuration.NEUTRAL]
    alone = {
        side: [r for r in neutral if r.record.turns[side] and not r.record.turns[other_side(side)]] for side in SIDES
    }
    found = [make(side, alone[side]) for make in (_rotor_inertia, _motor_inertia, _loss_curve) for side in SIDES]
    return (*found, _magnetic_spring(engaged), _frequency_response(sound), *_reversal(alone), _proof(sound))


def _of(runs: Sequence[JudgedRun], *kinds: Manoeuvre) -> list[JudgedRun]:
    return [run for run in runs if run.manoeuvre in kinds]


def _named(runs: Sequence[JudgedRun]) -> str:
    """Runs by kind, as in ``3 ramps, 1 dither``."""
    kinds = Counter(run.manoeuvre for run in runs)
    return ", ".join(counted(kinds[kind], noun) for kind, noun in NOUNS.items() if kinds[kind])


def _rotor_inertia(side: str, runs: Sequence[JudgedRun]) -> Ability:
    chapter = f"inertia of the {side} rotor"
    telling = _of(runs, Manoeuvre.RAMP, Manoeuvre.COAST, Manoeuvre.DITHER)
    unlock = f"a dither of the {side} in neutral, or a ramp up and down faster than {SLOWEST:g} rad/s^2"
    if not telling:
        return Ability(chapter, NO, f"the {side} alone never changes its speed in neutral", unlock)
    changes = [run.record.acceleration[side] for run in telling]
    fastest = max(max(-change.lowest, change.highest) for change in changes)
    if fastest < SLOWEST:
        why = f"the speed changes by at most {fastest:.1f} rad/s^2: inertia looks like drag"
        return Ability(chapter, IN_PART, why, unlock)
    rises, falls = max(change.highest for change in changes), -min(change.lowest for change in changes)
    if min(rises, falls) < EVEN * max(rises, falls):
        way = "rises" if rises > falls else "falls"
        return Ability(chapter, IN_PART, f"the speed only {way}: inertia looks like drag", unlock)
    return Ability(chapter, YES, _named(telling))


def _motor_inertia(side: str, runs: Sequence[JudgedRun]) -> Ability:
    chapter = f"inertia of the {side} motor"
    coasts = _of(runs, Manoeuvre.COAST)
    if coasts:
        return Ability(chapter, YES, _named(coasts))
    why = "no coast-down: the transducer is behind the motor, whose inertia rests on its data sheet"
    return Ability(chapter, NO, why, f"a coast-down of the {side} with its motor off")


def _loss_curve(side: str, runs: Sequence[JudgedRun]) -> Ability:
    chapter = f"loss curve of the {side}"
    ramps = _of(runs, Manoeuvre.RAMP, Manoeuvre.COAST)
    if not ramps:
        return Ability(chapter, NO, f"no ramp of the {side} alone", f"ramps of the {side} in both directions")
    speeds = [run.record.speed[side] for run in ramps]
    forward, backward = max(speed.highest for speed in speeds), -min(speed.lowest for speed in speeds)
    if min(forward, backward) < EVEN * max(forward, backward):
        way, other = ("forward", "backward") if forward > backward else ("backward", "forward")
        why = f"{_named(ramps)}, {way} only: drag that depends on the direction cannot be seen"
        return Ability(chapter, IN_PART, why, f"a ramp of the {side} {other}")
    return Ability(chapter, YES, f"{_named(ramps)}, in both directions")


def _magnetic_spring(engaged: Sequence[JudgedRun]) -> Ability:
    chapter = "stiffness, pull-out, damping"
    telling = _of(engaged, Manoeuvre.STEPS, Manoeuvre.SWEEP)
    if telling:
        return Ability(chapter, YES, _named(telling))
    if engaged:
        why = f"{_named(engaged)}: the pole angle follows the load, its resonance is not excited"
        return Ability(chapter, IN_PART, why, "load steps or a sweep, engaged")
    return Ability(chapter, NO, "no engaged run", "load steps or a sweep, engaged")


def _frequency_response(runs: Sequence[JudgedRun]) -> Ability:
    telling = _of(runs, Manoeuvre.SWEEP, Manoeuvre.DITHER)
    if telling:
        return Ability("frequency response", YES, _named(telling))
    why = "nothing excites a band of frequencies: lags, delays and soft couplings look alike"
    return Ability("frequency response", NO, why, "a sweep, engaged, or a dither in neutral")


def _reversal(alone: dict[str, list[JudgedRun]]) -> Iterator[Ability]:
    for side in SIDES:
        speeds = [run.record.speed[side] for run in alone[side]]
        reversing = sum(speed.lowest < -CROSSING and speed.highest > CROSSING for speed in speeds)
        if reversing:
            yield Ability(f"{side} friction at reversal", YES, f"{counted(reversing, 'run')} through rest")
        else:
            why, unlock = f"no run of the {side} alone reverses", f"a dither of the {side} about rest"
            yield Ability(f"{side} friction at reversal", NO, why, unlock)


def _proof(runs: Sequence[JudgedRun]) -> Ability:
    """The proof on a run that was not fitted: of another kind than those that were."""
    chapter, kinds = "proof on another kind of run", {run.manoeuvre for run in runs}
    if len(kinds) > 1:
        return Ability(chapter, YES, _named(runs))
    why = f"{_named(runs)}: all of one kind" if runs else "no run can be used"
    return Ability(chapter, NO, why, "a run of another manoeuvre")
