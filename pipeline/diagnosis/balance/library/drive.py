"""The library of a drive that slides or turns: every term that its force or torque balance may hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.columns import (
    RIPPLE,
    SECOND_RIPPLE,
    SETTLES,
    amount,
    part,
    settling,
    stack,
    waves_of,
)
from pmg.pipeline.diagnosis.balance.library.drive_faults import chain_terms, drift, drive_faults
from pmg.pipeline.diagnosis.balance.library.elastic import elastic_terms, gap_terms
from pmg.pipeline.diagnosis.balance.library.term import DURATION, MIDDLE, Motion, Quantity, Term
from pmg.pipeline.machine.axis import LINEAR, ROTARY
from pmg.sim.signals import REVOLUTION
from pmg.sim.sources import ANDERSSON, ARMSTRONG, BALANCE, DAHL, Source

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.machine.axis import Axis
    from pmg.sim.signals import Array

EMPS = Source(
    "emps",
    "A. Janot, M. Gautier, M. Brunot, 'Data Set and Reference Models of EMPS', Workshop on Nonlinear System "
    "Identification Benchmarks, 2019",
)

REST_TEST = (
    "Record the command at rest with the drive switched off (`zero` of [records] takes it), creep through zero speed "
    "in both directions, and turn the machine around: an offset of the drive stays, friction changes sign or vanishes"
)
POSITION_TEST = (
    "Pass the same places slowly in both directions: friction changes sign with direction, a force at a place does not"
)
SPEED_TEST = "Run at eight or more constant speeds in both directions, in random order"
WIDEST_BELL = 0.5
"""Width of a bell over speed, over the largest of an exponential: a wider one is level where a machine is slow, as dry
friction is."""
REPEAT_TEST = "Repeat the record after a rest and after a long run"


def _periodic(m: Motion, period: float) -> Array:
    return waves_of(m, REVOLUTION * m.position / period)


def _ripple(axis: Axis) -> tuple[Quantity, Quantity]:
    return (*part("A", axis.push, 1e4), *part("B", axis.push, 1e4))


def _plain_terms(axis: Axis) -> Iterator[Term[Motion]]:
    """Inertia, friction by speed and direction, and a constant."""
    yield Term(
        "inertia",
        "Inertia",
        "M a",
        amount("M", axis.mass, 1e5),
        lambda m, _: stack(m.acceleration),
        EMPS,
        needs_drive=True,
    )
    yield Term("viscous", "Viscous friction", "b v", amount("b", axis.viscous, 1e6), lambda m, _: stack(m.speed), EMPS)
    yield Term(
        "coulomb",
        "Coulomb friction",
        "Fc sign(v)",
        amount("Fc", axis.push, 1e5),
        lambda m, _: stack(m.direction),
        EMPS,
        separating_test=SPEED_TEST,
    )
    yield Term(
        "constant_offset",
        "Constant offset of the drive",
        "F0",
        part("F0", axis.push, 1e4),
        lambda m, _: stack(np.ones_like(m.speed)),
        EMPS,
        separating_test=REST_TEST,
        needs_drive=True,
    )
    yield Term(
        "direction_dependent_coulomb",
        "Coulomb friction that depends on direction",
        "(F+ - F-)/2 |sign(v)|",
        part("half_difference", axis.push, 1e4),
        lambda m, _: stack(np.abs(m.direction)),
        EMPS,
        separating_test=REST_TEST,
        both_ways=True,
    )
    yield Term(
        "direction_dependent_viscous",
        "Viscous friction that depends on direction",
        "(b+ - b-)/2 |v|",
        part("half_difference", axis.viscous, 1e6),
        lambda m, _: stack(np.abs(m.speed)),
        EMPS,
        separating_test=SPEED_TEST,
        both_ways=True,
    )


def _stribeck_terms(axis: Axis) -> Iterator[Term[Motion]]:
    """Friction that falls as speed rises from rest: by an exponential, and by a bell."""
    yield Term(
        "stribeck",
        "Extra friction at low speed (Stribeck)",
        "Fs sign(v) exp(-|v|/vs)",
        amount("Fs", axis.push, 1e4),
        lambda m, speed: stack(m.direction * np.exp(-np.abs(m.speed) / speed)),
        ARMSTRONG,
        shape=Quantity("vs", axis.speed, axis.stribeck),
        separating_test=SPEED_TEST,
    )
    yield Term(
        "stribeck",
        "Extra friction at low speed (Stribeck)",
        "Fs sign(v) exp(-(v/vs)2)",
        amount("Fs", axis.push, 1e4),
        lambda m, speed: stack(m.direction * np.exp(-((m.speed / speed) ** 2))),
        ARMSTRONG,
        shape=Quantity("vs", axis.speed, (axis.stribeck[0], WIDEST_BELL * axis.stribeck[1])),
        separating_test=SPEED_TEST,
        variant="bell",
    )


def _terms_of_reversal(axis: Axis) -> Iterator[Term[Motion]]:
    """What happens about a reversal: friction rises over a way or a speed."""
    yield Term(
        "presliding",
        "Friction that rises over a way after reversal (Dahl)",
        "-Fd sign(v) exp(-travel/x0)",
        amount("Fd", axis.push, 1e4),
        lambda m, length: stack(-m.sense * np.exp(-m.travel / length)),
        DAHL,
        shape=Quantity("x0", axis.length, axis.presliding),
        separating_test="Reverse slowly over strokes shorter and longer than the length of rise",
    )
    yield Term(
        "rounded_friction",
        "Coulomb friction that is smooth about standstill",
        "-Fr sign(v) (1 - tanh(|v|/vr))",
        amount("Fr", axis.push, 1e4),
        lambda m, speed: stack(-m.direction * (1.0 - np.tanh(np.abs(m.speed) / speed))),
        ANDERSSON,
        shape=Quantity("vr", axis.speed, axis.stribeck),
        separating_test="Reverse slowly and fast: the way over which friction rises shrinks if it rises over a speed",
    )


def _curved_terms(axis: Axis) -> Iterator[Term[Motion]]:
    """Friction that changes with load, a power of speed, or time."""
    yield Term(
        "load_dependent_friction",
        f"Friction that grows with the {axis.pushes} of acceleration",
        "m sign(v) |a|",
        amount("m", axis.mass, 1e4),
        lambda m, _: stack(m.direction * np.abs(m.acceleration)),
        ARMSTRONG,
        separating_test="Repeat with a known mass added",
        needs_drive=True,
    )
    yield Term(
        "drag_of_power",
        "Drag that goes with a power of speed",
        f"d sign(v) |v/v1|^n, v1 = 1 {axis.speed}",
        part("d", axis.push, 1e6),
        lambda m, power: stack(np.sign(m.speed) * np.abs(m.speed) ** power),
        BALANCE,
        shape=Quantity("n", "1", (0.2, 4.0)),
        separating_test=SPEED_TEST,
    )
    yield Term(
        "warming",
        "Viscous friction that falls during the record",
        "-w v t/T",
        amount("w", axis.viscous, 1e6),
        lambda m, _: stack(-m.speed * m.elapsed / m.references[DURATION]),
        BALANCE,
        separating_test=REPEAT_TEST,
    )
    yield Term(
        "warming",
        "Viscous friction that falls during the record and settles",
        "-w v (1 - exp(-t/(s T)))/(1 - exp(-1/s))",
        amount("w", axis.viscous, 1e6),
        lambda m, settles: stack(-m.speed * settling(m, settles)),
        BALANCE,
        shape=SETTLES,
        separating_test=REPEAT_TEST,
        variant="settling",
    )


def _placed_terms(axis: Axis) -> Iterator[Term[Motion]]:
    """What changes with position."""
    period = Quantity("p", axis.length, axis.periods, 3.0)
    pushes = axis.pushes.capitalize()
    titles = {RIPPLE: pushes, SECOND_RIPPLE: f"{pushes} of a second period,"}
    for identifier, what in titles.items():
        yield Term(
            identifier,
            f"{what} periodic in position (cogging, screw pitch, unbalance)",
            "A sin(2 pi q/p) + B cos(2 pi q/p)",
            _ripple(axis),
            _periodic,
            BALANCE,
            shape=period,
            separating_test=POSITION_TEST,
            even_grid=True,
            of_angle=True,
        )
    yield Term(
        "friction_ripple",
        "Friction periodic in position",
        "sign(v) (A sin(2 pi q/p) + B cos(2 pi q/p))",
        _ripple(axis),
        lambda m, length: m.direction[:, None] * _periodic(m, length),
        BALANCE,
        shape=period,
        separating_test=POSITION_TEST,
        even_grid=True,
        both_ways=True,
        of_angle=True,
    )
    yield Term(
        "friction_along_slide",
        f"Friction that changes along the {axis.along}",
        "c sign(v) (q - qm)",
        part("c", axis.stiffness, 1e5),
        lambda m, _: stack(m.direction * (m.position - m.references[MIDDLE])),
        BALANCE,
        separating_test=POSITION_TEST,
        both_ways=True,
    )
    yield Term(
        "spring",
        "Spring or cable, linear in position",
        "k (q - qm)",
        part("k", axis.stiffness, 1e5),
        lambda m, _: stack(m.position - m.references[MIDDLE]),
        BALANCE,
        separating_test=POSITION_TEST,
    )


def _drive_terms(axis: Axis) -> tuple[Term[Motion], ...]:
    """Every term of a drive, in the units of its axis."""
    plain = (*_plain_terms(axis), *_stribeck_terms(axis), *_terms_of_reversal(axis), *_curved_terms(axis))
    return (
        *plain,
        *_placed_terms(axis),
        *gap_terms(axis),
        *elastic_terms(axis),
        *drift(axis),
        *chain_terms(axis),
        *drive_faults(axis),
    )


DRIVE, ROTARY_DRIVE = _drive_terms(LINEAR), _drive_terms(ROTARY)
"""Terms that a case file may take as baseline or leave to the search."""

LIBRARIES: dict[str, tuple[Axis, tuple[Term[Motion], ...]]] = {
    "drive": (LINEAR, DRIVE),
    "rotary_drive": (ROTARY, ROTARY_DRIVE),
}
"""Axis and terms of each library by the name that a case file gives."""
