"""The fast solver: Rodas4, a one-step L-stable Rosenbrock method of order four with error control and dense output.

The functions of this module are never run as they stand: `pmg.sim.dynamics.codegen` has their text compiled, once for
all drivetrains, whose equations it is given. So they are plain arithmetic on floats and preallocated arrays.

Method and coefficients: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd edition, Springer 1996,
section IV.7, method RODAS (gamma = 1/4, six stages, stiffly accurate), with the step control of section IV.8.
On this bench the error falls with the fourth power of the step down to tolerances of 1e-7, below with a power between
two and three: the torque loops are a million times faster than the motion, and the stages are of order one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.run_values import DONE, NO_STEP, STOPPED, TOO_MANY, Ended, Lock, Slips, Stride
from pmg.sim.dynamics.segments import follow
from pmg.sim.dynamics.state import STATES
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.dynamics.equations import Equations
    from pmg.sim.dynamics.run_values import Room, Settings, Well
    from pmg.sim.dynamics.segments import Legs
    from pmg.sim.signals import Array

SIZE = len(STATES)

GAMMA = 0.25
ALPHA = (0.0, 0.386, 0.21, 0.63, 1.0, 1.0)
GAMMA_SUM = (0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0)
A_21 = 1.544
A_31, A_32 = 0.9466785280815826, 0.2557011698983284
A_41, A_42, A_43 = 3.314825187068521, 2.896124015972201, 0.9986419139977817
A_51, A_52, A_53, A_54 = 1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950
C_21 = -5.6688
C_31, C_32 = -2.430093356833875, -0.2063599157091915
C_41, C_42, C_43 = -0.1073529058151375, -9.594562251023355, -20.47028614809616
C_51, C_52, C_53, C_54 = 7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160
C_61, C_62, C_63, C_64, C_65 = (
    8.083246795921522,
    -7.981132988064893,
    -31.52159432874371,
    16.31930543123136,
    -6.058818238834054,
)
D_21, D_22, D_23, D_24, D_25 = (
    10.12623508344586,
    -7.487995877610167,
    -34.80091861555747,
    -7.992771707568823,
    1.025137723295662,
)
D_31, D_32, D_33, D_34, D_35 = (
    -0.6762803392801253,
    6.087714651680015,
    16.43084320892478,
    24.76722511418386,
    -6.594389125716872,
)

FIRST_STEP = 1e-6
"""First step [s]; it grows fivefold a step where it can."""

LOOKS = 4
"""Times in a step at which it is looked whether the gear is locked."""

SMALLEST_STEP = 1e-14
"""Step below which the run is given up [s]."""


W, U1, U2, U3, U4, U5, U6, D2, D3, F, FT, MIDDLE, SET, SET_RATES = range(14)
"""Rows of the room of a step: the new state, the six stages, the two bends of the dense output, the rates and their
derivative with time, the state in the middle, set values and their rates."""


def _at_share(s: float, y: Array, k: Array, out: Array) -> None:
    """State at a share `s` of the step, into `out`; of order three."""
    for i in range(SIZE):
        out[i] = y[i] * (1.0 - s) + s * (k[W, i] + (1.0 - s) * (k[D2, i] + s * k[D3, i]))


def _put_set(row: Array, time: float, k: Array) -> None:
    """Set values and their rates at a time, and the rates of those."""
    for side in range(2):
        k[SET, side], k[SET, 2 + side], k[SET_RATES, 2 + side] = follow(row[side], time)
        k[SET_RATES, side] = k[SET, 2 + side]


def _make_stages(of: Equations, span: Stride, y: Array, p: Array, row: Array, k: Array, j: Array, lu: Array) -> None:
    """The six stages of a step, and the new state without the last, into `k`."""
    t, step = span.begin, span.length
    r = 1.0 / step
    _put_set(row, t, k)
    of.rates(y, k[SET], p, k[F])
    of.drift(y, k[SET], k[SET_RATES], p, k[FT])
    of.slopes(y, k[SET], p, j)
    of.factor(j, 1.0 / (GAMMA * step), lu)
    for i in range(SIZE):
        k[U1, i] = k[F, i] + step * GAMMA_SUM[0] * k[FT, i]
    of.solve(lu, k[U1])
    for i in range(SIZE):
        k[W, i] = y[i] + A_21 * k[U1, i]
    _put_set(row, t + ALPHA[1] * step, k)
    of.rates(k[W], k[SET], p, k[U2])
    for i in range(SIZE):
        k[U2, i] += r * C_21 * k[U1, i] + step * GAMMA_SUM[1] * k[FT, i]
    of.solve(lu, k[U2])
    for i in range(SIZE):
        k[W, i] = y[i] + A_31 * k[U1, i] + A_32 * k[U2, i]
    _put_set(row, t + ALPHA[2] * step, k)
    of.rates(k[W], k[SET], p, k[U3])
    for i in range(SIZE):
        k[U3, i] += r * (C_31 * k[U1, i] + C_32 * k[U2, i]) + step * GAMMA_SUM[2] * k[FT, i]
    of.solve(lu, k[U3])
    for i in range(SIZE):
        k[W, i] = y[i] + A_41 * k[U1, i] + A_42 * k[U2, i] + A_43 * k[U3, i]
    _put_set(row, t + ALPHA[3] * step, k)
    of.rates(k[W], k[SET], p, k[U4])
    for i in range(SIZE):
        bent = C_41 * k[U1, i] + C_42 * k[U2, i] + C_43 * k[U3, i]
        k[U4, i] += r * bent + step * GAMMA_SUM[3] * k[FT, i]
    of.solve(lu, k[U4])
    for i in range(SIZE):
        k[W, i] = y[i] + A_51 * k[U1, i] + A_52 * k[U2, i] + A_53 * k[U3, i] + A_54 * k[U4, i]
    _put_set(row, t + step, k)
    of.rates(k[W], k[SET], p, k[U5])
    for i in range(SIZE):
        k[U5, i] += r * (C_51 * k[U1, i] + C_52 * k[U2, i] + C_53 * k[U3, i] + C_54 * k[U4, i])
    of.solve(lu, k[U5])
    for i in range(SIZE):
        k[W, i] += k[U5, i]
    of.rates(k[W], k[SET], p, k[U6])
    for i in range(SIZE):
        bent = C_61 * k[U1, i] + C_62 * k[U2, i] + C_63 * k[U3, i] + C_64 * k[U4, i]
        k[U6, i] += r * (bent + C_65 * k[U5, i])
    of.solve(lu, k[U6])


def _finish(y: Array, k: Array, rtol: float, scales: Array) -> float:
    """Adds the last stage to the new state; its size, the error of the step, as a multiple of the tolerance."""
    square = 0.0
    for i in range(SIZE):
        k[W, i] += k[U6, i]
        ratio = k[U6, i] / (rtol * (scales[i] + max(abs(y[i]), abs(k[W, i]))))
        square += ratio * ratio
    return math.sqrt(square / SIZE)


def _bend(k: Array) -> None:
    """Bends of the dense output of a step that is accepted."""
    for i in range(SIZE):
        k[D2, i] = D_21 * k[U1, i] + D_22 * k[U2, i] + D_23 * k[U3, i] + D_24 * k[U4, i] + D_25 * k[U5, i]
        k[D3, i] = D_31 * k[U1, i] + D_32 * k[U2, i] + D_33 * k[U3, i] + D_34 * k[U4, i] + D_35 * k[U5, i]


def _shrinkage(error: float) -> float:
    """Divisor of the step for an error of the tolerance."""
    shrinkage: float = error**0.25 / 0.9
    return max(0.2, min(6.0, shrinkage))


def _following(step: float, error: float, last_step: float, last_error: float) -> float:
    """Step after one that is accepted, by the control that also looks at the one before (0 where there is none)."""
    shrink = _shrinkage(error)
    if last_step > 0.0:
        foreseen = (last_step / step) * (error * error / last_error) ** 0.25 / 0.9
        shrink = max(shrink, max(0.2, min(6.0, foreseen)))
    return step / shrink


def _share_at(angle: float, sense: int, y: Array, k: Array, phase: int) -> float:
    """Share of the step at which the phase passes an angle upwards (`sense` 1) or downwards, by halving."""
    low, high = 0.0, 1.0
    for _ in range(50):
        share = 0.5 * (low + high)
        bent = k[D2, phase] + share * k[D3, phase]
        reached = y[phase] * (1.0 - share) + share * (k[W, phase] + (1.0 - share) * bent)
        if sense * (reached - angle) < 0.0:
            low = share
        else:
            high = share
    return high


def _slips(span: Stride, y: Array, k: Array, well: Well, stop: bool, slips: Array, slipped: int) -> Slips:
    """Times at which poles slip within a step, into `slips` from place `slipped` on."""
    at = math.floor((y[well.phase] - well.centre) / REVOLUTION + 0.5)
    then = math.floor((k[W, well.phase] - well.centre) / REVOLUTION + 0.5)
    sense = 1 if then > at else -1
    while at != then:
        share = _share_at(well.centre + (at + 0.5 * sense) * REVOLUTION, sense, y, k, well.phase)
        if slipped < slips.size:
            slips[slipped] = span.begin + share * span.length
        slipped += 1
        at += sense
        if stop:
            return Slips(slipped, share, True)
    return Slips(slipped, 1.0, False)


def _watch(of: Equations, span: Stride, y: Array, k: Array, p: Array, locked: float, lock: Lock) -> Lock:
    """Whether the gear is locked, looked at some times within a step."""
    since, last = lock.since, lock.rate
    for look in range(1, LOOKS + 1):
        _at_share(look / LOOKS, y, k, k[MIDDLE])
        rate = abs(of.slip_rate(k[MIDDLE], p))
        if rate >= locked:
            since = math.nan
        elif math.isnan(since):
            part = (last - locked) / (last - rate)
            since = span.begin + (look - 1.0 + part) / LOOKS * span.length
        last = rate
    return Lock(since, last)


def _copy(values: Array, out: Array) -> None:
    for i in range(SIZE):
        out[i] = values[i]


def _sum_up(of: Equations, duration: float, k: Array, p: Array, q: Array, energy: Array) -> None:
    """Adds the powers' sums over a step by Simpson's rule: `q` holds those at its begin, `k[MIDDLE]` is its middle."""
    if energy.size:
        of.sums(k[MIDDLE], p, q[1])
        of.sums(k[W], p, q[2])
        for i in range(energy.size):
            energy[i] += duration / 6.0 * (q[0, i] + 4.0 * q[1, i] + q[2, i])
            q[0, i] = q[2, i]


def integrate(
    of: Equations, y: Array, p: Array, legs: Legs, instants: Array, well: Well, settings: Settings, room: Room
) -> Ended:
    """Run from time 0 through all legs.

    `of` are the equations of a drivetrain, `p` its parameters. The start state `y` (20,) is the last one afterwards;
    `instants` (m,) are the times to report [s]; `room` is filled.
    """
    k, q = np.empty((14, SIZE)), np.empty((3, room.energy.size))
    states, energy, slips, j, lu = room.states, room.energy, room.slips, room.entries, room.factors
    rtol, scales, locked, stop = settings.rtol, settings.scales, settings.locked, settings.stop
    t, h, last_step, last_error = 0.0, FIRST_STEP, 0.0, 1.0
    steps, rejected, reported, slipped, after_reject = 0, 0, 0, 0, False
    while reported < instants.size and instants[reported] <= t:
        _copy(y, states[reported])
        reported += 1
    rate = abs(of.slip_rate(y, p))
    lock = Lock(0.0 if well.phase >= 0 and rate < locked else math.nan, rate)
    if energy.size:
        of.sums(y, p, q[0])
    for leg in range(legs.ends.size):
        end, row = legs.ends[leg], legs.rows[leg]
        while t < end:
            if steps + rejected >= settings.most:
                return Ended(TOO_MANY, steps, rejected, reported, slipped, lock.since, t)
            if h < SMALLEST_STEP:
                return Ended(NO_STEP, steps, rejected, reported, slipped, lock.since, t)
            whole = t + 1.01 * h >= end
            step = end - t if whole else h
            span = Stride(t, step)
            _make_stages(of, span, y, p, row, k, j, lu)
            error = _finish(y, k, rtol, scales)
            if not error <= 1.0:  # NaN too
                rejected, after_reject = rejected + 1, True
                h = step / max(_shrinkage(error), 1.05) if math.isfinite(error) else 0.1 * step
                continue
            following = _following(step, error, last_step, last_error)
            last_step, last_error = step, max(0.01, error)
            if after_reject:
                following = min(following, step)
            steps, after_reject = steps + 1, False
            _bend(k)
            at_end = end if whole else t + step
            found = Slips(slipped, 1.0, False)
            if well.phase >= 0:
                found = _slips(span, y, k, well, stop, slips, slipped)
                lock = _watch(of, span, y, k, p, locked, lock)
            if found.halted:
                at_end = t + found.share * step
            slipped = found.slipped
            while reported < instants.size and instants[reported] <= at_end:
                _at_share((instants[reported] - t) / step, y, k, states[reported])
                reported += 1
            _at_share(0.5 * found.share, y, k, k[MIDDLE])
            if found.halted:
                _at_share(found.share, y, k, k[U1])
                _copy(k[U1], k[W])
            _sum_up(of, at_end - t, k, p, q, energy)
            _copy(k[W], y)
            t = at_end
            if found.halted:
                return Ended(STOPPED, steps, rejected, reported, slipped, math.nan, t)
            h = max(following, h) if whole else following
    return Ended(DONE, steps, rejected, reported, slipped, lock.since, t)
