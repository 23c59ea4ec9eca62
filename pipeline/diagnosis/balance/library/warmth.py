"""The term of a recorded temperature."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.balance.library.term import TEMPERATURE, WARMTH, Motion, Quantity, Term
from pmg.sim.sources import BALANCE

if TYPE_CHECKING:
    from pmg.pipeline.machine.axis import Axis
    from pmg.sim.signals import Array


def warm_term(axis: Axis) -> Term[Motion]:
    """Friction that goes with a temperature which was recorded."""

    def column(m: Motion, _: float) -> Array:
        return (-m.speed * (m.besides[TEMPERATURE] - m.references[WARMTH]))[:, None]

    return Term(
        "viscous_of_temperature",
        "Viscous friction that falls with the recorded temperature",
        "-w v (theta - theta_1)",
        (Quantity("w", f"{axis.viscous}/K", (-1e4, 1e4)),),
        column,
        BALANCE,
        separating_test="Repeat the same speeds cold and warm",
        needs=(TEMPERATURE,),
    )
