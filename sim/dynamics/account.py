"""Energy that flowed through each element over a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.power import energies, flows

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pmg.sim.dynamics.drivetrain import Drivetrain
    from pmg.sim.signals import Array, Number

WINDINGS = {"sun amplifier": "sun winding", "ring amplifier": "ring winding"}


@dataclass(frozen=True)
class Account:
    """Energies over a stretch of time [J], element by element; the groups are those of `Powers`."""

    supplied: Mapping[str, float]
    stored: Mapping[str, float]
    dissipated: Mapping[str, float]
    created: Mapping[str, float]

    @property
    def inflow(self) -> float:
        """Net energy that came in by supply and was not dissipated [J]; what the stores must have gained."""
        return sum(self.supplied.values()) + sum(self.created.values()) - sum(self.dissipated.values())

    @property
    def turnover(self) -> float:
        """Sum of the magnitudes of supplied, created and dissipated energies [J]."""
        return sum(abs(value) for group in (self.supplied, self.created, self.dissipated) for value in group.values())

    @property
    def residual(self) -> float:
        """Imbalance of the account, relative to the turnover."""
        return (self.inflow - sum(self.stored.values())) / self.turnover if self.turnover else 0.0


def _names_of_flows(drivetrain: Drivetrain) -> tuple[tuple[str, ...], ...]:
    """Names of the flows in the order of `integrands`, by group."""
    found = flows(drivetrain, drivetrain.at_rest())
    return tuple(tuple(group) for group in found)


def integrand_parts(drivetrain: Drivetrain, state: Iterable[Number]) -> list[Number]:
    """Powers that are summed over a run [W], one after the other."""
    return [value for group in flows(drivetrain, state) for value in group.values()]


def integrands(drivetrain: Drivetrain, state: Iterable[Array]) -> Array:
    """The same at many instants: one row for each flow."""
    return np.array(np.broadcast_arrays(*integrand_parts(drivetrain, state)), dtype=np.float64)


def settle(drivetrain: Drivetrain, begin: Array, end: Array, sums: Array) -> Account:
    """Account of a run from its first and last state and the sums over time of its `integrands` [J].

    Notes
    -----
    Stores are read from the two states. What an amplifier supplied is what its winding passed on and burnt plus
    what the winding gained: the voltage itself, a derivative multiplied by 10^6 1/s, is no quantity to sum between
    steps. All other elements are independent of each other, so their balance is a check.
    """
    before, after = energies(drivetrain, begin.tolist()), energies(drivetrain, end.tolist())
    stored = {name: float(after[name] - before[name]) for name in after}
    drawn_names, dissipated_names, created_names = _names_of_flows(drivetrain)
    drawn, dissipated, created = np.split(sums, np.cumsum([len(drawn_names), len(dissipated_names)]))
    supplied = {name: float(value) + stored[WINDINGS[name]] for name, value in zip(drawn_names, drawn, strict=True)}
    return Account(
        supplied,
        stored,
        dict(zip(dissipated_names, dissipated.tolist(), strict=True)),
        dict(zip(created_names, created.tolist(), strict=True)),
    )
