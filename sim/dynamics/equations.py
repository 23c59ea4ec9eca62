"""The equations of a drivetrain as compiled functions, and what is asked of them besides an integration."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.signals import Array


class Equations(NamedTuple):
    """Compiled functions of a drivetrain, which `codegen` generates and the integrator calls.

    `y` is the state (20,), `a` the four numbers of `SetPoints`, `v` their rates, `p` the parameters, `j` the elements
    of the Jacobian J of `rates` that are not zero, `lu` those of its factors; the last argument is filled.

    `rates` (y, a, p, out) are the equations of motion; `slopes` (y, a, p, j); `drift` (y, a, v, p, out) is the
    derivative of the rates with time; `factor` (j, d, lu) takes d I - J apart, and `solve` (lu, b) solves
    (d I - J) x = b in place; `sums` (y, p, out) are the powers whose sums over a run are wanted; `slip_rate` (y, p) is
    the rate of the electrical phase [rad/s].
    """

    rates: Callable[[Array, Array, Array, Array], None]
    slopes: Callable[[Array, Array, Array, Array], None]
    drift: Callable[[Array, Array, Array, Array, Array], None]
    factor: Callable[[Array, float, Array], None]
    solve: Callable[[Array, Array], None]
    sums: Callable[[Array, Array, Array], None]
    slip_rate: Callable[[Array, Array], float]


def evaluate(of: Equations, y: Array, a: Array, p: Array, out: Array, j: Array, energy: Array) -> None:
    """Rates, elements of the Jacobian and powers at a state, into the last three."""
    of.rates(y, a, p, out)
    of.slopes(y, a, p, j)
    of.sums(y, p, energy)


def solve_stage(of: Equations, j: Array, d: float, lu: Array, x: Array) -> None:
    """Solution of (d I - J) x = b, in place, with the factors of d I - J into `lu`."""
    of.factor(j, d, lu)
    of.solve(lu, x)
