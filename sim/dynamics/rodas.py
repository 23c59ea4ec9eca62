"""The fast solver: Rodas4, a one-step L-stable Rosenbrock method of order four with error control and dense output.

The functions of this module are never run as they stand. `pmg.sim.dynamics.codegen` writes the generated functions of
a drivetrain in front of their text, in place of those of `slots`, and the whole is compiled. So they are plain
arithmetic on floats and preallocated arrays.

Method and coefficients: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd edition, Springer 1996,
section IV.7, method RODAS (gamma = 1/4, six stages, stiffly accurate), with the step control of section IV.8.
On this bench the error falls with the fourth power of the step down to tolerances of 1e-7, below with a power between
two and three: the torque loops are a million times faster than the motion, and the stages are of order one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.segments import follow
from pmg.sim.dynamics.solver_stubs import ENTRIES, FACTORS, drift, factor, rates, slip_rate, slopes, solve, sums
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.signals import Array

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

DONE, STOPPED, NO_STEP, TOO_MANY = 0, 1, -1, -2
"""How a run ended: at its end, at a slipped pole, without a step that converges, after too many steps."""

FIRST_STEP = 1e-6
"""First step [s]; it grows fivefold a step where it can."""

LOOKS = 4
"""Times in a step at which it is looked whether the gear is locked."""

SMALLEST_STEP = 1e-14
"""Step below which the run is given up [s]."""


def at_share(s: float, y: Array, w: Array, d2: Array, d3: Array, out: Array) -> None:
    """State at a share `s` of the step from `y` to `w`, into `out`; of order three."""
    for i in range(y.size):
        out[i] = y[i] * (1.0 - s) + s * (w[i] + (1.0 - s) * (d2[i] + s * d3[i]))


def put_set(rows: Array, time: float, a: Array, v: Array) -> None:
    """Set values and their rates at a time into `a`, the rates of those into `v`."""
    for side in range(2):
        a[side], a[2 + side], v[2 + side] = follow(rows[side], time)
        v[side] = a[2 + side]


def integrate(
    y: Array,
    p: Array,
    ends: Array,
    rows: Array,
    instants: Array,
    out: Array,
    energy: Array,
    slips: Array,
    scales: Array,
    rtol: float,
    phase: int,
    centre: float,
    stop: bool,
    locked: float,
    most: int,
) -> tuple[int, int, int, int, int, float, float]:
    """Run from time 0 through all legs.

    Parameters
    ----------
    y : (20,) array
        Start state; holds the last state afterwards.
    p : array
        Parameters of the drivetrain.
    ends, rows : array
        The `Legs`.
    instants, out : (m,), (m, 20) array
        When to report, and room for it.
    energy : (k,) array
        Room for the sums over time of the powers; empty when not wanted.
    slips : (q,) array
        Room for the times of slipped poles.
    scales : (20,) array
        Usual size of each state.
    rtol : float
        Relative tolerance; the absolute one is this times `scales`.
    phase : int
        Index of the electrical phase, or -1 where nothing can slip.
    centre : float
        Phase in the middle of a magnetic well [rad]; a pole slips half a period from it.
    stop : bool
        Whether to end at the first slipped pole.
    locked : float
        Rate of the phase below which the gear counts as locked [rad/s].
    most : int
        Steps, accepted or not, before the run is given up.

    Returns
    -------
    tuple
        How it ended; steps; rejected steps; instants reported; slips; time from which it stayed locked (NaN if it did
        not); time reached.
    """
    n = y.size
    f, w, ft = np.empty(n), np.empty(n), np.empty(n)
    u1, u2, u3, u4, u5, u6 = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    d2, d3, m = np.empty(n), np.empty(n), np.empty(n)
    a, v, unused = np.empty(4), np.empty(4), np.empty(4)
    j, lu = np.empty(ENTRIES), np.empty(FACTORS)
    q0, q1, q2 = np.empty(energy.size), np.empty(energy.size), np.empty(energy.size)
    energy[:] = 0.0
    t, h, last_h, last_error = 0.0, FIRST_STEP, 0.0, 1.0
    steps, rejected, reported, slipped, after_reject = 0, 0, 0, 0, False
    while reported < instants.size and instants[reported] <= t:
        out[reported] = y
        reported += 1
    last_rate = abs(slip_rate(y, p))
    locked_at = 0.0 if phase >= 0 and last_rate < locked else math.nan
    if energy.size:
        sums(y, p, q0)
    for leg in range(ends.size):
        end = ends[leg]
        row = rows[leg]
        while t < end:
            if steps + rejected >= most:
                return TOO_MANY, steps, rejected, reported, slipped, locked_at, t
            if h < SMALLEST_STEP:
                return NO_STEP, steps, rejected, reported, slipped, locked_at, t
            if t + 1.01 * h >= end:
                whole, step = True, end - t
            else:
                whole, step = False, h
            put_set(row, t, a, v)
            rates(y, a, p, f)
            drift(v, p, ft)
            slopes(y, p, j)
            factor(j, 1.0 / (GAMMA * step), lu)
            r = 1.0 / step
            for i in range(n):
                u1[i] = f[i] + step * GAMMA_SUM[0] * ft[i]
            solve(lu, u1)
            for i in range(n):
                w[i] = y[i] + A_21 * u1[i]
            put_set(row, t + ALPHA[1] * step, a, unused)
            rates(w, a, p, u2)
            for i in range(n):
                u2[i] += r * C_21 * u1[i] + step * GAMMA_SUM[1] * ft[i]
            solve(lu, u2)
            for i in range(n):
                w[i] = y[i] + A_31 * u1[i] + A_32 * u2[i]
            put_set(row, t + ALPHA[2] * step, a, unused)
            rates(w, a, p, u3)
            for i in range(n):
                u3[i] += r * (C_31 * u1[i] + C_32 * u2[i]) + step * GAMMA_SUM[2] * ft[i]
            solve(lu, u3)
            for i in range(n):
                w[i] = y[i] + A_41 * u1[i] + A_42 * u2[i] + A_43 * u3[i]
            put_set(row, t + ALPHA[3] * step, a, unused)
            rates(w, a, p, u4)
            for i in range(n):
                u4[i] += r * (C_41 * u1[i] + C_42 * u2[i] + C_43 * u3[i]) + step * GAMMA_SUM[3] * ft[i]
            solve(lu, u4)
            for i in range(n):
                w[i] = y[i] + A_51 * u1[i] + A_52 * u2[i] + A_53 * u3[i] + A_54 * u4[i]
            put_set(row, t + step, a, unused)
            rates(w, a, p, u5)
            for i in range(n):
                u5[i] += r * (C_51 * u1[i] + C_52 * u2[i] + C_53 * u3[i] + C_54 * u4[i])
            solve(lu, u5)
            for i in range(n):
                w[i] += u5[i]
            rates(w, a, p, u6)
            for i in range(n):
                u6[i] += r * (C_61 * u1[i] + C_62 * u2[i] + C_63 * u3[i] + C_64 * u4[i] + C_65 * u5[i])
            solve(lu, u6)
            square = 0.0
            for i in range(n):
                w[i] += u6[i]
                ratio = u6[i] / (rtol * (scales[i] + max(abs(y[i]), abs(w[i]))))
                square += ratio * ratio
            error = math.sqrt(square / n)
            if not math.isfinite(error):
                rejected += 1
                after_reject = True
                h = 0.1 * step
                continue
            shrink = max(0.2, min(6.0, error**0.25 / 0.9))
            if error > 1.0:
                rejected += 1
                after_reject = True
                h = step / max(shrink, 1.05)
                continue
            if steps > 0:
                foreseen = (last_h / step) * (error * error / last_error) ** 0.25 / 0.9
                shrink = max(shrink, max(0.2, min(6.0, foreseen)))
            last_h, last_error = step, max(0.01, error)
            following = step / shrink
            if after_reject:
                following = min(following, step)
            after_reject = False
            steps += 1
            for i in range(n):
                d2[i] = D_21 * u1[i] + D_22 * u2[i] + D_23 * u3[i] + D_24 * u4[i] + D_25 * u5[i]
                d3[i] = D_31 * u1[i] + D_32 * u2[i] + D_33 * u3[i] + D_34 * u4[i] + D_35 * u5[i]
            at_end = end if whole else t + step
            length = 1.0
            halted = False
            if phase >= 0:
                well = math.floor((y[phase] - centre) / REVOLUTION + 0.5)
                next_well = math.floor((w[phase] - centre) / REVOLUTION + 0.5)
                sense = 1 if next_well > well else -1
                while well != next_well:
                    top = centre + (well + 0.5 * sense) * REVOLUTION
                    low, high = 0.0, 1.0
                    for _ in range(50):
                        share = 0.5 * (low + high)
                        bent = d2[phase] + share * d3[phase]
                        angle = y[phase] * (1.0 - share) + share * (w[phase] + (1.0 - share) * bent)
                        if sense * (angle - top) < 0.0:
                            low = share
                        else:
                            high = share
                    if slipped < slips.size:
                        slips[slipped] = t + high * step
                    slipped += 1
                    well += sense
                    if stop:
                        length, halted = high, True
                        at_end = t + high * step
                        break
                for quarter in range(1, LOOKS + 1):
                    at_share(quarter / LOOKS, y, w, d2, d3, m)
                    rate = abs(slip_rate(m, p))
                    if rate >= locked:
                        locked_at = math.nan
                    elif math.isnan(locked_at):
                        part = (last_rate - locked) / (last_rate - rate)
                        locked_at = t + (quarter - 1.0 + part) / LOOKS * step
                    last_rate = rate
            while reported < instants.size and instants[reported] <= at_end:
                at_share((instants[reported] - t) / step, y, w, d2, d3, out[reported])
                reported += 1
            at_share(0.5 * length, y, w, d2, d3, m)
            if halted:
                at_share(length, y, w, d2, d3, u1)
                for i in range(n):
                    w[i] = u1[i]
            if energy.size:
                sums(m, p, q1)
                sums(w, p, q2)
                for i in range(energy.size):
                    energy[i] += (at_end - t) / 6.0 * (q0[i] + 4.0 * q1[i] + q2[i])
                    q0[i] = q2[i]
            for i in range(n):
                y[i] = w[i]
            t = at_end
            if halted:
                return STOPPED, steps, rejected, reported, slipped, math.nan, t
            h = max(following, h) if whole else following
    return DONE, steps, rejected, reported, slipped, locked_at, t
