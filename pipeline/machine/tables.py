"""Tables of a machine file, before they are checked against each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import BeforeValidator, Field

from pmg.pipeline.files.strict_tables import EACH_ONCE, Strict, one_of, refuse, refusing, within
from pmg.pipeline.importers.csv_dialect import CsvForm
from pmg.pipeline.machine.channel import COUNT, Channel, PrepareTable, check_factor, in_si, with_constant
from pmg.pipeline.machine.quantity import QuantityTable

if TYPE_CHECKING:
    from pmg.pipeline.machine.axis import Axis

GEAR_KINDS = ("magnetic", "rigid", "none")
"""What lies between two shafts: poles that may slip, teeth or a belt, or a shaft that goes through."""

Number = QuantityTable | None


def _counted(given: object) -> object:
    """A number by itself as one that counts."""
    return {"value": given, "unit": "1"} if isinstance(given, int) and not isinstance(given, bool) else given


Count = Annotated[Number, BeforeValidator(_counted)]
"""A number that counts: ``4`` says the same as ``{ value = 4, unit = "1" }``."""


class _TransducerTable(Strict):
    """Torque or force transducer: tolerances are half-widths, of the reading and of the nominal value."""

    nominal: Number = None
    tolerance: Number = None
    nonlinearity: Number = None
    null_frequency: Number = None
    span: Number = None


class _MotorTable(Strict):
    constant: Number = None
    back_emf_constant: Number = None
    resistance: Number = None
    inductance: Number = None
    damping: Number = None
    inertia: Number = None
    bus_voltage: Number = None
    peak_current: Number = None
    largest: Number = None


class _EncoderTable(Strict):
    counts_per_turn: Number = None
    resolution: Number = None


class _CouplingTable(Strict):
    stiffness: Number = None
    damping: Number = None


class _FrictionTable(Strict):
    coulomb: Number = None
    viscous: Number = None


class ShaftChannels(Strict):
    """Channels of one shaft."""

    position: Channel | None = None
    velocity: Channel | None = None
    force: Channel | None = None
    torque: Channel | None = None

    def of(
        self, axis: Axis, constant: float | None = None, count: float | None = None
    ) -> dict[str, tuple[Channel, float]]:
        """Channels that are there, and what one unit of each is in SI; what drives the machine is ``force``.

        Parameters
        ----------
        axis : Axis
            What moves.
        constant : float, optional
            Force or torque of one ampere [N/A, N m/A], where the motor's is stated.
        count : float, optional
            Way of one count [m, rad], where the encoder's is stated.

        Raises
        ------
        RefusalError
            A channel or its unit is that of the other axis, a command lacks what one unit of it makes, or counts lack
            their encoder.
        """
        other = "torque" if axis.pushes == "force" else "force"
        if getattr(self, other) is not None:
            refuse(other, axis.pushes, "Rename the channel, or correct what the axis does.", other)
        if self.position is not None and self.position.unit == COUNT and count is None:
            key = "counts_per_turn" if axis.turn else "resolution"
            do = f"Add encoder.{key} of the shaft: it says what one count is."
            refuse(f"'{COUNT}' without its encoder", f"encoder.{key} beside it", do, "position", "unit")
        found = {}
        positions = {**axis.positions, COUNT: count or 0.0}
        for kind, known in {"position": positions, "velocity": axis.speeds, axis.pushes: axis.forces}.items():
            channel: Channel | None = getattr(self, kind)
            if channel is not None:
                with refusing(kind):
                    drives = kind == axis.pushes
                    channel = with_constant(channel, axis, constant) if drives else channel
                    found["force" if drives else kind] = in_si(channel, known)
                    check_factor(channel, axis, drives=drives)
        return found


class ShaftTable(Strict):
    """A shaft or a slide."""

    moves: Annotated[str, one_of("turns", "slides")] = "turns"
    inertia: Number = None
    rotor_inertia: Number = None
    coupling: _CouplingTable = _CouplingTable()
    friction: _FrictionTable = _FrictionTable()
    transducer: _TransducerTable = _TransducerTable()
    motor: _MotorTable = _MotorTable()
    encoder: _EncoderTable = _EncoderTable()
    channel: ShaftChannels = ShaftChannels()


class _BearingsTable(Strict):
    """Shares of the neutral losses by bearing; bearing 3 sits between the shafts."""

    share_sun_1: Number = None
    share_sun_2: Number = None
    share_sun_relative: Number = None
    share_ring_relative: Number = None
    share_ring_4: Number = None
    share_ring_5: Number = None
    share_ring_6: Number = None
    share_ring_7: Number = None


class _ControlTable(Strict):
    """Torque loop of either motor."""

    set_gain: Number = None
    feedback_gain: Number = None
    proportional: Number = None
    integral: Number = None
    derivative: Number = None
    amplifier: Number = None


class _CoilsTable(Strict):
    """Search coils on the iron poles."""

    turns: Number = None
    area_radial: Number = None
    area_tangential: Number = None


class GearTable(Strict):
    """What lies between two shafts."""

    kind: Annotated[str, one_of(*GEAR_KINDS)]
    input: str
    output: str
    stage: Annotated[int, within(1, 2)] | None = None
    ratio: Number = None
    pole_pairs_input: Count = None
    pole_pairs_output: Count = None
    iron_poles: Count = None
    pull_out_torque_input: Number = None
    pull_out_torque_output: Number = None
    pull_out_torque_carrier: Number = None
    carrier_inertia: Number = None
    bearings: _BearingsTable = _BearingsTable()
    control: _ControlTable = _ControlTable()
    coils: _CoilsTable = _CoilsTable()


class SecondTable(Strict):
    """Files of the output shaft, on a clock of their own: what in the name of the input's is replaced, and by what."""

    replace: Annotated[list[Annotated[str, Field(min_length=1)]], Field(min_length=2, max_length=2), EACH_ONCE]
    time: Channel


class RecordsTable(PrepareTable):
    """How records name their times, which are withheld, and how they are prepared; without times, by their rate.

    Those of `zero` are at rest with the drive off.
    """

    time: Channel | None = None
    temperature: Channel | None = None
    withheld: Annotated[list[str], EACH_ONCE] = Field(default_factory=list)
    withheld_part: Annotated[float, within(0.05, 0.6)] | None = None
    zero: Annotated[list[str], EACH_ONCE] = Field(default_factory=list)
    zeros: Annotated[str, one_of("common", "own")] = "common"
    second: SecondTable | None = None
    csv: CsvForm = CsvForm()


class TermParameter(Strict):
    """A parameter of a term: published, to compare ours with, or known."""

    term: str
    parameter: str
    value: Annotated[float, within(-1e12, 1e12)]
    unit: str


class ModelTable(Strict):
    """Terms that are taken for granted, amplitudes of them that are known [SI], further terms that are."""

    baseline: Annotated[list[str], EACH_ONCE] = Field(default_factory=list)
    fixed: dict[str, float] = Field(default_factory=dict)
    known: list[TermParameter] = Field(default_factory=list)


class PublishedErrors(Strict):
    """Relative force errors [%]."""

    fit_percent: Annotated[float, within(0.0, 1e4, "%")] | None = None
    withheld_percent: Annotated[float, within(0.0, 1e4, "%")] | None = None

    @property
    def parts(self) -> dict[str, float]:
        """Those that are given, as parts of 1, by what they are about."""
        percents = {"fit": self.fit_percent, "withheld": self.withheld_percent}
        return {name: value / 100.0 for name, value in percents.items() if value is not None}
