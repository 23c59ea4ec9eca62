"""A machine with a magnetic gear as the bench of the whole pipeline: its own numbers, and those lent by the thesis."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

from pmg.pipeline.recording.remark import Remark
from pmg.sim.bench import BenchParameters, SourcedQuantity, load_bench, speed_ratio
from pmg.sim.errors import BenchError
from pmg.sim.shafts import SIDES
from pmg.sim.sources import Source

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.machine.machine import Machine, MachineGear
    from pmg.pipeline.machine.quantity import Stated

Section = TypeVar("Section")

OF_BOTH = {
    "motor": {
        "resistance": "motor.resistance",
        "inductance": "motor.inductance",
        "torque_constant": "motor.constant",
        "back_emf_constant": "motor.back_emf_constant",
        "damping": "motor.damping",
        "inertia": "motor.inertia",
        "bus_voltage": "motor.bus_voltage",
        "peak_current": "motor.peak_current",
    },
    "shafts": {"joint_stiffness": "coupling.stiffness", "joint_damping": "coupling.damping"},
}
"""Numbers that both shafts share, by section and field of the bench: their keys in the table of either shaft."""

OF_ONE = {
    "shafts": {"inertia": "inertia"},
    "rotors": {"inertia": "rotor_inertia"},
    "transducer": {
        "nominal_torque": "transducer.nominal",
        "sensitivity_tolerance": "transducer.tolerance",
        "nonlinearity": "transducer.nonlinearity",
    },
}
"""Numbers of one shaft, by section and start of the field of the bench: their keys in the table of the shaft."""

RATIO_TOLERANCE = 0.01
"""Part by which pull-out torques may be off the ratio of the pole pairs before it is told."""

NOT_TAKEN = ("friction.", "encoder.", "transducer.null_frequency", "transducer.span", "motor.largest")
"""Starts of keys of a shaft that the analysis of a magnetic gear finds in recordings, or does not need."""

LIMITS = ("bus_voltage", "peak_current")
"""Ends of the keys of a motor's limits."""

MAY_VANISH = ("damping", "share_", "tolerance", "nonlinearity", "integral", "derivative", "turns")
"""Starts of the last word of keys whose number may be zero."""


def usual(machine: Machine) -> bool:
    """Whether recordings of a machine go the way of the thesis's: a magnetic gear, recorded in layout pmg.v1."""
    return machine.gear is not None and machine.gear.kind == "magnetic" and machine.records is None


def bench_of(machine: Machine) -> BenchParameters:
    """The bench that a machine with a magnetic gear is.

    Parameters
    ----------
    machine : Machine
        A magnetic gear between shafts called ``sun`` and ``ring``, whose recordings are in layout pmg.v1.

    Notes
    -----
    Numbers that its file does not give are those of the thesis; `remarks_on_bench` lists them. A pull-out torque that
    is not given follows from another one by the pole pairs, that of the carrier being the sum of both.

    Raises
    ------
    BenchError
        It is another machine, its shafts differ in what the bench has once, or a number cannot be.
    """
    return _Reading(machine).bench()


def remarks_on_bench(machine: Machine) -> tuple[Remark, ...]:
    """What is taken from the thesis, what is not taken, and what does not agree with itself.

    Parameters
    ----------
    machine : Machine
        One that `bench_of` takes.
    """
    reading = _Reading(machine)
    bench = reading.bench()
    return tuple(
        Remark(severity, str(machine.path), message) for severity, message in _told(machine, bench, reading.lent)
    )


