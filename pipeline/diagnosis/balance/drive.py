"""The library of a drive on a slide: every term that its force balance may hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.term import Motion, Quantity, Term
from pmg.sim.signals import REVOLUTION
from pmg.sim.sources import ARMSTRONG, BALANCE, DAHL, Source

if TYPE_CHECKING:
    from pmg.sim.signals import Array

EMPS = Source(
    "emps",
    "A. Janot, M. Gautier, M. Brunot, 'Data Set and Reference Models of EMPS', Workshop on Nonlinear System "
    "Identification Benchmarks, 2019",
)

REST_TEST = (
    "Record the force command with the drive switched off and with the carriage held at rest, creep through zero speed "
    "in both directions, and turn the slide around: an offset of the drive stays, friction changes sign or vanishes"
)
POSITION_TEST = (
    "Pass the same places slowly in both directions: friction changes sign with direction, a force at a place does not"
)
SPEED_TEST = "Run at eight or more constant speeds in both directions, in random order"


def _stack(*columns: Array) -> Array:
    return np.stack(columns, axis=1)


def _middle(values: Array) -> float:
    return 0.5 * float(values.min() + values.max())


def _periodic(m: Motion, period: float) -> Array:
    angle = REVOLUTION * m.position / period
    return _stack(np.sin(angle), np.cos(angle))


def _part(name: str, unit: str, most: float) -> tuple[Quantity]:
    """A single amplitude of either sign."""
    return (Quantity(name, unit, (-most, most)),)


def _amount(name: str, unit: str, most: float) -> tuple[Quantity]:
    """A single amplitude that is not negative."""
    return (Quantity(name, unit, (0.0, most)),)


RIPPLE = _part("A", "N", 1e4) + _part("B", "N", 1e4)
PERIOD = Quantity("p", "m", (2e-3, 1e-1), 3.0)

DRIVE: tuple[Term[Motion], ...] = (
    Term("inertia", "Inertia", "M a", _amount("M", "kg", 1e5), lambda m, _: _stack(m.acceleration), EMPS),
    Term("viscous", "Viscous friction", "b v", _amount("b", "N s/m", 1e6), lambda m, _: _stack(m.speed), EMPS),
    Term(
        "coulomb",
        "Coulomb friction",
        "Fc sign(v)",
        _amount("Fc", "N", 1e5),
        lambda m, _: _stack(m.direction),
        EMPS,
        separating_test=SPEED_TEST,
    ),
    Term(
        "constant_offset",
        "Constant offset of the drive",
        "F0",
        _part("F0", "N", 1e4),
        lambda m, _: _stack(np.ones_like(m.speed)),
        EMPS,
        separating_test=REST_TEST,
    ),
    Term(
        "direction_dependent_coulomb",
        "Coulomb friction that depends on direction",
        "(F+ - F-)/2 |sign(v)|",
        _part("half_difference", "N", 1e4),
        lambda m, _: _stack(np.abs(m.direction)),
        EMPS,
        separating_test=REST_TEST,
    ),
    Term(
        "direction_dependent_viscous",
        "Viscous friction that depends on direction",
        "(b+ - b-)/2 |v|",
        _part("half_difference", "N s/m", 1e6),
        lambda m, _: _stack(np.abs(m.speed)),
        EMPS,
        separating_test=SPEED_TEST,
    ),
    Term(
        "stribeck",
        "Extra friction at low speed (Stribeck)",
        "Fs sign(v) exp(-|v|/vs)",
        _amount("Fs", "N", 1e4),
        lambda m, speed: _stack(m.direction * np.exp(-np.abs(m.speed) / speed)),
        ARMSTRONG,
        shape=Quantity("vs", "m/s", (1e-3, 1e-1)),
        separating_test=SPEED_TEST,
    ),
    Term(
        "presliding",
        "Friction that rises over a length after reversal (Dahl)",
        "-Fd sign(v) exp(-travel/x0)",
        _amount("Fd", "N", 1e4),
        lambda m, length: _stack(-np.sign(m.speed) * np.exp(-m.travel / length)),
        DAHL,
        shape=Quantity("x0", "m", (1e-6, 1e-2)),
        separating_test="Reverse slowly over strokes shorter and longer than the length of rise",
    ),
    Term(
        "position_ripple",
        "Force periodic in position (cogging, screw pitch)",
        "A sin(2 pi q/p) + B cos(2 pi q/p)",
        RIPPLE,
        _periodic,
        BALANCE,
        shape=PERIOD,
        separating_test=POSITION_TEST,
        even_grid=True,
    ),
    Term(
        "friction_ripple",
        "Friction periodic in position",
        "sign(v) (A sin(2 pi q/p) + B cos(2 pi q/p))",
        RIPPLE,
        lambda m, period: m.direction[:, None] * _periodic(m, period),
        BALANCE,
        shape=PERIOD,
        separating_test=POSITION_TEST,
        even_grid=True,
    ),
    Term(
        "friction_along_slide",
        "Friction that changes along the slide",
        "c sign(v) (q - qm)",
        _part("c", "N/m", 1e5),
        lambda m, _: _stack(m.direction * (m.position - _middle(m.position))),
        BALANCE,
        separating_test=POSITION_TEST,
    ),
    Term(
        "spring",
        "Spring or cable, linear in position",
        "k (q - qm)",
        _part("k", "N/m", 1e5),
        lambda m, _: _stack(m.position - _middle(m.position)),
        BALANCE,
        separating_test=POSITION_TEST,
    ),
    Term(
        "load_dependent_friction",
        "Friction that grows with the force of acceleration",
        "m sign(v) |a|",
        _amount("m", "kg", 1e4),
        lambda m, _: _stack(m.direction * np.abs(m.acceleration)),
        ARMSTRONG,
        separating_test="Repeat with a known mass added to the carriage",
    ),
    Term(
        "quadratic_drag",
        "Drag that grows as speed squared",
        "d v |v|",
        _amount("d", "N s2/m2", 1e6),
        lambda m, _: _stack(m.speed * np.abs(m.speed)),
        BALANCE,
        separating_test=SPEED_TEST,
    ),
    Term(
        "warming",
        "Viscous friction that falls during the record",
        "-w v t/T",
        _amount("w", "N s/m", 1e6),
        lambda m, _: _stack(-m.speed * (m.time - m.time[0]) / (m.time[-1] - m.time[0])),
        BALANCE,
        separating_test="Repeat the record after a rest and after a long run",
    ),
    Term(
        "actuator_gain",
        "Gain error of the actuator",
        "g (baseline terms)",
        _part("g", "1", 0.3),
        lambda m, _: _stack(m.modelled),
        BALANCE,
        separating_test="Push with a known force, or add a known mass",
        of_model=True,
    ),
    Term(
        "delay",
        "Delay of the position behind the force command",
        "T d/dt(baseline terms)",
        _part("T", "s", 0.02),
        lambda m, _: _stack(np.gradient(m.modelled, m.sample_time)),
        BALANCE,
        separating_test="Record both signals of one step through one input card",
        of_model=True,
    ),
)
"""Terms that a case file may take as baseline or leave to the search."""

LIBRARIES: dict[str, tuple[Term[Motion], ...]] = {"drive": DRIVE}
"""Libraries by the name that a case file gives."""
