"""The bench in numbers: value, unit, standard uncertainty and source of each."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, fields
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from pmg.sim.errors import BenchError, near_miss
from pmg.sim.shafts import PerShaft
from pmg.sim.sources import THESIS, Source

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Number

GEARS = (1, 2)
"""Numbers of the magnetic stages."""


class SourcedQuantity(float):
    """A number about the bench that remembers its unit, standard uncertainty and source.

    It is a float in every formula; `u` is None where no uncertainty is stated.
    """

    unit: str
    u: float | None
    source: Source

    def __new__(cls, value: float, unit: str, u: float | None = None, source: Source = THESIS) -> Self:
        """Make a quantity of a value, its unit, standard uncertainty and source."""
        quantity = super().__new__(cls, value)
        quantity.unit, quantity.u, quantity.source = unit, u, source
        return quantity

    def __getnewargs__(self) -> tuple[float, str, float | None, Source]:  # type: ignore[override]  # more than a float
        """Parts that a copy in another process is made of."""
        return float(self), self.unit, self.u, self.source


def speed_ratio(pole_pairs_sun: Number, pole_pairs_ring: Number) -> Number:
    """Magnitude of w_sun / w_ring with the carrier fixed: plain arithmetic on floats and symbols alike."""
    return pole_pairs_ring / pole_pairs_sun


def of_stage(gear: npt.NDArray[np.int64], first: Array | float, second: Array | float) -> Array:
    """The value of each point's stage: that of stage 1 where `gear` is 1, that of stage 2 elsewhere."""
    return np.where(gear == 1, first, second)


@dataclass(frozen=True)
class GearParameters:
    """One magnetic stage.

    Notes
    -----
    With the carrier fixed, `speed_ratio` = w_sun / w_ring = -p_ring / p_sun.
    """

    pole_pairs_sun: SourcedQuantity
    pole_pairs_ring: SourcedQuantity
    pull_out_torque_sun: SourcedQuantity
    pull_out_torque_ring: SourcedQuantity
    pull_out_torque_carrier: SourcedQuantity

    @property
    def pole_pairs(self) -> PerShaft[int]:
        """Pole pairs of the two rotors."""
        return PerShaft(int(self.pole_pairs_sun), int(self.pole_pairs_ring))

    @property
    def ratio(self) -> float:
        """Magnitude of the speed ratio with the carrier fixed, p_ring / p_sun."""
        return float(speed_ratio(self.pole_pairs_sun, self.pole_pairs_ring))

    def pole_slip(self, speed_sun: Array, speed_ring: Array) -> Array:
        """Speed at which the poles slip past each other [rad/s], (n,); 0 while the gear holds."""
        return self.pole_pairs_sun * speed_sun + self.pole_pairs_ring * speed_ring


@dataclass(frozen=True)
class CarrierParameters:
    """The iron poles between the rotors."""

    iron_poles: SourcedQuantity


@dataclass(frozen=True)
class MotorParameters:
    """One of the two equal motors; its drive gives no more than the bus voltage and the peak current."""

    resistance: SourcedQuantity
    inductance: SourcedQuantity
    torque_constant: SourcedQuantity
    back_emf_constant: SourcedQuantity
    damping: SourcedQuantity
    inertia: SourcedQuantity
    bus_voltage: SourcedQuantity
    peak_current: SourcedQuantity


@dataclass(frozen=True)
class ShaftParameters:
    """The two shafts: inertia between motor and joint, and the elastic joint itself, equal on both sides.

    The same joint with its far end fixed holds the carrier (thesis, section 5.5.2).
    """

    inertia_sun: SourcedQuantity
    inertia_ring: SourcedQuantity
    joint_stiffness: SourcedQuantity
    joint_damping: SourcedQuantity


@dataclass(frozen=True)
class RotorParameters:
    """Inertias of the gear's three members."""

    inertia_sun: SourcedQuantity
    inertia_carrier: SourcedQuantity
    inertia_ring: SourcedQuantity


@dataclass(frozen=True)
class ControlParameters:
    """Torque loop of either motor: set and feedback gain, PID, amplifier."""

    set_gain: SourcedQuantity
    feedback_gain: SourcedQuantity
    proportional: SourcedQuantity
    integral: SourcedQuantity
    derivative: SourcedQuantity
    amplifier: SourcedQuantity


