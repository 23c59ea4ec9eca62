"""Causes that a machine of the trial may conceal: what each does, and what counts as right."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np

    from pmg.pipeline.trials.machines.kinds import MadeMachine
    from pmg.pipeline.trials.machines.plant import PlantNumbers

COMMANDED = ("slide", "drive", "joint")
"""Machines with one force or torque, which is a command."""

TWO_TORQUES = ("gearbox", "magnetic")
"""Machines with a torque at either end."""

BOTH_WAYS = (*COMMANDED, *TWO_TORQUES)
"""Machines that move both ways."""

EVERY = (*BOTH_WAYS, "wheel")
"""All of them."""

GAINS = (("input_torque_gain",), ("output_torque_gain",))
"""Gains of both transducers are one column."""

ZEROS = (("constant_offset",), ("direction_dependent_coulomb",))
"""A zero and friction by direction are one column but at rest."""

PLAYING, STIFF = 0.3, 4.0
"""Part of the inertia behind a coupling with play, and where it would resonate without, over the band."""

POUND_FOOT = 1.0 / 1.355818
"""What a transducer shows in lbf ft of one N m."""

PLAIN, FIXED, OUTSIDE = "plain", "fixed", "outside"
"""A cause of the library of any size; one whose size is what it is; one that no library knows."""


@dataclass(frozen=True)
class MadeCause:
    """One cause.

    Parameters
    ----------
    name : str
        What it is.
    kinds : tuple of str
        Machines that may have it.
    right : tuple of tuple of str
        Sets of terms, any of which names it; none of what no library knows.
    sort : str
        `PLAIN`, `FIXED` or `OUTSIDE`.
    start, most : float
        Amplitude at which the search for its size begins, over a number of the machine, and the largest.
    known_inertia : bool
        Whether it shows only where the inertia is known.
    """

    name: str
    kinds: tuple[str, ...]
    right: tuple[tuple[str, ...], ...]
    sort: str = PLAIN
    start: float = 0.2
    most: float = 3.0
    known_inertia: bool = False


CAUSES = (
    MadeCause("stribeck", EVERY, (("stribeck",), ("presliding", "stribeck"))),
    MadeCause("presliding", BOTH_WAYS, (("presliding",), ("presliding", "stribeck"))),
    MadeCause("dead_zone", COMMANDED, (("dead_zone",),)),
    MadeCause("drag_up", EVERY, (("drag_of_power",),)),
    MadeCause("drag_down", EVERY, (("drag_of_power",),)),
    MadeCause("load_friction", TWO_TORQUES, (("load_friction",),), start=0.02, most=0.5),
    MadeCause("gain_two_torques", TWO_TORQUES, GAINS, start=0.02, most=0.3),
    MadeCause("pound_feet", TWO_TORQUES, GAINS, FIXED),
    MadeCause("gain_known_inertia", ("drive",), (("actuator_gain",), ("inertia",)), start=0.05, known_inertia=True),
    MadeCause("rpm_as_rad", ("drive",), (("actuator_gain",), ("inertia",)), FIXED, known_inertia=True),
    MadeCause("sign_of_torque", BOTH_WAYS, ((),), FIXED),
    MadeCause("zero", BOTH_WAYS, ZEROS),
    MadeCause("delay", COMMANDED, (("delay",),), start=2e-3, most=8e-3),
    MadeCause("output_delay", TWO_TORQUES, (("output_torque_lag",),), start=0.01, most=0.2),
    MadeCause("input_delay", TWO_TORQUES, (("input_torque_lag",),), start=0.01, most=0.2),
    MadeCause("warming", BOTH_WAYS, (("warming",),), start=0.2),
    MadeCause("ripple", EVERY, (("position_ripple",), ("position_ripple", "second_ripple"))),
    MadeCause("tiring_drive", COMMANDED, (("drive_fade",),), start=0.1, most=0.6),
    MadeCause("drive_limit", COMMANDED, (("drive_limit",),), start=0.3, most=0.8),
    MadeCause("two_masses", BOTH_WAYS, (("two_masses",),), start=0.3, most=0.8),
    MadeCause("play", BOTH_WAYS, (("backlash",),), start=1.0, most=100.0),
    MadeCause("film", BOTH_WAYS, (), OUTSIDE),
    MadeCause("hum", BOTH_WAYS, (), OUTSIDE),
)
"""Every cause of the trial."""

BY_NAME = {cause.name: cause for cause in CAUSES}
"""Causes by their names."""

PAIRS = (
    ("ripple", "drag_up"),
    ("zero", "drag_down"),
    ("stribeck", "zero"),
    ("warming", "ripple"),
    ("dead_zone", "zero"),
    ("presliding", "ripple"),
    ("load_friction", "zero"),
    ("output_delay", "load_friction"),
    ("delay", "drag_up"),
    ("gain_two_torques", "drag_up"),
)
"""Pairs that a machine may conceal."""


def draw_constants(machine: MadeMachine, rng: np.random.Generator) -> dict[str, float]:
    """What the causes of one campaign need besides an amplitude; all are drawn, whichever are used."""
    fast, reach = machine.fastest, machine.reach
    way = reach if reach else fast * 1.5
    within = machine.band
    return {
        "stiction": rng.uniform(0.6, 1.2),
        "stiction_speed": fast * rng.uniform(0.04, 0.12),
        "bristle_way": way * (rng.uniform(0.01, 0.03) if reach else rng.uniform(0.002, 0.01)),
        "short_way": way * 2e-4,
        "drag_speed_up": fast * rng.uniform(0.35, 0.8),
        "drag_speed_down": fast * rng.uniform(0.02, 0.1),
        "load_round": rng.uniform(0.05, 0.2),
        "warm_time": machine.seconds * rng.uniform(0.3, 1.0),
        "film_time": rng.uniform(0.3, 1.5),
        "ripple_way": reach * rng.uniform(0.1, 0.3) if reach else fast / (within * rng.uniform(0.15, 0.4)),
        "ripple_second": rng.uniform(0.0, 0.25),
        "far_hertz": within * rng.choice([rng.uniform(0.2, 0.6), rng.uniform(1.05, 1.3)]),
        "far_damping": rng.uniform(0.01, 0.04),
        "sense": float(rng.choice([-1.0, 1.0])),
        "output": float(rng.integers(2)),
        "hum_hertz": within * rng.uniform(0.08, 0.2),
    }


def built_with(
    machine: MadeMachine, name: str, amplitude: float, constants: Mapping[str, float], peak: float
) -> PlantNumbers:
    """The numbers of a machine with a cause in its mechanics; as they are where it is in the readings.

    Parameters
    ----------
    machine : MadeMachine
        As built.
    name : str
        Of the cause.
    amplitude : float
        Over a number of the machine: its dry friction, its viscous friction or, of a limit, the part that is cut.
    constants : mapping of str to float
        By `draw_constants`.
    peak : float
        Largest command of the machine without the cause [N or N m].
    """
    p, c = machine.plant, constants
    dry = amplitude * p.coulomb
    match name:
        case "stribeck":
            return p._replace(
                bristle=dry,
                bristle_way=c["short_way"],
                stiction=1.0 + c["stiction"],
                stiction_speed=c["stiction_speed"],
            )
        case "presliding":
            return p._replace(bristle=dry, bristle_way=c["bristle_way"])
        case "dead_zone":
            return p._replace(dead_zone=dry)
        case "drag_up":
            return p._replace(drag_up=dry, drag_speed=c["drag_speed_up"])
        case "drag_down":
            return p._replace(drag_down=dry, drag_speed=c["drag_speed_down"])
        case "load_friction":
            return p._replace(under_load=amplitude, load_round=c["load_round"])
        case "warming":
            return p._replace(thinning=amplitude, warm_time=c["warm_time"])
        case "ripple":
            return p._replace(ripple=dry, ripple_way=c["ripple_way"], ripple_second=c["ripple_second"])
        case "film":
            return p._replace(film=dry, film_time=c["film_time"], film_speed=0.3 * machine.fastest)
        case "hum":
            return p._replace(hum=dry, hum_hertz=c["hum_hertz"])
        case "drive_limit":
            return p._replace(limit=(1.0 - amplitude) * peak)
        case "tiring_drive":
            return p._replace(tiring=amplitude, warm_time=c["warm_time"])
        case "play":
            far = PLAYING * p.inertia
            natural = REVOLUTION * STIFF * machine.band
            between = far * (1.0 - PLAYING)
            return p._replace(
                far_part=PLAYING,
                far_stiffness=between * natural**2,
                far_damping=0.2 * between * natural,
                play=amplitude * c["short_way"],
            )
        case "two_masses":
            far = amplitude * p.inertia
            both = far * (1.0 - amplitude)
            natural = REVOLUTION * c["far_hertz"]
            return p._replace(
                far_part=amplitude, far_stiffness=both * natural**2, far_damping=2.0 * c["far_damping"] * both * natural
            )
    return p
