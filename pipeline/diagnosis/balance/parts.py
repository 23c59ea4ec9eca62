"""Parts of a machine in which a term may sit."""

from __future__ import annotations

DRIVE, GUIDE, SENSOR, INPUT, GEAR, OUTPUT = "drive", "friction and load", "position", "input torque", "gear", "output"
ONE_SHAFT, TWO_SHAFTS = (DRIVE, GUIDE, SENSOR), (DRIVE, INPUT, GEAR, OUTPUT)
"""Parts of a machine with one force or torque, and of one between two torques, in the order in which power goes."""

_PARTS = {
    "constant_offset": DRIVE,
    "actuator_gain": DRIVE,
    "dead_zone": DRIVE,
    "drive_fade": DRIVE,
    "drive_limit": DRIVE,
    "motor_constant_sag": DRIVE,
    "zero_drift": DRIVE,
    "delay": SENSOR,
    "input_torque_gain": INPUT,
    "input_torque_lag": INPUT,
    "output_torque_gain": OUTPUT,
    "output_torque_lag": OUTPUT,
    "pulse_of_output": OUTPUT,
    "load_friction": GEAR,
    "load_viscous": GEAR,
}
"""Term -> where it sits."""


def part_of(term: str | None, *, two_torques: bool) -> str:
    """Part in which a term sits: friction and load, or the gear between two torques, where it has none of its own."""
    return _PARTS.get(term or "", GEAR if two_torques else GUIDE)