@dataclass(frozen=True)
class BearingParameters:
    """Shares of the neutral losses by bearing diameter; bearing 3 sits between the shafts."""

    share_sun_1: SourcedQuantity
    share_sun_2: SourcedQuantity
    share_sun_relative: SourcedQuantity
    share_ring_relative: SourcedQuantity
    share_ring_4: SourcedQuantity
    share_ring_5: SourcedQuantity
    share_ring_6: SourcedQuantity
    share_ring_7: SourcedQuantity

    @property
    def sun(self) -> float:
        """Share of the sun's neutral losses in bearings 1 and 2."""
        return self.share_sun_1 + self.share_sun_2

    @property
    def ring(self) -> float:
        """Share of the ring's neutral losses in bearings 4 to 7."""
        return self.share_ring_4 + self.share_ring_5 + self.share_ring_6 + self.share_ring_7


@dataclass(frozen=True)
class TransducerParameters:
    """A torque transducer: range and the tolerances that all its readings share."""

    nominal_torque: SourcedQuantity
    sensitivity_tolerance: SourcedQuantity
    nonlinearity: SourcedQuantity


@dataclass(frozen=True)
class CoilParameters:
    """The search coils on the iron poles: turns, and the area of a turn of either kind."""

    turns: SourcedQuantity
    area_radial: SourcedQuantity
    area_tangential: SourcedQuantity


@dataclass(frozen=True)
class BenchParameters:
    """The whole bench.

    `stages` are those that it has, the first one first; another gear than the thesis's has one of the two numbers, and
    the numbers of the other stage mean nothing.
    """

    gear1: GearParameters
    gear2: GearParameters
    carrier: CarrierParameters
    motor: MotorParameters
    shafts: ShaftParameters
    rotors: RotorParameters
    control: ControlParameters
    bearings: BearingParameters
    transducer_sun: TransducerParameters
    transducer_ring: TransducerParameters
    coils: CoilParameters
    stages: tuple[int, ...] = field(default=GEARS, compare=False)

    @property
    def transducers(self) -> PerShaft[TransducerParameters]:
        """The torque transducers."""
        return PerShaft(self.transducer_sun, self.transducer_ring)

    def gear(self, number: int) -> GearParameters:
        """The magnetic stage of that number, 1 or 2."""
        if number not in GEARS:
            raise BenchError("gear", str(number), "1 or 2", "Name one of the two stages.")
        return self.gear1 if number == 1 else self.gear2

    def ratio(self, gear: npt.NDArray[np.int64]) -> Array:
        """Magnitude of the speed ratio of each point's stage (n,)."""
        return of_stage(gear, self.gear1.ratio, self.gear2.ratio)

    def pole_slip(self, gear: npt.NDArray[np.int64], speed_sun: Array, speed_ring: Array) -> Array:
        """Speed at which the poles of each point's stage slip past each other [rad/s], (n,)."""
        return of_stage(gear, self.gear1.pole_slip(speed_sun, speed_ring), self.gear2.pole_slip(speed_sun, speed_ring))


def _quantities(table: dict[str, Any], kind: type[Any], where: str) -> Any:  # noqa: ANN401  (any section)
    known = [f.name for f in fields(kind)]
    for name in table:
        if name not in known:
            raise BenchError(f"bench.toml: {where}.{name}", "unknown key", "a known one", near_miss(name, known))
    for name in known:
        if name not in table:
            raise BenchError(f"bench.toml: {where}.{name}", "missing", "a value with unit", "Add the key.")
    return kind(
        **{
            name: SourcedQuantity(entry["value"], entry["unit"], entry.get("u"), THESIS.at(entry["place"]))
            for name, entry in table.items()
        }
    )


@cache
def load_bench() -> BenchParameters:
    """The parameters that ship with pmg, from ``bench.toml``."""
    data = tomllib.loads(resources.files("pmg.sim").joinpath("bench.toml").read_text(encoding="utf-8"))
    kinds = {
        "gear1": GearParameters,
        "gear2": GearParameters,
        "carrier": CarrierParameters,
        "motor": MotorParameters,
        "shafts": ShaftParameters,
        "rotors": RotorParameters,
        "control": ControlParameters,
        "bearings": BearingParameters,
        "transducer_sun": TransducerParameters,
        "transducer_ring": TransducerParameters,
        "coils": CoilParameters,
    }
    return BenchParameters(**{name: _quantities(data[name], kind, name) for name, kind in kinds.items()})
