"""The library of a geared machine with two torques: friction under load, and faults of either transducer."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.columns import waves_of
from pmg.pipeline.diagnosis.balance.library.drive import ROTARY_DRIVE
from pmg.pipeline.diagnosis.balance.library.term import (
    DELAY,
    INPUT_LAG,
    KNOWN,
    OUT,
    OUT_ANGLE,
    OUTPUT_LAG,
    Motion,
    Quantity,
    Term,
)
from pmg.sim.sources import ARMSTRONG, BALANCE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.sim.signals import Array

OF_A_COMMAND = frozenset(
    {
        "actuator_gain",
        DELAY,
        "dead_zone",
        "drive_fade",
        "drive_limit",
        "motor_constant_sag",
        "load_dependent_friction",
    }
)
"""Terms of a drive that no measured torque has."""

GAINS = {"output_torque_gain": lambda g: 1.0 / (1.0 - g), "input_torque_gain": lambda g: 1.0 + g}
"""Reading over torque for the gain of either transducer."""

GAIN_TEST = "Hang a known weight from a lever on either shaft, or swap the transducers and repeat a run"
ZERO_TEST = "Record both transducers with the couplings open, before and after, and turn slowly in both directions"
LOAD_TEST = "Run the same speeds at four or more loads in both directions of power"
CLOCK_TEST = "Record both torques of one step of the load through one input card"


def _column(values: Array) -> Array:
    return values[:, None]


def _input(m: Motion) -> Array:
    """Torque of the input (n,) [N m] as the output's gives it, with what is known of the machine.

    The recorded one is what is to be explained: as a column it would explain its own noise. What is free of the
    baseline is left out: with the input's gain it grows as a whole.
    """
    return m.besides[KNOWN] - m.besides[OUT]


def _late_input(m: Motion, _: float) -> Array:
    """Its torque with what the baseline gives: in a lag that does not grow with the whole."""
    return _column(-m.ahead(m.modelled - m.besides[OUT], -m.references.get(INPUT_LAG, 0.0)))


def _late_output(m: Motion, _: float) -> Array:
    return _column(-m.ahead(m.besides[OUT], -m.references.get(OUTPUT_LAG, 0.0)))


def _output(m: Motion) -> Array:
    """Torque of the output as the input sees it (n,) [N m]."""
    return m.besides[OUT]


def _transducers() -> Iterator[Term[Motion]]:
    for end, torque in (("input", _input), ("output", _output)):
        yield Term(
            f"{end}_torque_gain",
            f"Gain or conversion of the {end}'s torque transducer",
            f"g T_{end}, g = 1 - 1/factor" if end == "output" else f"g T_{end}, g = factor - 1",
            (Quantity("g", "1", (-1000.0, 1.0) if end == "output" else (-1.0, 1000.0)),),
            lambda m, _, torque=torque: _column(torque(m)),  # type: ignore[misc]  # bound now
            BALANCE,
            separating_test=GAIN_TEST,
            needs=(OUT,),
        )
        yield Term(
            f"{end}_torque_lag",
            f"Lag or delay of the {end}'s torque behind the other",
            f"T_{end} at t - tau, or -tau dT_{end}/dt",
            (Quantity("tau", "s", (0.0, 1.0)),),
            _late_input if end == "input" else _late_output,
            BALANCE,
            separating_test=CLOCK_TEST,
            needs=(OUT,),
        )


def _of_load() -> Iterator[Term[Motion]]:
    yield Term(
        "load_friction",
        "Friction that grows with the transmitted torque",
        "m sign(v) |T_output|",
        (Quantity("m", "1", (0.0, 1.0)),),
        lambda m, _: _column(m.direction * np.abs(m.besides[OUT])),
        ARMSTRONG,
        separating_test=LOAD_TEST,
        needs=(OUT,),
    )
    yield Term(
        "load_viscous",
        "Viscous friction that grows with the transmitted torque",
        "m v |T_output|",
        (Quantity("m", "s/rad", (0.0, 1.0)),),
        lambda m, _: _column(m.speed * np.abs(m.besides[OUT])),
        BALANCE,
        separating_test=LOAD_TEST,
        needs=(OUT,),
    )
    yield Term(
        "pulse_of_output",
        "Torque periodic in the output's turn",
        "A sin(q_output) + B cos(q_output)",
        (Quantity("A", "N m", (-1e4, 1e4)), Quantity("B", "N m", (-1e4, 1e4))),
        lambda m, _: waves_of(m, m.besides[OUT_ANGLE]),
        BALANCE,
        separating_test="Turn slowly through several turns of the output in both directions",
        of_angle=True,
        needs=(OUT_ANGLE,),
    )


def _library() -> tuple[Term[Motion], ...]:
    plain = [term for term in ROTARY_DRIVE if term.identifier not in OF_A_COMMAND]
    zero = {"constant_offset": ("Zero of a torque transducer (either, as the input sees it)", ZERO_TEST)}
    told = [
        replace(t, title=zero[t.identifier][0], separating_test=zero[t.identifier][1]) if t.identifier in zero else t
        for t in plain
    ]
    return (*told, *_of_load(), *_transducers())


TWO_TORQUES = _library()
"""Terms that the torque balance of a gearbox with two transducers may hold."""
