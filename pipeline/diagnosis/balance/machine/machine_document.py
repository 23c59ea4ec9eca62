"""What was found of a machine beyond its terms, as JSON: its losses, and the numbers of its file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.fit.document import number

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.machine.found_and_stated import FoundAndStated
    from pmg.pipeline.diagnosis.balance.machine.power import SteadyPoint
    from pmg.pipeline.machine.machine import Machine


def machine_document(
    machine: Machine, points: tuple[SteadyPoint, ...], compared: tuple[FoundAndStated, ...]
) -> dict[str, Any]:
    """Operating points [rad/s, N m, W, parts of 1] and numbers as stated and as found [SI]."""
    return {
        "machine": {
            "title": machine.title,
            "shafts": list(machine.shafts),
            "gear": None if machine.gear is None else {"kind": machine.gear.kind, "ratio": machine.gear.ratio},
        },
        "steady_points": [
            {
                "speed_input_rad_s": p.speed,
                "torque_input_Nm": p.torque_input,
                "torque_output_Nm": p.torque_output,
                "loss_W": p.loss,
                "u_loss_W": p.u_loss,
                "u_loss_by_repetition_W": p.u_repeat,
                "efficiency": number(p.efficiency),
                "u_efficiency": number(p.u_efficiency),
                "above_one": p.above_one,
                "seconds": p.seconds,
                "visits": p.visits,
            }
            for p in points
        ],
        "stated_and_found": [
            {
                "number": row.name,
                "unit": row.stated.unit,
                "stated": row.stated.value,
                "u_stated": row.stated.u,
                "found": row.found,
                "standard_error": number(row.standard_error),
                "apart": number(row.apart),
                "differs": row.differs,
                "source": row.stated.source,
            }
            for row in compared
        ],
    }