def _told(machine: Machine, bench: BenchParameters, lent: list[str]) -> Iterator[tuple[str, str]]:
    gear = _gear(machine)
    if lent:
        yield "info", f"taken from the thesis bench: {', '.join(lent)}"
    if any(key.endswith(LIMITS) for key in lent):
        motor = bench.motor
        yield (
            "info",
            f"the motors' limits are the thesis bench's: {float(motor.bus_voltage):g} V, "
            f"{float(motor.peak_current):g} A. State motor.bus_voltage and motor.peak_current of both shafts, or "
            "simulate without limits ([assumptions] motor_limits = false).",
        )
    left = [
        f"shaft.{name}.{key}" for name, s in machine.shafts.items() for key in s.numbers if key.startswith(NOT_TAKEN)
    ]
    if left:
        yield "info", f"not used with a magnetic gear: {', '.join(left)}; recordings give them, or nothing needs them"
    stage = bench.gear(gear.stage)
    poles = stage.pole_pairs.sun + stage.pole_pairs.ring
    if int(bench.carrier.iron_poles) != poles:
        came = f"{int(bench.carrier.iron_poles)} iron poles"
        yield (
            "warning",
            f"{came}; expected {poles}, the pole pairs of both rotors together. Correct one of them.",
        )
    wanted = {"ring": stage.pull_out_torque_sun * stage.ratio, "carrier": stage.pull_out_torque_sun * (1 + stage.ratio)}
    for side, torque in wanted.items():
        found = getattr(stage, f"pull_out_torque_{side}")
        if abs(found - torque) > RATIO_TOLERANCE * torque:
            yield (
                "warning",
                f"pull-out torque of the {side} {found:.4g} N m; expected {torque:.4g} N m from that of the sun, "
                f"{float(stage.pull_out_torque_sun):.4g} N m, by the pole pairs. Correct one of them.",
            )


