"""Derivative of the equations of motion with respect to the state, from the equations themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.state import STATES, SetPoints

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy.typing as npt

    from pmg.sim.dynamics.drivetrain import Drivetrain
    from pmg.sim.signals import Array, Number

STEP = 1e-30
"""Imaginary step of the complex-step derivative; it cancels nothing, so it may be as small as one likes."""


def dense(drivetrain: Drivetrain, state: Iterable[Number], asked: SetPoints = SetPoints()) -> Array:  # noqa: B008 (a tuple)
    r"""Jacobian (..., 20, 20) at a state whose further axes come first.

    Notes
    -----
    By complex step: :math:`J_{ij} = \mathrm{Im}\,f_i(x + \mathrm{i}h e_j)/h`, exact to rounding as nothing is
    subtracted, all columns at once. What is asked for matters where a motor is at a limit: the equations are linear in
    it elsewhere.
    The compiled solver has the same derivative as formulas, see `pmg.sim.dynamics.kernel`.
    """
    x = np.array(np.broadcast_arrays(*state), dtype=np.complex128)
    n = len(STATES)
    unit = np.eye(n).reshape(n, *(1,) * (x.ndim - 1), n)
    moved = x[..., None] + 1j * STEP * unit
    rates: npt.NDArray[np.complex128] = np.array(np.broadcast_arrays(*drivetrain.rates(moved, asked)))
    return np.ascontiguousarray(np.moveaxis(np.imag(rates) / STEP, 0, -2))


def active(drivetrain: Drivetrain) -> npt.NDArray[np.intp]:
    """Indices of the states that take part in small motions about a steady state.

    Left out: the quadrature of the sun's angle, the derivative's filter where the derivative is ideal, the phase where
    nothing couples it, and the speed error's integral of a motor that follows torque.
    """
    q = drivetrain.constants
    idle = {"angle_sun"}
    idle |= {"phase"} if drivetrain.coupling is None else set()
    idle |= {"filtered_sun", "filtered_ring"} if q.ideal else set()
    idle |= set() if q.sun.by_speed else {"angle_lag_sun"}
    idle |= set() if q.ring.by_speed else {"angle_lag_ring"}
    return np.array([i for i, name in enumerate(STATES) if name not in idle], dtype=np.intp)
