"""What laws at an instant are functions of: the state of a rotor, its load, its history."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pmg.pipeline.diagnosis.motion.constants import DRAG_POWERS, SKEW, drag_names
from pmg.pipeline.motion.smooth import BAND, fine_response
from pmg.sim.shafts import SIDES, other_side
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.rows import RotorState
    from pmg.pipeline.motion.smooth import SmoothRun, SmoothShaft
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array

SLOW_ENOUGH, TOO_FAST = 1.4, 1.8
"""Frequency of a wave over the band of the rows from which on it fades, and at which nothing of it is left: their
low-pass takes it out by then, and a column that is zero costs nothing."""

EVERY = 3
"""Fine samples from step to step of what depends on the way that an angle went."""


@dataclass(frozen=True)
class History:
    """What went before in a campaign: heat that its bearings took up, run after run.

    Parameters
    ----------
    baseline : MotionBaseline
        Whose drag heats them.
    runs : tuple of SmoothRun
        In the order in which they were run.
    """

    baseline: MotionBaseline
    runs: tuple[SmoothRun, ...]

    @cached_property
    def began(self) -> float:
        """Start of the campaign [s since 1970]."""
        return min(run.run.started_at.timestamp() for run in self.runs)

    @cached_property
    def length(self) -> float:
        """Time from its start to the end of its last run [s]."""
        return max(run.run.started_at.timestamp() + float(run.time[-1]) for run in self.runs) - self.began

    def drag(self, side: str, speed: Array) -> Array:
        """Magnitude of a rotor's fitted drag at a speed [N m], neutral."""
        values = [float(self.baseline.values[self.baseline.sheet.at(n)]) for n in drag_names(side)[: len(DRAG_POWERS)]]
        share = np.abs(speed) / 100.0
        return np.asarray(sum(v * share**p for v, p in zip(values, DRAG_POWERS, strict=True)))

    def warmth(self, side: str, settles: float) -> dict[str, Array]:
        """Warmth of a rotor's bearings at the fine samples of each run by file, 1 after long rest at its largest loss.

        `settles` is the time constant [s]; the bearings cool as they warm.
        """
        known = self._warmth.get((side, settles))
        if known is not None:
            return known
        found: dict[str, Array] = {}
        now, last = 0.0, 0.0
        for run in sorted(self.runs, key=lambda run: run.run.started_at):
            begins = run.run.started_at.timestamp() - self.began
            now *= float(np.exp(-max(begins - last, 0.0) / settles))
            speed = run.shafts[side].speed if run.run.turns[side] else np.zeros_like(run.time)
            power = np.abs(self.drag(side, speed) * speed) / self._largest(side)
            kept = float(np.exp(-1.0 / run.fine_rate / settles))
            found[run.run.name], _ = lfilter([1.0 - kept], [1.0, -kept], power, zi=[kept * now])
            now, last = float(found[run.run.name][-1]), begins + float(run.time[-1])
        self._warmth[side, settles] = found
        return found

    def largest(self, quantity: Callable[[PerShaft[SmoothShaft]], Array]) -> float:
        """Largest magnitude of what a function makes of the signals of both shafts, over all runs."""
        return max(float(np.abs(quantity(run.shafts)).max()) for run in self.runs)

    def of_way(self, run: str, over: float, law: Callable[[Array, float], Array], angle: Array) -> Array:
        """What a law makes of the way that an angle of a run went; worked out once."""
        key = (run, over, law.__name__)
        if key not in self._ways:
            self._ways[key] = law(angle, over)
        return self._ways[key]

    @cached_property
    def _ways(self) -> dict[tuple[str, float, str], Array]:
        """What was worked out already."""
        return {}

    @cached_property
    def _warmth(self) -> dict[tuple[str, float], dict[str, Array]]:
        """What was worked out already."""
        return {}

    def _largest(self, side: str) -> float:
        speed = self.largest(lambda shafts: shafts[side].speed)
        return float(max(abs(float(self.drag(side, np.array([speed]))[0])) * speed, 1e-12))


