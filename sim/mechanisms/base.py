"""Mechanisms: equation, parameters and the experiments that reveal them, declared once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import reduce
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from pmg.sim.errors import BenchError
from pmg.sim.grid import Configuration
from pmg.sim.shafts import PerShaft
from pmg.sim.signals import TORQUES

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array, Number, Signal
    from pmg.sim.sources import Source


BOTH_TORQUES = tuple(TORQUES)
"""Signals of a mechanism that acts on both shafts."""


class Component(StrEnum):
    """Where on the bench a mechanism sits."""

    SUN_BEARINGS = "sun_bearings"
    RING_BEARINGS = "ring_bearings"
    RELATIVE_BEARING = "relative_bearing"
    MAGNETIC_GEAR = "magnetic_gear"
    SUN_MOTOR = "sun_motor"
    RING_MOTOR = "ring_motor"
    SUN_COUPLING = "sun_coupling"
    RING_COUPLING = "ring_coupling"
    SUN_TORQUE_TRANSDUCER = "sun_torque_transducer"
    RING_TORQUE_TRANSDUCER = "ring_torque_transducer"
    SUN_ENCODER = "sun_encoder"
    RING_ENCODER = "ring_encoder"


class LawCovariate(StrEnum):
    """Quantities that laws are smooth functions of."""

    SPEED = "speed"
    LOAD = "load"
    SLIP = "slip"
    DIFFERENCE = "difference"
    TIME = "time"


class Experiment(StrEnum):
    """Tests the bench can run."""

    NEUTRAL_SWEEP = "neutral_sweep"
    ENGAGED_LOADS = "engaged_loads"
    REVERSED_FLOW = "reversed_flow"
    REVERSED_ROTATION = "reversed_rotation"
    REPEATS = "repeats"
    ZERO_CHECKS = "zero_checks"
    OTHER_STAGE = "other_stage"


@dataclass(frozen=True)
class Reveals:
    """An experiment and the trace a mechanism leaves in it."""

    experiment: Experiment
    trace: str


@dataclass(frozen=True)
class Parameter:
    """A physical constant of a mechanism.

    Parameters
    ----------
    name, unit, meaning : str
        As in the equation.
    bounds : tuple of float
        Physical range, in `unit`.
    typical : float
        A value of the usual size.
    null : float
        Value at which the mechanism vanishes.
    """

    name: str
    unit: str
    meaning: str
    bounds: tuple[float, float]
    typical: float
    null: float


def parameter(unit: str, *, bounds: tuple[float, float], typical: float, meaning: str, null: float = 0.0) -> Any:  # noqa: ANN401
    """Declare a parameter as a dataclass field; its default is the null, so the mechanism is absent."""
    return field(
        default=null,
        metadata={"unit": unit, "bounds": bounds, "typical": typical, "meaning": meaning, "null": null},
    )


@dataclass(frozen=True)
class Torques(PerShaft["Array"]):
    """Torques that a mechanism puts on the two rotors [N m], positive in the positive direction of rotation."""

    def __add__(self, other: Torques) -> Torques:
        """Both together."""
        return Torques(self.sun + other.sun, self.ring + other.ring)

    def power(self, at: OperatingPoints) -> Array:
        """Power given to the rotors [W]; negative for a loss."""
        return self.sun * at.speed_sun + self.ring * at.speed_ring


class Warmth(NamedTuple):
    """Bearings and magnets above ambient [K], held over a run: it lasts seconds, they warm in minutes to hours."""

    sun: float = 0.0
    ring: float = 0.0
    magnets: float = 0.0


class Instant(NamedTuple):
    """State that a mechanism acts on at an instant of a run: floats, complex numbers, arrays or symbols.

    Speeds of the rotors [rad/s]; the torque put on the ring from outside [N m]; the magnitude of the gear's speed
    ratio; the width of the smooth passage through rest [rad/s], see `against`.
    """

    speed_sun: Number
    speed_ring: Number
    load_ring: Number
    ratio: Number
    rest: float


@dataclass(frozen=True)
class Mechanism(ABC):
    """A piece of physics: the class is its card in the catalogue, an instance is the card with numbers.

    What the diagnosis may name says more: `by_shaft`, the parameters that are sizes, for each shaft it may sit on
    (``both``: it acts on both at once); `shape`, those that only change its form; `components`, where it sits if that
    depends on the shaft; `both_at_once`, whether one cause may well act on both shafts; `linear`, whether the effect
    is proportional to the sizes; `memory`, whether a point depends on what was run before it; `refined`, the same
    mechanism in more detail, for data that call for it; `follows`, the quantities its law is a smooth function of,
    along which a real one may bend away from it; `without`, the bench that its effect is counted from.
    """

    identifier: ClassVar[str]
    title: ClassVar[str]
    equation: ClassVar[str]
    source: ClassVar[Source]
    component: ClassVar[Component]
    affects: ClassVar[tuple[Signal, ...]]
    revealed_by: ClassVar[tuple[Reveals, ...]]
    dissipates: ClassVar[bool] = True
    memory: ClassVar[bool] = False
    by_shaft: ClassVar[dict[str, tuple[str, ...]]] = {}
    shape: ClassVar[tuple[str, ...]] = ()
    components: ClassVar[dict[str, Component]] = {}
    both_at_once: ClassVar[bool] = False
    linear: ClassVar[bool] = True
    refined: ClassVar[type[Mechanism] | None] = None
    follows: ClassVar[tuple[LawCovariate, ...]] = ()
    without: ClassVar[str] = "a bench without it"
    instead: ClassVar[str] = "Leave it out of the run; its steady points can be simulated."

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """The mechanism at its null, on the numbers of a bench and a calibrated baseline."""
        raise NotImplementedError(f"{cls.__name__} belongs to the baseline, which makes it")

    @classmethod
    def component_on(cls, shaft: str) -> Component:
        """Where it sits when it acts on that shaft."""
        return cls.components.get(shaft, cls.component)

    @abstractmethod
    def torque(self, at: OperatingPoints) -> Torques:
        """Torques on the rotors at steady points."""

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """The declared physical constants."""
        return tuple(Parameter(f.name, **f.metadata) for f in fields(cls) if "unit" in f.metadata)

    def in_motion(self, configuration: Configuration, warmth: Warmth) -> MotionLaw | None:
        """Torque in a run, in that configuration and at that warmth; None where it does not act.

        Raises
        ------
        BenchError
            When it has no law for an instant.
        """
        del configuration, warmth
        came = "no law of what the rotors feel at an instant"
        raise BenchError(f"drivetrain: {self.title}", came, "a MotionLaw", self.instead)

    def field_left(self, warmth: Warmth) -> float:
        """Factor on the magnetic torque of the coupling at that warmth; 1 unless the mechanism says otherwise."""
        return 1.0 + 0.0 * warmth.magnets


@dataclass(frozen=True)
class Instrument(Mechanism):
    """A fault of a transducer: it distorts a reading and leaves the bench alone."""

    dissipates: ClassVar[bool] = False

    def torque(self, at: OperatingPoints) -> Torques:
        """None: nothing acts on the rotors."""
        return Torques(nothing(at), nothing(at))

    def in_motion(self, configuration: Configuration, warmth: Warmth) -> None:
        """Nothing: a fault of a transducer distorts what is recorded of a run, see `pmg.sim.dynamics.trace`."""
        del configuration, warmth

    @abstractmethod
    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        """Error of each transducer [N m], given the torques that the motors apply."""


@dataclass(frozen=True)
class MotionLaw(Mechanism):
    """A mechanism whose torques follow from an instant: the same law holds at a steady point and in motion."""

    acts_in: ClassVar[tuple[Configuration, ...]] = (Configuration.NEUTRAL, Configuration.ENGAGED)

    def in_motion(self, configuration: Configuration, warmth: Warmth) -> MotionLaw | None:
        """Itself where it acts."""
        del warmth
        return self if configuration in self.acts_in else None

    @abstractmethod
    def at_instant(self, now: Instant) -> Torques:
        """Torques on the rotors [N m] at an instant."""

    def where_it_acts(self, at: OperatingPoints, whole: Torques) -> Torques:
        """Torques at steady points (n,) of the configurations in which it acts; none at the others."""
        acts = reduce(np.logical_or, (at.where[configuration] for configuration in self.acts_in))
        return Torques(np.where(acts, whole.sun, 0.0), np.where(acts, whole.ring, 0.0))

    def carrier_law(self, speed_carrier: Number, rest: float = 0.0) -> Number:
        """Torque on the carrier [N m] at its speed; none unless the mechanism says otherwise."""
        return 0.0 * (speed_carrier + rest)


@dataclass(frozen=True)
class RotorLaw(MotionLaw):
    """A mechanism whose torques depend on the speeds alone."""

    @abstractmethod
    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Torques on the rotors [N m] at the given speeds [rad/s], where the mechanism acts.

        Plain arithmetic: floats, complex numbers (for derivatives by complex step) and arrays alike. `rest` is the
        width of the smooth passage through rest [rad/s], see `against`.
        """

    def at_instant(self, now: Instant) -> Torques:
        """The law at those speeds."""
        return self.law(now.speed_sun, now.speed_ring, now.rest)

    def torque(self, at: OperatingPoints) -> Torques:
        """Torques on the rotors at steady points: the law where the mechanism acts, none elsewhere."""
        return self.where_it_acts(at, self.law(at.speed_sun, at.speed_ring))


_ABOVE_ZERO = 1e-16


def modulus(speed: Number, rest: float = 0.0) -> Number:
    """Magnitude of a speed, differentiable everywhere when `rest` [rad/s] is not zero.

    Its roots are differentiable too: it is kept from zero by less than the rounding of `rest`.
    """
    return speed * np.tanh(speed / rest) + _ABOVE_ZERO * rest if rest else speed * np.sign(np.real(speed))


def against(speed: Number, magnitude: Number, rest: float = 0.0) -> Number:
    """A drag of that magnitude, against the direction of rotation; none at rest (friction there is static).

    With `rest` [rad/s] not zero the sign becomes tanh(speed/rest), so that an integrator sees no jump; beyond 20
    widths the two are equal to the last digit.
    """
    return -(np.tanh(speed / rest) if rest else np.sign(np.real(speed))) * magnitude


def nothing(at: OperatingPoints) -> Array:
    """No torque, one zero a point."""
    return np.zeros(len(at))
