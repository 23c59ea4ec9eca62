"""Other solvers on the same equations: scipy's, and, where they are installed, CasADi, numbalsoda, PathSim.

Each entry takes a relative tolerance and gives the two speeds at the wanted instants, one row each. What an entry
prepares once (compiling, building) happens before it is called.
"""

from __future__ import annotations

import warnings
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numba import carray, cfunc, njit  # type: ignore[attr-defined, unused-ignore]
from scipy.integrate import solve_ivp

from pmg.sim.dynamics.jacobian import dense
from pmg.sim.dynamics.kernel import kernel_of
from pmg.sim.dynamics.radau import _asked_at
from pmg.sim.dynamics.segments import make_legs
from pmg.sim.dynamics.state import STATES, SetPoints
from pmg.sim.dynamics.transient import SCALES, Solver, Task, transient
from tests.bench.case import SPEEDS, drivetrain, programmes

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.signals import Array

    Peer = Callable[[float], Array]

POINT = 47
RAMP = 1.0


def compiled(times: Array) -> Peer:
    """The compiled Rodas4 of pmg."""

    def run(rtol: float) -> Array:
        trace = transient(Task(drivetrain(), *programmes(POINT), float(times[-1]), times=times), rtol=rtol)
        return trace.state[SPEEDS].T

    return run


def radau_of_pmg(times: Array) -> Peer:
    """The reference solver of pmg: scipy's Radau on the equations as written, with events and energies."""

    def run(rtol: float) -> Array:
        course = transient(
            Task(drivetrain(), *programmes(POINT), float(times[-1]), times=times), rtol=rtol, solver=Solver.RADAU
        )
        return course.state[SPEEDS].T

    return run


def scipy_solver(times: Array, method: Literal["Radau", "LSODA"], machine_code: bool) -> Peer:
    """`solve_ivp` in two stretches, the ramp and what follows, with the exact Jacobian."""
    train, kernel = drivetrain(), kernel_of(drivetrain())
    legs = make_legs(*programmes(POINT), float(times[-1]))

    def right_hand_side(rows: Array) -> Callable[[float, Array], Array]:
        def plain(t: float, y: Array) -> Array:
            return np.array(train.rates(y.tolist(), _asked_at(rows, t)))

        def fast(t: float, y: Array) -> Array:
            return kernel.rates(y, np.array(_asked_at(rows, t)))

        return fast if machine_code else plain

    def jacobian(_: float, y: Array) -> Array:
        return kernel.jacobian(y) if machine_code else dense(train, y)

    def run(rtol: float) -> Array:
        y, begin, found = train.at_rest(), 0.0, []
        for end, rows in zip(legs.ends.tolist(), legs.rows, strict=True):
            inside = times[(times >= begin) & (times < end)] if end < times[-1] else times[times >= begin]
            result: Any = solve_ivp(
                right_hand_side(rows),
                (begin, end),
                y,
                method=method,
                t_eval=np.union1d(inside, [end]),
                jac=jacobian,
                rtol=rtol,
                atol=rtol * SCALES,
            )
            found.append(result.y[SPEEDS][:, np.isin(result.t, inside)])
            begin, y = end, result.y[:, -1]
        return np.concatenate(found, axis=1).T

    return run


def casadi_cvodes(times: Array) -> Peer:
    """CVODES through CasADi, exact sparse Jacobian, the equations run on its symbols."""
    import casadi  # type: ignore[import-not-found, unused-ignore]

    casadi.GlobalOptions.setNumpyMode(-1)
    train, (sun, ring) = drivetrain(), programmes(POINT)
    y, t = casadi.SX.sym("y", len(STATES)), casadi.SX.sym("t")
    ends = float(sun.values[-1]), float(ring.values[-1])

    def integrator(asked: SetPoints, grid: Array, rtol: float, reset: float) -> Any:  # noqa: ANN401  (a foreign object)
        rates = casadi.vertcat(*train.rates(casadi.vertsplit(y), asked))
        options = {"reltol": rtol, "abstol": rtol * reset, "max_num_steps": 10**8}
        return casadi.integrator("f", "cvodes", {"x": y, "t": t, "ode": rates}, 0.0, grid, options)

    def run(rtol: float) -> Array:
        first, second = times[times <= RAMP], times[times > RAMP]
        ramp = SetPoints(ends[0] * t / RAMP, ends[1] * t / RAMP, ends[0] / RAMP, ends[1] / RAMP)
        one = integrator(ramp, first, rtol, 1e-3)(x0=train.at_rest())["xf"].full()
        two = integrator(SetPoints(*ends), second - RAMP, rtol, 1e-3)(x0=one[:, -1])["xf"].full()
        return np.concatenate((one, two), axis=1)[SPEEDS].T

    return run