@dataclass
class _Reading:
    """A machine on its way to a bench, and the keys of what it lacks."""

    machine: Machine

    def __post_init__(self) -> None:
        self.gear = _gear(self.machine)
        self.lent: list[str] = []

    def bench(self) -> BenchParameters:
        base, stage = load_bench(), f"gear{self.gear.stage}"
        return replace(
            base,
            stages=(self.gear.stage,),
            **{stage: self._stage(getattr(base, stage))},
            carrier=replace(base.carrier, iron_poles=self._iron_poles()),
            motor=self._section(base.motor, {name: self._of_both(key) for name, key in OF_BOTH["motor"].items()}),
            shafts=self._section(
                base.shafts,
                self._of_sides("shafts") | {name: self._of_both(key) for name, key in OF_BOTH["shafts"].items()},
            ),
            rotors=self._section(
                base.rotors, self._of_sides("rotors") | {"inertia_carrier": self._of_gear("carrier_inertia")}
            ),
            **{
                f"transducer_{side}": self._section(
                    getattr(base, f"transducer_{side}"),
                    {name: self._of_shaft(side, key) for name, key in OF_ONE["transducer"].items()},
                )
                for side in SIDES
            },
            **{part: self._group(part, getattr(base, part)) for part in ("bearings", "control", "coils")},
        )

    def _stage(self, lent: Any) -> Any:  # noqa: ANN401 (a stage and its copy)
        """The stage of the gear; pull-out torques that are not given follow from one that is."""
        ends = {self.gear.input: "input", self.gear.output: "output"}
        poles = {side: self._pole_pairs(f"pole_pairs_{ends[side]}") for side in SIDES}
        ratio = float(speed_ratio(poles["sun"], poles["ring"]))
        parts = {"sun": 1.0, "ring": ratio, "carrier": 1.0 + ratio}
        keys = {side: f"pull_out_torque_{ends.get(side, side)}" for side in parts}
        torques = {side: given for side, key in keys.items() if (given := self._of_gear(key)[1]) is not None}
        if torques:
            of, known = next(iter(torques.items()))
        else:
            of, known = "sun", lent.pull_out_torque_sun
            self.lent.append(f"gear.{keys['sun']}")
        u = None if known.u is None else known.u / parts[of]
        for side, part in parts.items():
            by_poles = known.source.at(f"by the pole pairs from that of the {of}") if side != of else known.source
            follows = SourcedQuantity(float(known) * part / parts[of], "N m", None if u is None else u * part, by_poles)
            torques.setdefault(side, follows)
        return replace(
            lent,
            **{f"pole_pairs_{side}": number for side, number in poles.items()},
            **{f"pull_out_torque_{side}": number for side, number in torques.items()},
        )

    def _pole_pairs(self, key: str) -> SourcedQuantity:
        number = self._of_gear(key)[1]
        if number is None or number < 1.0 or not float(number).is_integer():
            came = "missing" if number is None else f"{float(number):g}"
            raise self.machine.file.refusal(came, "a whole number from 1", "Correct the value.", "gear", key)
        return number

    def _iron_poles(self) -> SourcedQuantity:
        given = self._of_gear("iron_poles")[1]
        if given is not None:
            return given
        poles = [self._pole_pairs(f"pole_pairs_{end}") for end in ("input", "output")]
        return SourcedQuantity(sum(poles), "1", None, poles[0].source.at("the pole pairs of both rotors together"))

    def _section(self, lent: Section, found: dict[str, tuple[str, SourcedQuantity | None]]) -> Section:
        """A section of the bench with what was found of it; what was not is lent."""
        self.lent += [key for key, number in found.values() if number is None]
        given = {name: number for name, (_, number) in found.items() if number is not None}
        return replace(lent, **given)  # type: ignore[type-var]  # any section of the bench

    def _group(self, part: str, lent: Any) -> Any:  # noqa: ANN401 (any section)
        """A section of the bench that has a table of its own in the file; one that is lent as a whole is told so."""
        found = {each.name: self._of_gear(f"{part}.{each.name}") for each in fields(lent)}
        if all(number is None for _, number in found.values()):
            self.lent.append(f"gear.{part}")
            return lent
        return self._section(lent, found)

    def _of_gear(self, key: str) -> tuple[str, SourcedQuantity | None]:
        return self._quantity(self.gear.numbers.get(key), "gear", *key.split("."))

    def _of_shaft(self, side: str, key: str) -> tuple[str, SourcedQuantity | None]:
        return self._quantity(self.machine.shafts[side].numbers.get(key), "shaft", side, *key.split("."))

    def _of_sides(self, section: str) -> dict[str, tuple[str, SourcedQuantity | None]]:
        return {f"{name}_{side}": self._of_shaft(side, key) for name, key in OF_ONE[section].items() for side in SIDES}

    def _of_both(self, key: str) -> tuple[str, SourcedQuantity | None]:
        """A number that both shafts share, from either of them."""
        given = {side: number for side in SIDES if (number := self._of_shaft(side, key)[1]) is not None}
        if len({float(number) for number in given.values()}) > 1:
            came = " and ".join(f"{float(number):g} {number.unit} ({side})" for side, number in given.items())
            expected = "one number: both motors, and both joints, of a magnetic gear are taken as equal"
            do = "Give both the same value, or leave one of them out."
            raise self.machine.file.refusal(came, expected, do, "shaft", SIDES[-1], *key.split("."))
        return f"shaft.{key}", next(iter(given.values()), None)

    def _quantity(self, number: Stated | None, *key: str) -> tuple[str, SourcedQuantity | None]:
        """A number at a key of the file; one that the physics cannot take is refused."""
        name = ".".join(key)
        if number is None:
            return name, None
        if number.value < 0.0 or (number.value == 0.0 and not key[-1].startswith(MAY_VANISH)):
            above = "zero or more" if key[-1].startswith(MAY_VANISH) else "a number above zero"
            raise self.machine.file.refusal(f"{number.value:g}", above, "Correct the value.", *key)
        source = Source("machine", self.machine.title).at(number.source or "no source stated")
        return name, SourcedQuantity(number.value, number.unit, number.u, source)


def _gear(machine: Machine) -> MachineGear:
    """The magnetic gear of a machine.

    Raises
    ------
    BenchError
        It has none between shafts called ``sun`` and ``ring``, or recordings of another layout.
    """
    gear, where = machine.gear, str(machine.path)
    if gear is None or gear.kind != "magnetic":
        came = "no gear" if gear is None else f"a gear of kind '{gear.kind}'"
        do = "Analyse its recordings by 'pmg run RECORDINGS --machine FILE --report REPORT'."
        raise BenchError(where, came, "a magnetic gear", do)
    if set(machine.shafts) != set(SIDES):
        came = f"shafts {' and '.join(machine.shafts)}"
        raise BenchError(where, came, "shafts called sun and ring", "Name them [shaft.sun] and [shaft.ring].")
    if machine.records is not None:
        do = "Leave [records] out, and bring recordings of another format in by 'pmg import'."
        raise BenchError(where, "[records]", "recordings in layout pmg.v1", do)
    return gear
