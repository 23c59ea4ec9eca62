"""Size of an effect in units of the noise, before and after a baseline has absorbed its part.

What an effect leaves missing in the balances of the rotors is weighted by the noise. Its norm is the deflection: the
signal-to-noise ratio of an observer who knew its course. A size of one sigma is the deflection of one standard
uncertainty at each of as many independent points as there are stretches of `POINT` in the campaign, so that sizes
compare with those of a campaign of steady points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.motion.balance import CourseBalance, Spectrum
from pmg.pipeline.trials.motion.machine import SyntheticMachine
from pmg.sim.shafts import SIDES, PerShaft, per_shaft

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.trials.motion.bench import MovingBench
    from pmg.pipeline.trials.motion.effect import MotionEffect
    from pmg.pipeline.trials.motion.machine import BenchCourse
    from pmg.pipeline.trials.motion.programme import MotionCampaign

POINT = 2.5
"""Stretch of motion that counts as one point [s]: a campaign then has as many as a campaign of steady points."""
HALVINGS = 30
"""Halvings of a size at most."""
CORRECTIONS = 6
"""Corrections of a size at most."""
NEAR = 0.05
"""Relative error of a size that is left."""


@dataclass(frozen=True)
class Scene:
    """A bench, the runs it makes, and the angles at which they begin."""

    bench: MovingBench
    campaign: MotionCampaign
    begun: tuple[PerShaft[float], ...]

    def machine(self, effects: Sequence[MotionEffect] = ()) -> SyntheticMachine:
        """The bench with effects."""
        machine = SyntheticMachine(self.bench, self.campaign)
        for effect in effects:
            if effect.size > 0.0:
                effect.form.act(machine, effect)
        return machine

    def courses(self, effects: Sequence[MotionEffect] = ()) -> list[BenchCourse]:
        """Every run without noise."""
        machine = self.machine(effects)
        return [machine.follow(run, begun) for run, begun in zip(self.campaign.runs, self.begun, strict=True)]

    @property
    def once(self) -> Scene:
        """The same without repeated runs; times in the campaign stay."""
        kept = [i for i, run in enumerate(self.campaign.runs) if not run.point.endswith("_rep")]
        runs = tuple(self.campaign.runs[i] for i in kept)
        return replace(self, campaign=replace(self.campaign, runs=runs), begun=tuple(self.begun[i] for i in kept))


@dataclass(frozen=True)
class EffectSize:
    """What an effect changes.

    Parameters
    ----------
    raw : float
        Before absorption [sigma].
    absorbed : float
        What is left after it [sigma].
    rms : PerShaft of float
        Root mean square of what the torque readings change by [N m].
    """

    raw: float
    absorbed: float
    rms: PerShaft[float]


@dataclass(frozen=True)
class MotionYardstick:
    """Sizes of effects in a scene."""

    scene: Scene

    @cached_property
    def bare(self) -> list[BenchCourse]:
        """The runs without any effect."""
        return self.scene.courses()

    @cached_property
    def missing(self) -> list[Spectrum]:
        """What is missing without any effect: errors of the arithmetic."""
        balances = [CourseBalance(self.scene.bench, course) for course in self.bare]
        return [balance.spectra([balance.missing()])[0] for balance in balances]

    def measure(self, courses: Sequence[BenchCourse]) -> EffectSize:
        """Size of what differs in courses of the same runs; a baseline moves in the motion that they have."""
        names: dict[str, float] = {}
        parts = []
        total = seconds = 0.0
        for course, before in zip(courses, self.missing, strict=True):
            balance = CourseBalance(self.scene.bench, course)
            columns = list(balance.columns())
            names |= {name: tolerance for name, tolerance, _ in columns}
            change, *stack = balance.spectra([balance.missing(), *(torques for _, _, torques in columns)])
            change -= before
            total += float(np.vdot(change, change).real)
            seconds += balance.seconds
            parts.append(([name for name, _, _ in columns], np.array(stack), change))
        place = {name: i for i, name in enumerate(names)}
        inner, outer = np.diag([tolerance**-2.0 for tolerance in names.values()]), np.zeros(len(names))
        for listed, columns_over_noise, change in parts:
            rows = [place[name] for name in listed]
            inner[np.ix_(rows, rows)] += (columns_over_noise.conj() @ columns_over_noise.T).real
            outer[rows] += (columns_over_noise.conj() @ change).real
        scale = 1.0 / np.sqrt(np.diag(inner))
        moved = np.linalg.lstsq(inner * np.outer(scale, scale), outer * scale, rcond=1e-12)[0]
        left = max(total - float(moved @ (outer * scale)), 0.0)
        points = seconds / POINT
        return EffectSize(float(np.sqrt(total / points)), float(np.sqrt(left / points)), self._rms(courses))

    def _rms(self, courses: Sequence[BenchCourse]) -> PerShaft[float]:
        def of(side: str) -> float:
            changes = [
                after.torque[side] - before.torque[side] for after, before in zip(courses, self.bare, strict=True)
            ]
            return float(np.sqrt(np.mean(np.concatenate(changes) ** 2)))

        return per_shaft(of)


@dataclass(frozen=True)
class SizedEffect:
    """An effect with the size that it has; smaller than asked for [sigma] when no bench could have more."""

    effect: MotionEffect
    asked: float
    reached: EffectSize


def _run(scene: Scene, effect: MotionEffect) -> tuple[MotionEffect, list[BenchCourse]]:
    """An effect and the runs with it; halved where a drive cannot hold a shaft with it, and the runs end nowhere."""
    for _ in range(HALVINGS):
        courses = scene.courses([effect])
        if all(np.isfinite(course.torque[side]).all() for course in courses for side in SIDES):
            return effect, courses
        effect = replace(effect, size=0.5 * effect.size)
    raise ValueError("a drawn bench whose runs end nowhere")


def scale_to(yardstick: MotionYardstick, effect: MotionEffect, asked: float) -> SizedEffect:
    """The effect at that size after absorption [sigma], or as large as a bench could have it."""
    if asked == 0.0:
        return SizedEffect(replace(effect, size=0.0), asked, EffectSize(0.0, 0.0, PerShaft(0.0, 0.0)))
    scene, power = yardstick.scene, 1.0
    last: tuple[float, float] | None = None
    for left in reversed(range(CORRECTIONS)):
        effect, courses = _run(scene, effect)
        size = yardstick.measure(courses)
        reached = size.absorbed
        at_end = reached < asked and effect.size >= effect.form.most
        if not left or at_end or abs(reached - asked) <= NEAR * asked:
            break
        if last is not None and effect.size != last[0] and min(reached, last[1]) > 0.0:
            slope = np.log(reached / last[1]) / np.log(effect.size / last[0])
            power = float(np.clip(slope, 0.4, 3.0))
        last = effect.size, reached
        factor = float(np.clip((asked / max(reached, 1e-9)) ** (1.0 / power), 0.02, 50.0))
        effect = replace(effect, size=min(effect.size * factor, effect.form.most))
    return SizedEffect(effect, asked, size)
