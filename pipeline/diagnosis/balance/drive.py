"""The library of a drive on a slide: every term that its force balance may hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.term import Motion, Quantity, Term
from pmg.sim.signals import REVOLUTION
from pmg.sim.sources import ARMSTRONG, Source

if TYPE_CHECKING:
    from pmg.sim.signals import Array

EMPS = Source(
    "emps",
    "A. Janot, M. Gautier, M. Brunot, 'Data Set and Reference Models of EMPS', Workshop on Nonlinear System "
    "Identification Benchmarks, 2019",
)
DAHL = Source("dahl", "P. R. Dahl, 'A solid friction model', Aerospace Corporation, TOR-0158(3107-18)-1, 1968")
BALANCE = Source("force-balance", "Force balance of a carriage; a term written down for this library")

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


def _inertia(m: Motion, _: float) -> Array:
    return _stack(m.acceleration)


def _viscous(m: Motion, _: float) -> Array:
    return _stack(m.speed)


def _coulomb(m: Motion, _: float) -> Array:
    return _stack(m.direction)


def _offset(m: Motion, _: float) -> Array:
    return _stack(np.ones_like(m.speed))


def _one_sided_coulomb(m: Motion, _: float) -> Array:
    return _stack(np.abs(m.direction))


def _one_sided_viscous(m: Motion, _: float) -> Array:
    return _stack(np.abs(m.speed))


def _stribeck(m: Motion, speed: float) -> Array:
    return _stack(m.direction * np.exp(-np.abs(m.speed) / speed))


def _presliding(m: Motion, length: float) -> Array:
    return _stack(-np.sign(m.speed) * np.exp(-m.travel / length))


def _periodic(m: Motion, period: float) -> Array:
    angle = REVOLUTION * m.position / period
    return _stack(np.sin(angle), np.cos(angle))


def _periodic_friction(m: Motion, period: float) -> Array:
    return m.direction[:, None] * _periodic(m, period)


def _friction_along(m: Motion, _: float) -> Array:
    return _stack(m.direction * (m.position - _middle(m.position)))


def _spring(m: Motion, _: float) -> Array:
    return _stack(m.position - _middle(m.position))


def _load(m: Motion, _: float) -> Array:
    return _stack(m.direction * np.abs(m.acceleration))


def _quadratic(m: Motion, _: float) -> Array:
    return _stack(m.speed * np.abs(m.speed))


def _warming(m: Motion, _: float) -> Array:
    return _stack(-m.speed * (m.time - m.time[0]) / (m.time[-1] - m.time[0]))


def _gain(m: Motion, _: float) -> Array:
    return _stack(m.modelled)


def _delay(m: Motion, _: float) -> Array:
    return _stack(np.gradient(m.modelled, m.sample_time))


DRIVE: tuple[Term, ...] = (
    Term("inertia", "Inertia", "M a", (Quantity("M", "kg", (0.0, 1e5)),), _inertia, EMPS),
    Term("viscous", "Viscous friction", "b v", (Quantity("b", "N s/m", (0.0, 1e6)),), _viscous, EMPS),
    Term(
        "coulomb",
        "Coulomb friction",
        "Fc sign(v)",
        (Quantity("Fc", "N", (0.0, 1e5)),),
        _coulomb,
        EMPS,
        separating_test=SPEED_TEST,
    ),
    Term(
        "constant_offset",
        "Constant offset of the drive",
        "F0",
        (Quantity("F0", "N", (-1e4, 1e4)),),
        _offset,
        EMPS,
        separating_test=REST_TEST,
    ),
    Term(
        "direction_dependent_coulomb",
        "Coulomb friction that depends on direction",
        "(F+ - F-)/2 |sign(v)|",
        (Quantity("half_difference", "N", (-1e4, 1e4)),),
        _one_sided_coulomb,
        EMPS,
        separating_test=REST_TEST,
    ),
    Term(
        "direction_dependent_viscous",
        "Viscous friction that depends on direction",
        "(b+ - b-)/2 |v|",
        (Quantity("half_difference", "N s/m", (-1e6, 1e6)),),
        _one_sided_viscous,
        EMPS,
        separating_test=SPEED_TEST,
    ),
    Term(
        "stribeck",
        "Extra friction at low speed (Stribeck)",
        "Fs sign(v) exp(-|v|/vs)",
        (Quantity("Fs", "N", (0.0, 1e4)),),
        _stribeck,
        ARMSTRONG,
        shape=Quantity("vs", "m/s", (1e-3, 1e-1)),
        separating_test=SPEED_TEST,
    ),
    Term(
        "presliding",
        "Friction that rises over a length after reversal (Dahl)",
        "-Fd sign(v) exp(-travel/x0)",
        (Quantity("Fd", "N", (0.0, 1e4)),),
        _presliding,
        DAHL,
        shape=Quantity("x0", "m", (1e-6, 1e-2)),
        separating_test="Reverse slowly over strokes shorter and longer than the length of rise",
    ),
    Term(
        "position_ripple",
        "Force periodic in position (cogging, screw pitch)",
        "A sin(2 pi q/p) + B cos(2 pi q/p)",
        (Quantity("A", "N", (-1e4, 1e4)), Quantity("B", "N", (-1e4, 1e4))),
        _periodic,
        BALANCE,
        shape=Quantity("p", "m", (2e-3, 1e-1), 3.0),
        separating_test=POSITION_TEST,
        even_grid=True,
    ),
    Term(
        "friction_ripple",
        "Friction periodic in position",
        "sign(v) (A sin(2 pi q/p) + B cos(2 pi q/p))",
        (Quantity("A", "N", (-1e4, 1e4)), Quantity("B", "N", (-1e4, 1e4))),
        _periodic_friction,
        BALANCE,
        shape=Quantity("p", "m", (2e-3, 1e-1), 3.0),
        separating_test=POSITION_TEST,
        even_grid=True,
    ),
    Term(
        "friction_along_slide",
        "Friction that changes along the slide",
        "c sign(v) (q - qm)",
        (Quantity("c", "N/m", (-1e5, 1e5)),),
        _friction_along,
        BALANCE,
        separating_test=POSITION_TEST,
    ),
    Term(
        "spring",
        "Spring or cable, linear in position",
        "k (q - qm)",
        (Quantity("k", "N/m", (-1e5, 1e5)),),
        _spring,
        BALANCE,
        separating_test=POSITION_TEST,
    ),
    Term(
        "load_dependent_friction",
        "Friction that grows with the force of acceleration",
        "m sign(v) |a|",
        (Quantity("m", "kg", (0.0, 1e4)),),
        _load,
        ARMSTRONG,
        separating_test="Repeat with a known mass added to the carriage",
    ),
    Term(
        "quadratic_drag",
        "Drag that grows as speed squared",
        "d v |v|",
        (Quantity("d", "N s2/m2", (0.0, 1e6)),),
        _quadratic,
        BALANCE,
        separating_test=SPEED_TEST,
    ),
    Term(
        "warming",
        "Viscous friction that falls during the record",
        "-w v t/T",
        (Quantity("w", "N s/m", (0.0, 1e6)),),
        _warming,
        BALANCE,
        separating_test="Repeat the record after a rest and after a long run",
    ),
    Term(
        "actuator_gain",
        "Gain error of the actuator",
        "g (baseline terms)",
        (Quantity("g", "1", (-0.3, 0.3)),),
        _gain,
        BALANCE,
        separating_test="Push with a known force, or add a known mass",
        of_model=True,
    ),
    Term(
        "delay",
        "Delay of the position behind the force command",
        "T d/dt(baseline terms)",
        (Quantity("T", "s", (-0.02, 0.02)),),
        _delay,
        BALANCE,
        separating_test="Record both signals of one step through one input card",
        of_model=True,
    ),
)
"""Terms that a case file may take as baseline or leave to the search."""

LIBRARIES: dict[str, tuple[Term, ...]] = {"drive": DRIVE}
"""Libraries by the name that a case file gives."""
