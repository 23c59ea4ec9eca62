"""Terms of a drive's own faults: of the chain from its command to the readings, and of what it makes of a command."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.columns import amount, part, stack
from pmg.pipeline.diagnosis.balance.library.term import DURATION, LAG, Motion, Term
from pmg.sim.sources import BALANCE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.machine.axis import Axis


def chain_terms(axis: Axis) -> Iterator[Term[Motion]]:
    """Faults of the chain from the command to the readings."""
    yield Term(
        "actuator_gain",
        "Gain error of the actuator",
        "g (baseline terms)",
        part("g", "1", 0.3),
        lambda m, _: stack(m.modelled),
        BALANCE,
        separating_test=f"Push with a known {axis.pushes}, or add a known mass",
        of_model=True,
    )
    yield Term(
        "delay",
        f"Delay or lag of the position behind the {axis.pushes} command",
        "baseline terms at t + T, or T d/dt(baseline terms)",
        part("T", "s", 0.02),
        lambda m, _: stack(m.ahead(m.modelled, m.references.get(LAG, 0.0))),
        BALANCE,
        separating_test="Record both signals of one step through one input card",
        of_model=True,
    )


def drift(axis: Axis) -> Term[Motion]:
    """A zero that does not stay."""
    return Term(
        "zero_drift",
        f"Zero of the {axis.pushes} that drifts steadily during each record",
        "z (t/T - 1/2)",
        part("z", axis.push, 1e4),
        lambda m, _: stack(m.elapsed / m.references[DURATION] - 0.5),
        BALANCE,
        separating_test=f"Read the {axis.pushes} at standstill with the coupling open, before and after each record",
        needs_drive=True,
    )


def drive_faults(axis: Axis) -> Iterator[Term[Motion]]:
    """What a drive does with its command."""
    yield Term(
        "dead_zone",
        "Dead zone of the drive: the command must exceed it before anything acts",
        "z sign(baseline terms)",
        amount("z", axis.push, 1e4),
        lambda m, _: stack(np.sign(m.modelled)),
        BALANCE,
        separating_test="Raise the command slowly from zero at a machine that is held, and measure what it exerts",
        of_model=True,
    )
    yield Term(
        "drive_fade",
        f"Drive whose {axis.pushes} fades during each record",
        "f t/T (baseline terms)",
        amount("f", "1", 1.0),
        lambda m, _: stack(m.modelled * m.elapsed / m.references[DURATION]),
        BALANCE,
        separating_test="Repeat the record after a rest and after a long run, and measure the drive's temperature",
        of_model=True,
    )
    yield Term(
        "motor_constant_sag",
        f"Drive whose {axis.pushes} falls behind its command as that grows",
        "s (baseline terms) |baseline terms|",
        part("s", f"1/({axis.push})", 10.0),
        lambda m, _: stack(m.modelled * np.abs(m.modelled)),
        BALANCE,
        separating_test=f"Measure the {axis.pushes} over the command at a machine that is held",
        of_model=True,
    )
