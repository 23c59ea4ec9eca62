"""Functions that the fast solver calls and `codegen` generates: signatures only, for readers and type checkers.

`y` is the state (20,), `a` the four numbers of `SetPoints`, `p` the parameters.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pmg.sim.signals import Array

SIZE, ENTRIES, FACTORS = 20, 0, 0
"""Numbers of states, and of elements of the Jacobian and of its factors that are not zero."""


def rates(y: Array, a: Array, p: Array, out: Array) -> None:
    """The equations of motion, into `out` (20,)."""
    raise NotImplementedError


def slopes(y: Array, a: Array, p: Array, out: Array) -> None:
    """The elements of the Jacobian that are not zero, into `out`; `a` matters where a motor is limited."""
    raise NotImplementedError


def drift(y: Array, a: Array, v: Array, p: Array, out: Array) -> None:
    """Derivative of the rates with time, from the rates of the four set numbers `v`, into `out` (20,)."""
    raise NotImplementedError


def factor(j: Array, d: float, lu: Array) -> None:
    """Triangular factors of d I - J, into `lu`."""
    raise NotImplementedError


def solve(lu: Array, b: Array) -> None:
    """Solution of (d I - J) x = b, in place."""
    raise NotImplementedError


def sums(y: Array, p: Array, out: Array) -> None:
    """The powers whose sums over a run are wanted, into `out`."""
    raise NotImplementedError


def slip_rate(y: Array, p: Array) -> float:
    """Rate of the electrical phase [rad/s]."""
    raise NotImplementedError