@dataclass(frozen=True)
class RotorView:
    """A rotor in a run as laws see it, at the n fine samples.

    Parameters
    ----------
    state : RotorState
        Its speed and acceleration, and the angle of the poles.
    history : History
        Of the campaign, with its fitted baseline.
    """

    state: RotorState
    history: History

    @property
    def side(self) -> str:
        """The shaft."""
        return self.state.stretch.side

    @property
    def shaft(self) -> SmoothShaft:
        """Its signals."""
        return self.state.stretch.shaft

    def shaft_of(self, side: str) -> SmoothShaft:
        """Signals of a shaft of the same run."""
        return self.state.stretch.run.shafts[side]

    @property
    def other(self) -> SmoothShaft:
        """Signals of the opposite shaft."""
        return self.shaft_of(other_side(self.side))

    @property
    def coupled(self) -> bool:
        """Whether the gear couples the rotors."""
        return self.state.stretch.coupled

    @property
    def at_rest(self) -> bool:
        """Whether the shaft rests."""
        return self.state.stretch.at_rest

    @property
    def held(self) -> bool:
        """Whether it rests while the other shaft turns."""
        return self.state.stretch.held

    @property
    def speed(self) -> Array:
        """Of the rotor [rad/s]."""
        return self.state.speed

    @property
    def direction(self) -> Array:
        """Sense of rotation."""
        return self.state.direction

    def constant(self, name: str) -> float:
        """A fitted constant of the baseline."""
        return self.state.value(name)

    @property
    def skew(self) -> float:
        """Time by which the torque of the shaft comes after its angle [s]; no more than a sample may explain."""
        return float(np.clip(self.constant(f"skew_{self.side}"), -SKEW, SKEW))

    @property
    def pairs(self) -> int:
        """Pole pairs of the rotor."""
        return self.history.baseline.sheet.poles[self.side]

    @cached_property
    def relative(self) -> Array:
        """Speed of the sun less that of the ring [rad/s]."""
        shafts = self.state.stretch.run.shafts
        return np.asarray(shafts.sun.speed - shafts.ring.speed)

    @cached_property
    def slip(self) -> Array:
        """Speed at which the poles pass each other [rad/s], in neutral too."""
        if self.coupled:
            return self.state.slip
        poles, shafts = self.history.baseline.sheet.poles, self.state.stretch.run.shafts
        return np.asarray(sum(poles[side] * shafts[side].speed for side in SIDES))

    @cached_property
    def load(self) -> Array:
        """Torque of the gear on the rotor [N m]; zero in neutral."""
        if not self.coupled:
            return np.zeros_like(self.speed)
        return np.asarray(self.pairs * self.constant("pull_out") * np.sin(self.state.pole_angle))

    @cached_property
    def slow_angle(self) -> Array:
        """Angle of the shaft in the band of the rows [rad]: what follows its way follows its noise, too."""
        return self.state.stretch.run.in_band(self.shaft.angle)

    def of_poles(self, over: float, law: Callable[[Array, float], Array]) -> Array:
        """What a law makes of the way that the pole angle went, in the band of the rows."""
        return self.history.of_way(self.state.stretch.run.run.name, over, law, self.state.slow_pole_angle)

    @cached_property
    def drag(self) -> Array:
        """Magnitude of the fitted drag of its bearings [N m]."""
        return self.history.drag(self.side, self.speed)

    @property
    def campaign_time(self) -> Array:
        """Since the campaign began [s]."""
        run = self.state.stretch.run
        return np.asarray(run.run.started_at.timestamp() - self.history.began + run.time)

    def wave(self, side: str, order: int) -> Array:
        """Cosine and sine of an order of a shaft's turn (n, 2), less where they are too fast for the rows; kept."""
        if (side, order) not in self._waves:
            shaft = self.shaft_of(side)
            frequency = order * np.abs(shaft.speed) / REVOLUTION
            held = fine_response(self.state.stretch.run.run.rate, frequency)
            held *= np.interp(frequency, (SLOW_ENOUGH * BAND, TOO_FAST * BAND), (1.0, 0.0))
            self._waves[side, order] = held[:, None] * np.stack([w(order * shaft.angle) for w in (np.cos, np.sin)], 1)
        return self._waves[side, order]

    @cached_property
    def _waves(self) -> dict[tuple[str, int], Array]:
        """What was worked out already."""
        return {}

    def warmth(self, settles: float) -> Array:
        """Of its bearings, 1 at most."""
        return self.history.warmth(self.side, settles)[self.state.stretch.run.run.name]


def waves_of(view: RotorView, side: str, orders: tuple[int, ...]) -> Array:
    """Waves of a turn of a shaft (n, 2 k), as far as the rows hold them at its speed."""
    return np.hstack([view.wave(side, order) for order in orders])


def views_of(baseline: MotionBaseline) -> list[RotorView]:
    """Every stretch of a baseline as laws see it, with one history: what it worked out serves them all."""
    history = History(baseline, tuple({s.run.run.name: s.run for s in baseline.stretches}.values()))
    return [RotorView(state, history) for state in baseline.states]


def lagging(angle: Array, over: float) -> Array:
    r"""Friction of a bristle, 1 at most (n,): it follows an angle [rad] and slips beyond `over` [rad].

    Notes
    -----
    Dahl's solid friction with exponent 1, :math:`dz/d\theta = (1 - z\,\mathrm{sgn}(d\theta))/\theta_c`, exact for each
    step: :math:`z_k = m_k z_{k-1} + c_k`. It does not depend on the rate. Steps are joined two by two, then four by
    four, as each joined step has the same form.
    """
    steps = np.diff(angle[::EVERY], prepend=angle[0]) / over
    kept = np.exp(-np.abs(steps))
    found = np.sign(steps) * (1.0 - kept)
    reach = 1
    while reach < len(steps):
        found[reach:] += kept[reach:] * found[:-reach]
        kept[reach:] *= kept[:-reach].copy()
        reach *= 2
    return _between(found, len(angle))


def stopping(angle: Array, over: float) -> Array:
    r"""The same of a spring that gives way at once (n,): it follows an angle [rad] up to `over` [rad].

    Notes
    -----
    Prandtl's stop operator, :math:`z_k = \max(-1, \min(1, z_{k-1} + \Delta\theta_k/\theta_c))`. Joined steps are of the
    form :math:`\max(a, \min(b, z + s))` again.
    """
    moved = np.diff(angle[::EVERY], prepend=angle[0]) / over
    least, most = np.full(len(moved), -1.0), np.ones(len(moved))
    reach = 1
    while reach < len(moved):
        low, high, by = least[reach:], most[reach:], moved[reach:]
        before = np.minimum(least[:-reach] + by, high), np.minimum(most[:-reach] + by, high), moved[:-reach] + by
        least[reach:], most[reach:], moved[reach:] = np.maximum(before[0], low), np.maximum(before[1], low), before[2]
        reach *= 2
    return _between(np.maximum(least, np.minimum(most, moved)), len(angle))


def _between(found: Array, length: int) -> Array:
    return np.interp(np.arange(length), np.arange(0, length, EVERY), found)
