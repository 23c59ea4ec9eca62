"""Rows of evidence: one shaft of one run after the other, and the state of its rotor at each row."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import binary_opening

from pmg.pipeline.diagnosis.motion.constants import (
    MAP_WAVES,
    RIPPLE,
    SLIP_PASSAGE,
    SPEED_UNIT,
    coupling_loss_name,
    eccentricity_names,
    map_name,
    ripple_names,
    start_name,
)
from pmg.pipeline.diagnosis.motion.gear_torque import gear_columns
from pmg.pipeline.diagnosis.motion.loss_curve import REST, drag_columns, engaged_drag_columns
from pmg.pipeline.motion.smooth import derivative
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.shafts import SIDES, PerShaft, other_side, per_shaft

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.pipeline.motion.lag import Lag
    from pmg.pipeline.motion.smooth import SmoothRun, SmoothShaft
    from pmg.sim.signals import Array, Mask

STANDSTILL, CREEPING_COUNTS, STANDING = 0.2, 160.0, 0.15
"""Speed [rad/s], and counts a second, below which a shaft stands or creeps, and time [s] from which on its rows are
left out: what holds it is then as large as it needs to be, and its encoder shows steps one by one. A reversal passes
through it sooner."""

SLOPE_STEP = 0.05
"""Step of a speed [rad/s] over which the change of drag with it is taken."""


@dataclass(frozen=True)
class RotorRows:
    """Rows of one shaft in one run that say something of its rotor.

    Parameters
    ----------
    run : SmoothRun
        The run.
    side : str
        The shaft.
    rows : (m,) array of bool
        Which r of the run's rows: those in which the shaft turns; all where it rests.
    """

    run: SmoothRun
    side: str
    rows: Mask

    def __len__(self) -> int:
        """Count of rows."""
        return int(self.rows.sum())

    @property
    def at_rest(self) -> bool:
        """Whether the shaft rests, so that its transducer shows its zero: in a zero run, or held."""
        return self.run.run.manoeuvre is Manoeuvre.ZERO or self.held

    @property
    def held(self) -> bool:
        """Whether its drive holds it in neutral while the other shaft turns."""
        turns = self.run.run.turns
        return not self.coupled and turns[other_side(self.side)] and not turns[self.side]

    @property
    def coupled(self) -> bool:
        """Whether the gear couples the rotor with the other one."""
        return self.run.run.coupled

    @property
    def shaft(self) -> SmoothShaft:
        """Signals of the shaft, at the fine samples of the run."""
        return self.run.shafts[self.side]

    @property
    def torque(self) -> Array:
        """Torque as measured [N m], (r,)."""
        return self.run.measured[self.side][self.rows]

    def of_rows(self, fine: Array) -> Array:
        """Rows (r,) or (r, k) of a quantity at the fine samples."""
        return self.run.rows(fine)[self.rows]


def stretches_of(runs: tuple[SmoothRun, ...]) -> tuple[RotorRows, ...]:
    """The stretches of some runs: shafts that turn, and both of a zero run; a held shaft shows a static reaction."""
    found = []
    for run in runs:
        for side, shaft in run.shafts.items():
            known = np.isfinite(run.measured[side])
            if run.run.manoeuvre is Manoeuvre.ZERO:
                rows = known
            elif run.run.turns[side]:
                least = max(STANDSTILL, CREEPING_COUNTS * run.run.count[side])
                rows = known & ~_standing(run.rows(shaft.speed), least, run.row_rate)
            else:
                continue
            if rows.sum() > 1:
                found.append(RotorRows(run, side, rows))
    return tuple(found)


def held_beside(stretches: tuple[RotorRows, ...]) -> tuple[RotorRows, ...]:
    """Readings of the shafts that are held while those of some stretches turn.

    No torque of its own moves such a reading: what follows the torque of the other shaft is crosstalk, and what follows
    its speed comes over the gear or the bearing between the shafts.
    """
    readings = (RotorRows(each.run, other_side(each.side), each.rows) for each in stretches)
    known = ((each, np.isfinite(each.run.measured[each.side])) for each in readings if each.held)
    return tuple(replace(each, rows=rows) for each, rows in known if rows.sum() > 1)


def _standing(speed: Array, creeping: float, rate: float) -> Mask:
    """Rows (r,) at which a shaft is slower than a speed [rad/s], and is so for more than an instant."""
    still = np.abs(speed) < creeping
    least = max(round(STANDING * rate), 1)
    return np.asarray(binary_opening(still, np.ones(2 * (least // 2) + 1, dtype=np.bool_)))


@dataclass(frozen=True)
class RotorState:
    """State of the rotor of a stretch, for some constants, at the n fine samples of the run.

    Parameters
    ----------
    stretch : RotorRows
        Which.
    sheet : DataSheet
        What the constants are.
    values : (k,) array
        Constants for which it holds.
    speed, acceleration : (n,) array
        Of the rotor: that of the motor less what the coupling twists [rad/s, rad/s2].
    pole_angle, slip : (n,) array
        Angle of the rotors' poles against each other, and its rate [rad, rad/s]; zero in neutral.
    """

    stretch: RotorRows
    sheet: DataSheet
    values: Array
    speed: Array
    acceleration: Array
    pole_angle: Array
    slip: Array

    def value(self, name: str) -> float:
        """A constant of the sheet."""
        return float(self.values[self.sheet.at(name)])

    @cached_property
    def drag_slope(self) -> Array:
        """Change of the drag in neutral per change of speed [N m s/rad], (n,)."""
        above, below = (
            torque_of(self, drag_columns(self.stretch.side, speed))
            for speed in (self.speed + SLOPE_STEP, self.speed - SLOPE_STEP)
        )
        return np.asarray((above - below) / (2.0 * SLOPE_STEP))

    @cached_property
    def slow_pole_angle(self) -> Array:
        """The pole angle in the band of the rows [rad], (n,)."""
        return self.stretch.run.in_band(self.pole_angle)

    @cached_property
    def spring(self) -> tuple[Array, Array]:
        """Torque on the rotor per change of the pole angle [N m/rad], and per change of its rate [N m s/rad], (n,)."""
        poles = self.sheet.poles[self.stretch.side]
        peaks = {1: "pull_out"} | {wave: map_name(wave) for wave in MAP_WAVES}
        turns = sum(wave * self.value(name) * np.cos(wave * self.pole_angle) for wave, name in peaks.items())
        off = self.value(f"slip_damping_off_{self.stretch.side}") / SLIP_PASSAGE
        damping = poles * self.value("slip_damping") + off / np.cosh(self.slip / SLIP_PASSAGE) ** 2
        return np.asarray(poles * turns), np.asarray(damping)

    @cached_property
    def coupling_torque(self) -> Array:
        """Torque in the coupling as the constants have it [N m], (n,): what a transducer without faults would show."""
        of_reading = (f"zero_{self.stretch.side}", f"skew_{self.stretch.side}", "ripple")
        columns = {name: c for name, c in linear_columns(self).items() if not name.startswith(of_reading)}
        return np.zeros(len(self.speed)) + torque_of(self, columns)

    @cached_property
    def direction(self) -> Array:
        """Sense of rotation, smooth through standstill."""
        return np.asarray(np.tanh(self.speed / REST))

    @property
    def share(self) -> Array:
        """Speed in the unit of loss curves, without sign."""
        return np.abs(self.speed) / SPEED_UNIT


def rotor_state(stretch: RotorRows, sheet: DataSheet, values: Array) -> RotorState:
    """The state of a rotor for the constants (k,) of a sheet.

    Notes
    -----
    A coupling of stiffness k and damping d twists by :math:`T/k - (d/k^2)\\dot T`, slow beside k/d: the rotor lags the
    motor by it. The poles stand at
    :math:`\\varphi = p_s \\theta_s + p_r \\theta_r + \\varphi_0` against each other.
    """
    shafts, rate = stretch.run.shafts, stretch.run.fine_rate
    twist = per_shaft(lambda side: _twist(shafts[side].acting(rate), side, sheet, values, rate))
    nothing = np.zeros(len(stretch.run.time))
    pole_angle, slip = nothing, nothing
    if stretch.coupled:
        start = float(values[sheet.at(start_name(stretch.run.run.name))])
        turned = per_shaft(lambda s: _true(shafts[s], s, sheet, values))
        pole_angle = start + _of_poles(sheet.poles, per_shaft(lambda s: turned[s][0] - twist[s][0]))
        slip = _of_poles(sheet.poles, per_shaft(lambda s: turned[s][1] - twist[s][1]))
    _, speed, acceleration = _true(stretch.shaft, stretch.side, sheet, values)
    _, twisting, curvature = twist[stretch.side]
    rotor_speed, rotor_acceleration = speed - twisting, acceleration - curvature
    return RotorState(stretch, sheet, values, rotor_speed, rotor_acceleration, pole_angle, slip)


def _twist(
    acting: tuple[Array, Array, Array], side: str, sheet: DataSheet, values: Array, rate: float
) -> tuple[Array, Array, Array]:
    """Twist of a coupling [rad] by the torque in it and its derivatives (n,), and its derivatives in time."""
    torque, slope, curvature = acting
    give, loss = (float(values[sheet.at(name)]) for name in (f"compliance_{side}", coupling_loss_name(side)))
    return (
        np.asarray(give * torque - loss * slope),
        np.asarray(give * slope - loss * curvature),
        np.asarray(give * curvature - loss * derivative(curvature, rate)),
    )


def _true(shaft: SmoothShaft, side: str, sheet: DataSheet, values: Array) -> tuple[Array, Array, Array]:
    """Angle, speed and acceleration of a motor without the wave of a turn that its encoder shows too much (n,)."""
    cosine, sine = (float(values[sheet.at(name)]) for name in eccentricity_names(side))
    if not cosine and not sine:
        return shaft.angle, shaft.speed, shaft.acceleration
    of_cosine, of_sine = shaft.turn
    wave = cosine * of_cosine + sine * of_sine
    slope = sine * of_cosine - cosine * of_sine
    return (
        np.asarray(shaft.angle - wave),
        np.asarray(shaft.speed * (1.0 - slope)),
        np.asarray(shaft.acceleration * (1.0 - slope) + shaft.speed**2 * wave),
    )


def _of_poles(poles: PerShaft[int], values: PerShaft[Array]) -> Array:
    return np.asarray(sum(poles[side] * values[side] for side in SIDES))


def torque_of(state: RotorState, columns: dict[str, Array]) -> Array:
    """Torque that columns make with the constants of a state [N m]; `columns` are per unit of each, by its name."""
    return np.asarray(sum(state.value(name) * column for name, column in columns.items()))


def linear_columns(state: RotorState) -> dict[str, Array]:
    r"""Torque that a transducer shows per unit of each constant that it is proportional to, at the fine samples.

    Notes
    -----
    Force balance of a rotor with the torque T of its coupling, positive in the positive direction of rotation:
    :math:`T = T_0 + J\dot\omega + \sum_j d_j\,\mathrm{sgn}(\omega)|\omega|^{n_j} + p\,(A\sin\varphi + c\,\dot\varphi)`
    with the torques of the gear when engaged only. A reading that comes later by a skew s is less by
    :math:`s\dot T + s^2 \ddot T/2`.
    """
    side, sheet = state.stretch.side, state.sheet
    ones = np.ones(len(state.speed))
    columns = {f"zero_{side}": ones}
    if state.stretch.at_rest:
        return columns
    columns[f"inertia_{side}"] = state.acceleration
    shaft, skew = state.stretch.shaft, 0.5 * state.value(f"skew_{side}")
    columns[f"skew_{side}"] = -shaft.torque_rate - skew * shaft.torque_curvature
    columns |= drag_columns(side, state.speed)
    for order in RIPPLE:
        cosine, sine = ripple_names(side, order)
        columns[cosine], columns[sine] = np.cos(order * shaft.angle), np.sin(order * shaft.angle)
    if state.stretch.coupled:
        columns |= engaged_drag_columns(side, state.speed) | gear_columns(sheet, side, state.pole_angle, state.slip)
    return columns


def later_of(lag: Lag, state: RotorState) -> Array:
    """Change (n, 1) of what a transducer that lags shows per time by which it shows it later [N m/s]."""
    if lag.side != state.stretch.side or state.stretch.at_rest:
        return np.zeros((len(state.speed), 1))
    rate = state.stretch.run.fine_rate
    return -derivative(lag.of(state.coupling_torque[:, None], rate)[:, 0], rate)[:, None]
