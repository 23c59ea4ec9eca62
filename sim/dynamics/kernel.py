"""The compiled solver of a drivetrain: its equations as machine code, made from the one place they are written in.

Why it stays: against CVODES through CasADi 3.8.2, with the exact sparse Jacobian, at the same tolerance and error,
a run of 20 s takes CasADi 9 times as long, and so does a sweep of 20 runs, its integrator built once.
With the integrator built at each run it is 12 times (`./pmgw bench speed`, where CasADi is installed). CasADi gives
a derivative with respect to a load in 19 times one run; the difference of two runs at a tolerance of 1e-8 takes 1.6
times as long as that, but asks for no further library. Slipped poles, locking and energies are seen at each step here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pmg.sim.dynamics import kernelcache
from pmg.sim.dynamics.equations import Equations
from pmg.sim.dynamics.run_values import Room, Settings, Well
from pmg.sim.dynamics.state import STATES, SetPoints
from pmg.sim.dynamics.structure import survey

if TYPE_CHECKING:
    from types import ModuleType

    from pmg.sim.dynamics.drivetrain import Drivetrain
    from pmg.sim.dynamics.segments import Legs
    from pmg.sim.signals import Array

MOST_SLIPS = 10_000
"""Slipped poles whose times are kept; more are counted only."""

NOTHING_ASKED = np.zeros(len(SetPoints._fields))
"""Set values where they do not matter: no motor is at its limit."""


class SolverRun(NamedTuple):
    """Output of a run of the compiled solver; `ended` is one of the codes of `run_values`."""

    ended: int
    steps: int
    rejected: int
    states: Array
    slips: Array
    locked_at: float
    time: float
    last: Array
    sums: Array


@dataclass(frozen=True)
class Kernel:
    """A drivetrain compiled.

    Parameters
    ----------
    module : module
        The generated functions; drivetrains of equal structure share it.
    integrator : module
        What integrates them; all drivetrains share it.
    parameters : (k,) array
        The numbers of this drivetrain.
    well : Well
        Where the magnetic coupling slips, if there is one.
    """

    module: ModuleType
    integrator: ModuleType
    parameters: Array
    well: Well

    @property
    def equations(self) -> Equations:
        """The generated functions."""
        return Equations(*(getattr(self.module, name) for name in Equations._fields))

    def rates(self, state: Array, asked: Array) -> Array:
        """Time derivative of the state (20,)."""
        return self._evaluated(state, asked)[0]

    def jacobian(self, state: Array, asked: Array = NOTHING_ASKED) -> Array:
        """Its derivative with respect to the state (20, 20), from formulas."""
        whole = np.zeros((state.size, state.size))
        whole[self.module.ROWS, self.module.COLUMNS] = self._evaluated(state, asked)[1]
        return whole

    def sums(self, state: Array) -> Array:
        """The powers that are summed over a run [W]."""
        return self._evaluated(state, NOTHING_ASKED)[2]

    def _evaluated(self, state: Array, asked: Array) -> tuple[Array, Array, Array]:
        """Rates, elements of the Jacobian and powers at a state."""
        found = np.empty(state.size), np.empty(self.module.ENTRIES), np.empty(self.number_of_sums)
        at = (
            np.array(each, dtype=np.float64) for each in (state, asked)
        )  # rows of their own, as compiled code expects
        self.integrator.evaluate(self.equations, *at, self.parameters, *found)
        return found

    @property
    def number_of_sums(self) -> int:
        """Count of powers in the sum."""
        return int(self.module.SUMS)

    def solution(self, state: Array, d: float, right: Array, asked: Array = NOTHING_ASKED) -> Array:
        """Solution x of (d I - J) x = b at a state."""
        x = np.array(right, dtype=np.float64)
        entries = self._evaluated(state, asked)[1]
        self.integrator.solve_stage(self.equations, entries, d, np.empty(self.module.FACTORS), x)
        return x

    def run(self, start: Array, legs: Legs, instants: Array, settings: Settings, *, energy: bool = True) -> SolverRun:
        """Integrate from a start state through the legs; see `rodas.integrate`."""
        last = np.array(start, dtype=np.float64)
        room = Room(
            np.empty((instants.size, start.size)),
            np.zeros(self.number_of_sums if energy else 0),
            np.empty(MOST_SLIPS if self.well.phase >= 0 else 0),
            np.empty(self.module.ENTRIES),
            np.empty(self.module.FACTORS),
        )
        given = self.equations, last, self.parameters, legs, instants, self.well, settings, room
        ended = self.integrator.integrate(*given)
        return SolverRun(
            ended.code,
            ended.steps,
            ended.rejected,
            room.states[: ended.reported],
            room.slips[: min(ended.slipped, room.slips.size)].copy(),
            ended.locked_at,
            ended.time,
            last,
            room.energy,
        )


class _Blueprint:
    """A drivetrain as a key: equal to any other of the same structure."""

    def __init__(self, drivetrain: Drivetrain, structure: str) -> None:
        self.drivetrain, self.structure = drivetrain, structure

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Blueprint) and other.structure == self.structure

    def __hash__(self) -> int:
        return hash(self.structure)


@lru_cache(maxsize=1)
def _integrator() -> ModuleType:
    def make(cache: bool) -> str:
        from pmg.sim.dynamics.codegen import integrator_text  # it loads the symbols' library

        return integrator_text(cache)

    return kernelcache.load_solver("integrator", True, make)


@lru_cache(maxsize=64)
def _module(blueprint: _Blueprint) -> ModuleType:
    own = __name__.rsplit(".", 2)[0] + "."
    parts = (*blueprint.drivetrain.losses, blueprint.drivetrain.coupling)
    lasting = all(part is None or type(part).__module__.startswith(own) for part in parts)

    def make(cache: bool) -> str:
        from pmg.sim.dynamics.codegen import solver_text  # the symbols' library is slow to load and seldom needed
        from pmg.sim.dynamics.tracing import formulas

        return solver_text(formulas(blueprint.drivetrain), cache)

    return kernelcache.load_solver(blueprint.structure, lasting, make)


def kernel_of(drivetrain: Drivetrain) -> Kernel:
    """The compiled solver of a drivetrain.

    The first call for a structure makes and compiles it, which takes seconds; it is kept in the user's cache. Other
    numbers in the same structure cost nothing.
    """
    parameters, structure = survey(drivetrain)
    module = _module(_Blueprint(drivetrain, structure))
    phase = -1 if drivetrain.coupling is None else STATES.index("phase")
    return Kernel(module, _integrator(), np.array(parameters), Well(phase, drivetrain.centre))
