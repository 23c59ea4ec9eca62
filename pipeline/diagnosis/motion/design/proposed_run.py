"""A run that was not made yet: what it asks of the drives, and the signals that it would have."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import timedelta
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
from pmg.pipeline.diagnosis.motion.constants import FREE, SheetConstant, coupling_loss_name, start_name
from pmg.pipeline.diagnosis.motion.rows import RotorRows, held_beside, linear_columns, rotor_state, stretches_of
from pmg.pipeline.motion.angle_noise import AngleNoise
from pmg.pipeline.motion.quantisation import NO_ERROR
from pmg.pipeline.motion.run import MovingRun
from pmg.pipeline.motion.smooth import SmoothRun, SmoothShaft, derivative
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, PerShaft, per_shaft
from pmg.sim.signals import REVOLUTION, RPM

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.sim.signals import Array

FOLLOWS_IN = 0.1
"""Time within which a drive follows what it is asked for [s]: corners of a reference are rounded by it."""

PULL = 0.95
"""Part of the pull-out torque beyond which a load is not followed."""

LEAST_PEAK = 0.5
"""Part of the pull-out torque of the data sheet below which a fitted one is not believed for a plan."""

DAMPED = 0.1
"""Damping ratio with which the poles are taken to swing, where a load swings about their resonance."""

CHANGE_S = 15.0
"""Time between two runs [s]."""


@dataclass(frozen=True)
class Swing:
    """A swing about a reference, whose frequency goes from one to another at an even rate of octaves.

    Parameters
    ----------
    size : float
        Its amplitude, in the unit of the reference.
    first, last : float
        Frequency at its start and its end [Hz].
    start, stop : float
        When it begins and ends [s].
    """

    size: float
    first: float
    last: float
    start: float
    stop: float

    def frequency(self, time: Array) -> Array:
        """At some times (n,) [Hz]."""
        part = np.clip((time - self.start) / (self.stop - self.start), 0.0, 1.0)
        return np.asarray(self.first * (self.last / self.first) ** part)

    def course(self, time: Array) -> Array:
        """The swing at some times (n,)."""
        phase = REVOLUTION * cumulative_trapezoid(self.frequency(time), time, initial=0)
        on = (time >= self.start) & (time <= self.stop)
        begun = phase[int(np.argmax(on))]
        return np.asarray(np.where(on, self.size * np.sin(phase - begun), 0.0))


@dataclass(frozen=True)
class Reference:
    """What one drive is asked for: straight lines from knot to knot, and swings about them.

    Parameters
    ----------
    side, quantity : str
        Shaft; ``speed`` or ``torque``.
    times, values : tuple of float
        Of the knots [s]; in rad/s or N m.
    swings : tuple of Swing
        About them.
    """

    side: str
    quantity: str
    times: tuple[float, ...]
    values: tuple[float, ...]
    swings: tuple[Swing, ...] = ()

    def course(self, time: Array) -> Array:
        """What is asked for at some times (n,)."""
        swings = sum((swing.course(time) for swing in self.swings), np.zeros(len(time)))
        return np.asarray(np.interp(time, self.times, self.values) + swings)

    @property
    def words(self) -> str:
        """The reference as it is set on a bench."""
        unit, name = (RPM, "rpm") if self.quantity == "speed" else (1.0, "N m")
        digits = 0 if self.quantity == "speed" else 2
        parts = [f"{self.values[0] / unit:.{digits}f}"]
        knots = list(zip(self.times, self.values, strict=True))
        for (begin, low), (end, high) in pairwise(knots):
            to = f"held {end - begin:g} s" if low == high else f"to {high / unit:.{digits}f} in {end - begin:g} s"
            parts.append(to)
        for swing in self.swings:
            octaves = f"{swing.first:g}" if swing.first == swing.last else f"{swing.first:g} to {swing.last:g}"
            parts.append(f"± {swing.size / unit:.{digits}f} at {octaves} Hz from {swing.start:g} to {swing.stop:g} s")
        return f"{self.side} {self.quantity} [{name}] {', '.join(parts)}"


@dataclass(frozen=True)
class ProposedRun:
    """A run that a campaign lacks.

    Parameters
    ----------
    name : str
        Its own among the runs that are proposed together.
    manoeuvre : Manoeuvre
        What it does.
    seconds : float
        How long it takes [s].
    speed, load : Reference, optional
        Of the driving shaft, none of a zero check; of the other one, when engaged. What is left out is held.
    """

    name: str
    manoeuvre: Manoeuvre
    seconds: float
    speed: Reference | None = None
    load: Reference | None = None

    @property
    def configuration(self) -> Configuration:
        """Zero, neutral or engaged."""
        if self.speed is None:
            return Configuration.ZERO
        return Configuration.NEUTRAL if self.load is None else Configuration.ENGAGED

    def times(self, rate: float) -> Array:
        """Of its samples (n,) [s]."""
        return np.arange(0.0, self.seconds, 1.0 / rate)

    @property
    def words(self) -> str:
        """Its references."""
        return "; ".join(each.words for each in (self.speed, self.load) if each is not None)


def with_runs(fitted: MotionBaseline, runs: tuple[ProposedRun, ...]) -> tuple[MotionBaseline, int]:
    """A baseline with the signals of runs as it predicts them, and the place of their first stretch.

    Shafts that these runs hold have readings too, the last ones.

    Parameters
    ----------
    fitted : MotionBaseline
        Constants of the campaign beside what it names.
    runs : tuple of ProposedRun
        In the order in which they would be made, after the others.
    """
    whole, first = _with_turning(fitted, runs)
    return replace(whole, stretches=(*whole.stretches, *held_beside(whole.stretches[first:]))), first


def _with_turning(fitted: MotionBaseline, runs: tuple[ProposedRun, ...]) -> tuple[MotionBaseline, int]:
    """The same without the shafts that are held while the other one turns."""
    known = fitted.clean.stretches
    sheet, values = fitted.sheet, fitted.values
    made: list[RotorRows] = []
    for k, run in enumerate(runs):
        planned, time = _planned(run, k, known), run.times(known[0].run.fine_rate)
        if planned.coupled:
            start = SheetConstant(start_name(planned.name), "rad", 0.0, FREE)
            sums = tuple(replace(each, weights=np.r_[each.weights, 0.0]) for each in sheet.sums)
            sheet = replace(sheet, constants=(*sheet.constants, start), sums=sums)
            values = np.r_[values, _pole_angle(run, sheet, values, time)[0]]
        made += _stretches(planned, _turned(run, sheet, values, time), sheet, values, known)
    return MotionBaseline(sheet, values, (*known, *made)), len(known)


def _planned(run: ProposedRun, place: int, known: tuple[RotorRows, ...]) -> MovingRun:
    """The run without its signals."""
    last = max((stretch.run for stretch in known), key=lambda each: each.run.started_at)
    begin = timedelta(seconds=float(last.time[-1]) + CHANGE_S + place * (run.seconds + CHANGE_S))
    nothing = PerShaft(np.zeros(0), np.zeros(0))
    drive = "sun" if run.speed is None else run.speed.side
    coupled = run.load is not None
    return MovingRun(
        file=f"proposed {place}",
        point=run.name,
        configuration=run.configuration,
        gear=last.run.gear,
        drive=drive,
        manoeuvre=run.manoeuvre,
        started_at=last.run.started_at + begin,
        rate=last.run.rate,
        torque=nothing,
        angle=nothing,
        count=last.run.count,
        turns=per_shaft(lambda side: run.speed is not None and (coupled or side == drive)),
    )


def _pole_angle(run: ProposedRun, sheet: DataSheet, values: Array, time: Array) -> Array:
    r"""Angle of the poles under a load (n,) [rad].

    Notes
    -----
    A load T of a shaft with p pole pairs puts the poles at :math:`\arcsin(T/(p A))`. A swing of it is larger about the
    resonance of its inertia on the spring of the gear, :math:`\omega_0^2 = p^2 A\cos\varphi/J`, and smaller beyond.
    """
    assert run.load is not None
    poles, peak = sheet.poles[run.load.side], peak_of(sheet, values)
    course = np.interp(time, run.load.times, run.load.values)
    stiff = poles**2 * peak * np.sqrt(1.0 - min(float(np.abs(course).max()) / (poles * peak), PULL) ** 2)
    natural = np.sqrt(stiff / sheet.expected[sheet.at(f"inertia_{run.load.side}")]) / REVOLUTION
    for swing in run.load.swings:
        ratio = swing.frequency(time) / natural
        course = course + swing.course(time) / np.hypot(1.0 - ratio**2, 2.0 * DAMPED * ratio)
    smoothed = gaussian_filter1d(course, _corner(time), mode="nearest") if not run.load.swings else course
    return np.asarray(np.arcsin(np.clip(smoothed / (poles * peak), -PULL, PULL)))


def peak_of(sheet: DataSheet, values: Array) -> float:
    """Torque of the gear per pole pair when its poles are about to slip [N m]; as fitted, where that can be."""
    at = sheet.at("pull_out")
    return float(max(values[at], LEAST_PEAK * sheet.expected[at]))


def _corner(time: Array) -> float:
    """`FOLLOWS_IN` in samples."""
    return FOLLOWS_IN / float(time[1] - time[0])


def _turned(run: ProposedRun, sheet: DataSheet, values: Array, time: Array) -> PerShaft[Array]:
    """Angles of the rotors (n,) [rad]."""
    angles = {side: np.zeros(len(time)) for side in SIDES}
    if run.speed is not None:
        drive, speed = run.speed.side, gaussian_filter1d(run.speed.course(time), _corner(time), mode="nearest")
        angles[drive] = cumulative_trapezoid(speed, time, initial=0)
        if run.load is not None:
            poles, loaded = _pole_angle(run, sheet, values, time), run.load.side
            angles[loaded] = (poles - poles[0] - sheet.poles[drive] * angles[drive]) / sheet.poles[loaded]
    return per_shaft(lambda side: angles[side])


def _stretches(
    planned: MovingRun, angles: PerShaft[Array], sheet: DataSheet, values: Array, known: tuple[RotorRows, ...]
) -> tuple[RotorRows, ...]:
    """Rows of a run whose rotors stand at some angles (n,), with the torques that the constants give."""
    fine_rate, nothing = known[0].run.fine_rate, np.zeros(len(angles.sun))

    def usual(side: str, of: Callable[[SmoothShaft], float]) -> float:
        every = [of(s.shaft) for s in known if s.side == side] or [of(s.shaft) for s in known]
        return float(np.median(every))

    def shaft(side: str, torque: Array) -> SmoothShaft:
        rate = derivative(torque, fine_rate)
        give, loss = (float(values[sheet.at(name)]) for name in (f"compliance_{side}", coupling_loss_name(side)))
        shown = angles[side] + give * torque - loss * rate
        speed = derivative(shown, fine_rate)
        return SmoothShaft(
            torque=torque,
            torque_rate=rate,
            torque_curvature=derivative(rate, fine_rate),
            angle=shown,
            speed=speed,
            acceleration=derivative(speed, fine_rate),
            density=usual(side, lambda shaft: shaft.density),
            angle_noise=AngleNoise(
                usual(side, lambda shaft: shaft.angle_noise.density),
                usual(side, lambda shaft: shaft.angle_noise.value_density),
                NO_ERROR,
            ),
        )

    def made(torques: dict[str, Array]) -> tuple[RotorRows, ...]:
        shafts, time = per_shaft(lambda side: shaft(side, torques[side])), np.arange(len(nothing)) / fine_rate
        found = SmoothRun(planned, time, fine_rate, shafts, PerShaft(time, time))
        return stretches_of((replace(found, measured=per_shaft(lambda side: found.rows(torques[side]))),))

    torques = dict.fromkeys(SIDES, nothing)
    for stretch in made(torques):
        columns = linear_columns(rotor_state(stretch, sheet, values))
        torques[stretch.side] = np.asarray(sum(values[sheet.at(name)] * each for name, each in columns.items()))
    return made(torques)
