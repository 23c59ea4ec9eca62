"""Energy that flowed through each element over a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.power import powers

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pmg.sim.dynamics.drivetrain import Drivetrain
    from pmg.sim.dynamics.state import SetTorques
    from pmg.sim.signals import Array

_NODES = np.array([(4.0 - np.sqrt(6.0)) / 10.0, (4.0 + np.sqrt(6.0)) / 10.0, 1.0])
_WEIGHTS = np.array([(16.0 - np.sqrt(6.0)) / 36.0, (16.0 + np.sqrt(6.0)) / 36.0, 1.0 / 9.0])


@dataclass(frozen=True)
class Account:
    """Energies over a stretch of time [J], element by element; the groups are those of `Powers`."""

    supplied: Mapping[str, float]
    stored: Mapping[str, float]
    dissipated: Mapping[str, float]
    created: Mapping[str, float]

    def __add__(self, later: Account) -> Account:
        """Both stretches together."""
        return Account(*(_sum(getattr(self, group), getattr(later, group)) for group in _GROUPS))

    @property
    def inflow(self) -> float:
        """Net energy that came in by supply and was not dissipated [J]; what the stores must have gained."""
        return sum(self.supplied.values()) + sum(self.created.values()) - sum(self.dissipated.values())

    @property
    def turnover(self) -> float:
        """Sum of the magnitudes of supplied, created and dissipated energies [J]."""
        return sum(abs(value) for group in (self.supplied, self.created, self.dissipated) for value in group.values())


_GROUPS = ("supplied", "stored", "dissipated", "created")


def _sum(one: Mapping[str, float], other: Mapping[str, float]) -> dict[str, float]:
    return {name: one.get(name, 0.0) + other.get(name, 0.0) for name in {**one, **other}}


def account(
    drivetrain: Drivetrain, steps: Array, solution: Callable[[Array], Array], asked: Callable[[Array], SetTorques]
) -> Account:
    """Energies over a run of the three-stage Radau method.

    Parameters
    ----------
    drivetrain : Drivetrain
        What was run.
    steps : (n,) array
        Ends of the integrator's steps [s].
    solution : callable
        Its own interpolant, the collocation polynomial of each step.
    asked : callable
        Set torques at given times.

    Notes
    -----
    Summed at the collocation points of the steps with the method's own weights. Only there does the state meet the
    equations of motion to rounding; between them the amplifier's voltage, a derivative multiplied by 10^6 1/s,
    shows the interpolant's error and not the bench.
    """
    h = np.diff(steps)
    times = (steps[:-1, None] + h[:, None] * _NODES).ravel()
    weights = (h[:, None] * _WEIGHTS).ravel()
    flow = powers(drivetrain, solution(times), asked(times))
    return Account(
        *({name: float(np.sum(weights * value)) for name, value in getattr(flow, group).items()} for group in _GROUPS)
    )
