"""Kinds of machine of the trial: their numbers, drawn about typical ones, and how they are recorded."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pmg.pipeline.trials.machines.plant import PlantNumbers

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class MadeMachine:
    """A machine as built, and how it is recorded.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    plant : PlantNumbers
        Its numbers.
    fastest, reach : float
        Largest speed that is asked for; way to either side, zero of one that turns on and on [SI].
    noise, wander, resolution : float
        Of the force or torque: white part of a reading, slow part that acts unrecorded or is read, step [N or N m].
    motion_noise, motion_step : float
        Of the encoder or the speed, in the unit of the channel.
    rate, low_pass, keep, seconds : float
        Sample rate and low-pass [Hz], samples to one of the regression, length of a record [s].
    per_unit : float
        Force or torque of one unit of the command; 1 of one recorded as such.
    ratio : float
        Speed of input over output; 0 without a gear.
    poles : tuple of int
        Pole pairs of a magnetic gear.
    known_inertia : bool
        Whether the file fixes the inertia.
    """

    kind: str
    plant: PlantNumbers
    fastest: float
    reach: float
    noise: float
    wander: float
    resolution: float
    motion_noise: float
    motion_step: float
    rate: int
    low_pass: float
    keep: int
    seconds: float
    per_unit: float = 1.0
    ratio: float = 0.0
    poles: tuple[int, int] = (0, 0)
    known_inertia: bool = False

    @property
    def band(self) -> float:
        """Frequency up to which the samples of the regression tell something [Hz]."""
        return min(self.low_pass, 0.4 * self.rate / self.keep)


SLIDE = MadeMachine(
    kind="slide",
    plant=PlantNumbers(60.0, 150.0, 12.0, 3e-4, speed_gain=6000.0, speed_rate=9e4, way_gain=12.0),
    fastest=0.22,
    reach=0.18,
    noise=1.5,
    wander=1.5,
    resolution=0.02,
    motion_noise=2e-4,
    motion_step=1e-3,
    rate=1000,
    low_pass=60.0,
    keep=12,
    seconds=20.0,
    per_unit=35.0,
)
"""A carriage on a ball screw: force as a voltage, position in mm."""

DRIVE = MadeMachine(
    kind="drive",
    plant=PlantNumbers(0.02, 0.006, 0.15, 0.1, speed_gain=0.9, speed_rate=6.0),
    fastest=80.0,
    reach=0.0,
    noise=0.02,
    wander=0.02,
    resolution=1e-3,
    motion_noise=0.04,
    motion_step=0.01,
    rate=500,
    low_pass=50.0,
    keep=8,
    seconds=25.0,
)
"""A motor and its wheel: torque that was commanded, speed in rpm."""

JOINT = MadeMachine(
    kind="joint",
    plant=PlantNumbers(0.9, 2.2, 1.3, 2e-3, speed_gain=60.0, speed_rate=700.0, way_gain=9.0),
    fastest=1.8,
    reach=1.5,
    noise=0.25,
    wander=0.2,
    resolution=2e-3,
    motion_noise=4e-4,
    motion_step=2e-3,
    rate=500,
    low_pass=50.0,
    keep=8,
    seconds=25.0,
    per_unit=9.5,
)
"""A joint of a robot about an upright axis: current, angle in degrees."""

GEARBOX = MadeMachine(
    kind="gearbox",
    plant=PlantNumbers(0.004, 0.0012, 0.08, 0.3, speed_gain=0.12, speed_rate=0.9),
    fastest=140.0,
    reach=0.0,
    noise=0.015,
    wander=0.015,
    resolution=1e-3,
    motion_noise=0.2,
    motion_step=0.05,
    rate=500,
    low_pass=40.0,
    keep=10,
    seconds=30.0,
    ratio=12.25,
)
"""Two spur stages between a motor and a brake, a torque on either side."""

MAGNETIC = replace(
    GEARBOX,
    kind="magnetic",
    plant=PlantNumbers(0.003, 0.0008, 0.05, 0.3, speed_gain=0.10, speed_rate=0.7),
    ratio=-5.5,
    poles=(4, 22),
)
"""Poles in place of teeth, the output against the input."""

WHEEL = MadeMachine(
    kind="wheel",
    plant=PlantNumbers(0.05, 0.0016, 0.05, 0.1),
    fastest=150.0,
    reach=0.0,
    noise=0.0,
    wander=1e-3,
    resolution=0.0,
    motion_noise=0.2,
    motion_step=0.05,
    rate=500,
    low_pass=5.0,
    keep=12,
    seconds=30.0,
)
"""A flywheel that coasts: speed in rpm and nothing else; its inertia is known."""

KINDS = {machine.kind: machine for machine in (SLIDE, DRIVE, JOINT, GEARBOX, WHEEL, MAGNETIC)}
"""Every kind by its name."""

RATIOS = (6.3, 12.25, -9.6, 20.25)
"""Of gears with teeth."""

POLES = ((4, 22), (2, 11), (3, 14))
"""Of gears without."""


def draw_machine(kind: str, rng: np.random.Generator, *, known_inertia: bool = False) -> MadeMachine:
    """A machine of a kind, its numbers within a factor of 1.4 of the typical ones."""
    typical = KINDS[kind]
    by = {name: 1.4 ** rng.uniform(-1.0, 1.0) for name in ("inertia", "viscous", "coulomb", "width", "noise", "wander")}
    plant = typical.plant
    plant = plant._replace(
        inertia=plant.inertia * by["inertia"],
        viscous=plant.viscous * by["viscous"],
        coulomb=plant.coulomb * by["coulomb"],
        width=plant.width * by["width"],
        speed_gain=plant.speed_gain * by["inertia"],
        speed_rate=plant.speed_rate * by["inertia"],
    )
    poles = POLES[rng.integers(len(POLES))]
    ratio = {"gearbox": RATIOS[rng.integers(len(RATIOS))], "magnetic": -poles[1] / poles[0]}.get(kind, 0.0)
    return replace(
        typical,
        plant=plant,
        noise=typical.noise * by["noise"],
        wander=typical.wander * by["wander"],
        fastest=typical.fastest * rng.uniform(0.8, 1.2),
        ratio=ratio,
        poles=poles if kind == "magnetic" else (0, 0),
        known_inertia=known_inertia or kind == "wheel",
    )
