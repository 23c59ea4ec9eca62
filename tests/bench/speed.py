"""`./pmgw bench speed`: the simulator against other solvers, in one run, at equal error.

Every solver integrates the same equations over the same run: from rest with a swing of the phase, a ramp of one second
to the highest published load, then constant. Each is given tighter and tighter tolerances until its error over the
whole run is below the common one; the time of that run counts. Ratios are to pmg's compiled solver.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.equilibrium import equilibrium
from pmg.sim.dynamics.transient import transients
from pmg.sim.steady.forward import forward
from tests.bench import peers
from tests.bench.case import EQUAL_ERROR, drivetrain, error, steady_grid, tasks, timed

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.signals import Array

TOLERANCES = (1e-3, 3e-4, 1e-4, 5e-5, 2e-5, 1e-5, 3e-6, 1e-6, 1e-7)
COLD = (
    "from tests.bench.case import tasks; from pmg.sim.dynamics.transient import transients; "
    "transients(tasks(48, 100.0, 10_001), threads=2)"
)


def report(*cells: str) -> None:
    """One line of the table."""
    sys.stdout.write(f"{cells[0]:<44}" + "".join(f"{cell:>14}" for cell in cells[1:]) + "\n")
    sys.stdout.flush()


def at_equal_error(run: Callable[[float], Array], exact: Array, repeats: int) -> tuple[float, float, float]:
    """Tolerance, error and time of the first run that is good enough."""
    for rtol in TOLERANCES:
        found = timed(lambda: run(rtol), repeats)  # noqa: B023  (called at once)
        off = error(np.asarray(found.value), exact)
        if off <= EQUAL_ERROR:
            return rtol, off, found.wall
    raise RuntimeError("no tolerance of this solver meets the error")


def one_run(duration: float, patience: float) -> None:
    """The table of one run."""
    times = np.linspace(0.0, duration, round(duration * 100) + 1)
    exact = peers.scipy_solver(times, "Radau", True)(1e-10)
    entries: list[tuple[str, Callable[[], Callable[[float], Array]], int, bool]] = [
        ("pmg, compiled Rodas4", lambda: peers.compiled(times), 5, True),
        ("numbalsoda LSODA, compiled", lambda: peers.numbalsoda_lsoda(times), 3, peers.installed("numbalsoda")),
        ("CasADi CVODES, sparse exact Jacobian", lambda: peers.casadi_cvodes(times), 2, peers.installed("casadi")),
        ("scipy LSODA, compiled equations", lambda: peers.scipy_solver(times, "LSODA", True), 1, True),
        ("scipy Radau, compiled equations", lambda: peers.scipy_solver(times, "Radau", True), 1, True),
        ("scipy Radau, NumPy equations", lambda: peers.scipy_solver(times, "Radau", False), 1, True),
        ("pmg, reference (Radau, events, energies)", lambda: peers.radau_of_pmg(times), 1, True),
        ("scipy LSODA, NumPy equations", lambda: peers.scipy_solver(times, "LSODA", False), 1, duration <= patience),
    ]
    report(f"one run of {duration:g} s, {times.size} outputs", "rtol", "error", "time [ms]", "ratio", "prepare [s]")
    fastest = None
    for name, make, repeats, wanted in entries:
        if not wanted:
            report(name, "not run")
            continue
        prepared = timed(make)
        run = prepared.value
        first = timed(lambda: run(1e-3))  # type: ignore[operator]  # noqa: B023
        rtol, off, wall = at_equal_error(run, exact, repeats)  # type: ignore[arg-type]
        fastest = fastest or wall
        prepare = prepared.wall + max(0.0, first.wall - wall)
        report(name, f"{rtol:g}", f"{off:.1e}", f"{1e3 * wall:.2f}", f"{wall / fastest:.0f}", f"{prepare:.2f}")
    if peers.installed("pathsim"):
        short = np.linspace(0.0, 0.2, 21)
        ours = timed(lambda: peers.compiled(short)(1e-4), 5)
        theirs = timed(lambda: peers.pathsim_block(short)(1e-4))
        off = error(np.asarray(theirs.value), peers.scipy_solver(short, "Radau", True)(1e-10))
        report(
            "PathSim ESDIRK43, first 0.2 s only",
            "0.0001",
            f"{off:.1e}",
            f"{1e3 * theirs.wall:.0f}",
            f"{theirs.wall / ours.wall:.0f}",
        )


def many() -> None:
    """Steady states and transients of all 48 points, warm and in a new process."""
    gearbox, grid = steady_grid()
    report("48 points", "time [ms]")
    found = timed(lambda: forward(gearbox, grid.points, grid.torque_sun), 20)
    report("steady states, locked gear", f"{1e3 * found.wall:.2f}")
    found = timed(lambda: equilibrium(drivetrain(), grid.torque_sun, grid.points.torque_ring), 10)
    report("steady states, Newton on all 20 states", f"{1e3 * found.wall:.2f}")
    runs = tasks(48, 100.0, 10_001)
    for threads in (1, 2):
        found = timed(lambda: transients(runs, threads=threads), 5)  # noqa: B023
        report(f"transients of 100 s, rtol 1e-4, {threads} thread(s)", f"{1e3 * found.wall:.1f}")
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"PMG_CACHE": folder}
        for state in ("cache empty", "cache filled", "cache filled"):
            found = timed(lambda: subprocess.run([sys.executable, "-c", COLD], check=True, env=environment))
            report(f"the same in a new process, {state}", f"{1e3 * found.wall:.0f}")


def main() -> None:
    """Print the tables."""
    one_run(float(sys.argv[1]) if len(sys.argv) > 1 else 100.0, 20.0)
    many()


if __name__ == "__main__":
    main()