def numbalsoda_lsoda(times: Array) -> Peer:
    """LSODA compiled, called from machine code; its Jacobian is by differences, its tolerance one number."""
    import numbalsoda  # type: ignore[import-not-found, unused-ignore]

    kernel, (sun, ring) = kernel_of(drivetrain()), programmes(POINT)
    rates, size, count = kernel.equations.rates, len(STATES), kernel.parameters.size
    ends = float(sun.values[-1]), float(ring.values[-1])

    @njit  # type: ignore[untyped-decorator, unused-ignore]
    def inner(t, u, du, data):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        y, p = carray(u, (size,)), carray(data, (count + 4,))
        a = np.empty(4)
        a[0], a[1], a[2], a[3] = (
            p[count] + p[count + 2] * t,
            p[count + 1] + p[count + 3] * t,
            p[count + 2],
            p[count + 3],
        )
        rates(y, a, p, carray(du, (size,)))

    signature = numbalsoda.lsoda_sig
    address = cfunc(signature)(lambda t, u, du, data: inner(t, u, du, data)).address

    def run(rtol: float) -> Array:
        first, second = times[times <= RAMP], times[times > RAMP]
        one, fine = numbalsoda.lsoda(
            address,
            drivetrain().at_rest(),
            first,
            np.append(kernel.parameters, [0.0, 0.0, *ends]),
            rtol,
            1e-3 * rtol,
            10**8,
        )
        two, done = numbalsoda.lsoda(
            address,
            one[-1],
            np.append(RAMP, second),
            np.append(kernel.parameters, [*ends, 0.0, 0.0]),
            rtol,
            1e-3 * rtol,
            10**8,
        )
        if not (fine and done):
            raise RuntimeError("numbalsoda gave up")
        return np.concatenate((one, two[1:]))[:, SPEEDS]

    return run


def pathsim_block(times: Array) -> Peer:
    """PathSim's ESDIRK43 on one block that holds the whole model, exact Jacobian."""
    import pathsim  # type: ignore[import-not-found, unused-ignore]
    from pathsim.blocks import ODE, Scope  # type: ignore[import-not-found, unused-ignore]
    from pathsim.solvers import ESDIRK43  # type: ignore[import-not-found, unused-ignore]

    train, kernel = drivetrain(), kernel_of(drivetrain())
    legs = make_legs(*programmes(POINT), 1e3)

    def rates(y: Array, _: object, t: float) -> Array:
        return kernel.rates(np.asarray(y), np.array(_asked_at(legs.rows[0 if t < RAMP else 1], t)))

    def jacobian(y: Array, _: object, __: float) -> Array:
        return kernel.jacobian(np.asarray(y))

    def run(rtol: float) -> Array:
        block, scope = ODE(rates, train.at_rest(), jacobian), Scope()
        wires = [pathsim.Connection(block[i], scope[n]) for n, i in enumerate(SPEEDS)]
        model = pathsim.Simulation(
            [block, scope],
            wires,
            dt=1e-6,
            Solver=ESDIRK43,
            tolerance_lte_rel=rtol,
            tolerance_lte_abs=1e-3 * rtol,
            log=False,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model.run(float(times[-1]))
        when, what = scope.read()
        return np.stack([np.interp(times, when, values) for values in what], axis=1)

    return run


def installed(name: str) -> bool:
    """Whether a peer is there."""
    return find_spec(name) is not None
