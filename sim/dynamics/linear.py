"""The drivetrain for small motions: its modes by name, whether its torque loops are stable, its frequency response."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import eig

from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.jacobian import active, dense
from pmg.sim.dynamics.state import STATES, SetPoints, State
from pmg.sim.errors import BenchError
from pmg.sim.shafts import SIDES, PerShaft

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy.typing as npt

    from pmg.sim.signals import Array, Number


class ModeKind(StrEnum):
    """Main motion of a mode."""

    LOOP_SUN = "sun torque loop"
    LOOP_RING = "ring torque loop"
    RESET_SUN = "sun loop's integral action"
    RESET_RING = "ring loop's integral action"
    FILTER_SUN = "sun derivative filter"
    FILTER_RING = "ring derivative filter"
    SPEED_LOOP_SUN = "sun speed loop"
    SPEED_LOOP_RING = "ring speed loop"
    JOINT_SUN = "sun joint"
    JOINT_RING = "ring joint"
    CARRIER = "held member in its block"
    MAGNETIC = "magnetic coupling"
    SPEED = "speed of the locked gear"


@dataclass(frozen=True)
class Mode:
    """An eigenvalue [1/s] of the linearised drivetrain and what it is."""

    eigenvalue: complex
    kind: ModeKind

    @property
    def frequency(self) -> float:
        """Undamped angular frequency [rad/s]."""
        return abs(self.eigenvalue)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio; 1 for a mode that does not oscillate."""
        return -self.eigenvalue.real / abs(self.eigenvalue) if self.eigenvalue else 1.0

    @property
    def oscillates(self) -> bool:
        """Whether it is one of a complex pair."""
        return self.eigenvalue.imag != 0.0


@dataclass(frozen=True)
class ControlVerdict:
    """Whether the torque loops are stable as set.

    Parameters
    ----------
    worst : Mode
        The loop or joint mode that decays slowest, or grows fastest.
    stable : bool
        Whether it does not grow, to rounding.
    setting : str
        The sensor and PID setting that was judged.
    """

    worst: Mode
    stable: bool
    setting: str

    @property
    def statement(self) -> str:
        """One sentence for people."""
        rate = abs(self.worst.eigenvalue.real)
        if self.stable:
            return f"Torque loops stable with {self.setting}; slowest is the {self.worst.kind} at {rate:.3g} 1/s."
        return f"Torque loop unstable with {self.setting}: {self.worst.kind} grows at {rate:.3g} 1/s."

    def enforce(self) -> None:
        """Raise BenchError when unstable."""
        if not self.stable:
            raise BenchError(
                f"control: {self.setting}",
                f"{self.worst.kind} grows at {self.worst.eigenvalue.real:.3g} 1/s",
                "torque loops that decay",
                "Use the ideal derivative, a faster derivative filter, a slower sensor, or lower gains.",
            )


@dataclass(frozen=True)
class FrequencyResponse:
    """Answer of the speeds to a set torque, at one steady state.

    Parameters
    ----------
    frequency : (n,) array
        Angular frequency [rad/s].
    speed_sun, speed_ring : (n,) complex array
        Rotor speed per set torque [rad/s per N m].
    resonances : tuple of Mode
        The modes that oscillate, slowest first, each once.
    """

    frequency: Array
    speed_sun: npt.NDArray[np.complex128]
    speed_ring: npt.NDArray[np.complex128]
    resonances: tuple[Mode, ...]


_OWN_KIND = {
    "phase": ModeKind.MAGNETIC,
    "angle_block": ModeKind.CARRIER,
    "speed_carrier": ModeKind.CARRIER,
    "twist_sun": ModeKind.JOINT_SUN,
    "twist_ring": ModeKind.JOINT_RING,
    "current_sun": ModeKind.LOOP_SUN,
    "feedback_sun": ModeKind.LOOP_SUN,
    "current_ring": ModeKind.LOOP_RING,
    "feedback_ring": ModeKind.LOOP_RING,
    "integral_sun": ModeKind.RESET_SUN,
    "integral_ring": ModeKind.RESET_RING,
    "filtered_sun": ModeKind.FILTER_SUN,
    "filtered_ring": ModeKind.FILTER_RING,
    "angle_lag_sun": ModeKind.SPEED_LOOP_SUN,
    "angle_lag_ring": ModeKind.SPEED_LOOP_RING,
}
_LOOPS = frozenset(ModeKind) - {ModeKind.MAGNETIC, ModeKind.SPEED, ModeKind.CARRIER}


