"""A machine as its file describes it: shafts, the gear between them, how its records are read and judged."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pmg.pipeline.machine.quantity import summed
from pmg.sim.bench import speed_ratio

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.files.table_file import TableFile
    from pmg.pipeline.machine.axis import Axis
    from pmg.pipeline.machine.channel import Channel
    from pmg.pipeline.machine.quantity import Stated
    from pmg.pipeline.machine.tables import ModelTable, RecordsTable, TermParameter

SHAFT_NUMBERS = {
    "inertia": "inertia",
    "rotor_inertia": "inertia",
    "coupling.stiffness": "stiffness",
    "coupling.damping": "damping",
    "friction.coulomb": "drive",
    "friction.viscous": "damping",
    "transducer.nominal": "drive",
    "transducer.tolerance": "number",
    "transducer.nonlinearity": "number",
    "transducer.null_frequency": "frequency",
    "transducer.span": "frequency",
    "motor.constant": "drive per current",
    "motor.back_emf_constant": "voltage per speed",
    "motor.resistance": "resistance",
    "motor.inductance": "inductance",
    "motor.damping": "damping",
    "motor.inertia": "inertia",
    "motor.bus_voltage": "voltage",
    "motor.peak_current": "current",
    "motor.largest": "drive",
    "encoder.counts_per_turn": "number",
    "encoder.resolution": "way",
}
"""Numbers of a shaft by their keys, and what they are."""

GEAR_NUMBERS = {
    "ratio": "number",
    "pole_pairs_input": "number",
    "pole_pairs_output": "number",
    "iron_poles": "number",
    "pull_out_torque_input": "drive",
    "pull_out_torque_output": "drive",
    "pull_out_torque_carrier": "drive",
    "carrier_inertia": "inertia",
    "bearings.share_sun_1": "number",
    "bearings.share_sun_2": "number",
    "bearings.share_sun_relative": "number",
    "bearings.share_ring_relative": "number",
    "bearings.share_ring_4": "number",
    "bearings.share_ring_5": "number",
    "bearings.share_ring_6": "number",
    "bearings.share_ring_7": "number",
    "control.set_gain": "voltage per torque",
    "control.feedback_gain": "voltage per torque",
    "control.proportional": "number",
    "control.integral": "rate",
    "control.derivative": "time",
    "control.amplifier": "number",
    "coils.turns": "number",
    "coils.area_radial": "area",
    "coils.area_tangential": "area",
}
"""Numbers of a gear by their keys, and what they are."""


@dataclass(frozen=True)
class MachineShaft:
    """A shaft or a slide.

    Parameters
    ----------
    name : str
        What its engineer calls it.
    axis : Axis
        Whether it turns or slides.
    numbers : mapping of str to Stated
        What is known of it, by the keys of `SHAFT_NUMBERS`.
    channels : mapping of str to (Channel, float)
        ``position``, ``velocity``, ``force`` (also of a torque), as far as they are recorded; what one unit is in SI.
    """

    name: str
    axis: Axis
    numbers: Mapping[str, Stated]
    channels: Mapping[str, tuple[Channel, float]]

    def total(self, key: str) -> Stated | None:
        """A number of it, where it is stated; ``inertia`` is that of all that moves with it."""
        keys = ("inertia", "rotor_inertia", "motor.inertia") if key == "inertia" else (key,)
        parts = [(self.numbers[each], 1.0) for each in keys if each in self.numbers]
        return summed(parts) if parts else None


@dataclass(frozen=True)
class MachineGear:
    """What lies between two shafts.

    Parameters
    ----------
    kind, input, output : str
        One of `GEAR_KINDS`; names of the shafts.
    numbers : mapping of str to Stated
        What is known of it, by the keys of `GEAR_NUMBERS`.
    stage : int
        Of a magnetic gear: the number that recordings give as its gear.
    """

    kind: str
    input: str
    output: str
    numbers: Mapping[str, Stated]
    stage: int = 1

    @property
    def ratio(self) -> float:
        """Speed of the input over that of the output; negative where they turn against each other."""
        if self.kind == "rigid":
            return self.numbers["ratio"].value
        if self.kind == "none":
            return 1.0
        poles = (self.numbers[f"pole_pairs_{end}"].value for end in ("input", "output"))
        return -float(speed_ratio(*poles))


@dataclass(frozen=True)
class Machine:
    """A machine as its file describes it.

    Parameters
    ----------
    file : TableFile
        The file, for messages about it.
    title : str
        What it is.
    shafts : mapping of str to MachineShaft
        One, or two with a gear between them.
    gear : MachineGear or None
        What lies between.
    records : RecordsTable or None
        How its records are read; None of a machine whose recordings are in layout pmg.v1.
    model : ModelTable
        Terms that are taken for granted.
    published : tuple of TermParameter
        Parameters to compare with.
    published_errors : mapping of str to float
        Published relative errors, as parts of 1.
    """

    file: TableFile[Any]
    title: str
    shafts: Mapping[str, MachineShaft]
    gear: MachineGear | None
    records: RecordsTable | None
    model: ModelTable
    published: tuple[TermParameter, ...] = ()
    published_errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def path(self) -> Path:
        """The file."""
        return self.file.path

    def seen_by(self, shaft: MachineShaft, key: str) -> Stated | None:
        """Sum of a number over all that moves, as one shaft sees it through the gear; None unless every part is stated.

        Parameters
        ----------
        shaft : MachineShaft
            The shaft.
        key : str
            ``inertia`` (all that moves with a shaft), ``friction.coulomb`` or ``friction.viscous``.
        """
        parts = [end.total(key) for end in self.ends]
        stated = [part for part in parts if part is not None]
        if len(stated) < len(parts):
            return None
        ratio = 1.0 if self.gear is None else abs(self.gear.ratio)
        faster = [1.0 if end is shaft else 1.0 / ratio if shaft is self.ends[0] else ratio for end in self.ends]
        factors = [f if key == "friction.coulomb" else f**2 for f in faster]
        return summed(list(zip(stated, factors, strict=True)))

    @property
    def ends(self) -> tuple[MachineShaft, ...]:
        """The shaft; of two, the input first."""
        if self.gear is None:
            return tuple(self.shafts.values())
        return self.shafts[self.gear.input], self.shafts[self.gear.output]