def _matrix(drivetrain: Drivetrain, state: Iterable[Number]) -> Array:
    """Jacobian of the states that take part; small motions do not reach the limits of the motors."""
    taking_part = active(drivetrain)
    return dense(drivetrain.unlimited, state)[np.ix_(taking_part, taking_part)]


def linearise(drivetrain: Drivetrain, state: Iterable[Number]) -> tuple[Mode, ...]:
    """Modes at a state, by name, from the slowest to the fastest.

    Notes
    -----
    A mode is named for the state that takes the largest part in it: product of left and right eigenvector, which
    does not depend on the units of the states. A speed is part of its joint in modes faster than the joints relax
    (k/c), and of the locked gear in slower ones.
    """
    found: Any = eig(_matrix(drivetrain, state), left=True, right=True)
    values, left, right = found
    part = active(drivetrain)[np.abs(left.conj() * right).argmax(axis=0)]
    q = drivetrain.constants
    modes = []
    for value, largest in zip(values, part, strict=True):
        name = STATES[largest]
        joint = next((kind for side, kind in _JOINTS.items() if side in name), ModeKind.JOINT_RING)
        by_speed = joint if abs(value) * q.c > q.k else ModeKind.SPEED
        modes.append(Mode(complex(value), _OWN_KIND.get(name, by_speed)))
    return tuple(sorted(modes, key=lambda mode: (abs(mode.eigenvalue), mode.eigenvalue.imag)))


_JOINTS = PerShaft(ModeKind.JOINT_SUN, ModeKind.JOINT_RING)


def check_control(drivetrain: Drivetrain) -> ControlVerdict:
    """Judge the torque loops before a run, on the bench at rest in the middle of its magnetic well.

    They are two to five orders of magnitude faster than all else, so the operating point hardly matters.
    """
    modes = linearise(drivetrain, drivetrain.at_rest(0.0))
    worst = max((mode for mode in modes if mode.kind in _LOOPS), key=lambda mode: mode.eigenvalue.real)
    given, q = drivetrain.assumptions, drivetrain.constants
    filtered = "ideal derivative" if given.derivative_filter is None else f"N = {given.derivative_filter:g} 1/s"
    setting = f"PID {q.K_p:g}/{q.K_i:g}/{q.K_d:g}, {filtered}, sensor lag {given.sensor_lag:g} s"
    rounding = 1e-9 * max(mode.frequency for mode in modes)
    return ControlVerdict(worst, worst.eigenvalue.real <= rounding, setting)


def frequency_response(
    drivetrain: Drivetrain, state: Iterable[Number], frequency: Array, side: str = "sun"
) -> FrequencyResponse:
    r"""Speeds of the rotors per set torque of one motor, ``sun`` or ``ring``.

    Notes
    -----
    :math:`H(j\omega) = (j\omega I - A)^{-1}(b_0 + j\omega b_1)`; b_1 is how the ideal derivative acts on the rate
    of the set torque.
    """
    if side not in SIDES:
        raise BenchError("frequency response: side", side, "sun or ring", "Name the motor whose torque is varied.")
    x, taking_part = State(*state), active(drivetrain)
    unit = SetPoints(**{side: 1.0}), SetPoints(**{f"slope_{side}": 1.0})
    free = drivetrain.unlimited
    still = np.array(free.rates(x, SetPoints()))
    b_0, b_1 = ((np.array(free.rates(x, asked)) - still)[taking_part] for asked in unit)
    s = 1j * np.asarray(frequency, dtype=np.float64)[:, None]
    whole = s[..., None] * np.eye(taking_part.size) - _matrix(drivetrain, x)
    answer = np.asarray(np.linalg.solve(whole, (b_0 + s * b_1)[..., None])[..., 0], dtype=np.complex128)
    resonances = tuple(mode for mode in linearise(drivetrain, x) if mode.eigenvalue.imag > 0.0)
    sun, ring = (
        answer[:, np.flatnonzero(taking_part == STATES.index(name))[0]] for name in ("speed_sun", "speed_ring")
    )
    return FrequencyResponse(frequency, sun, ring, resonances)
