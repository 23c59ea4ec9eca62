"""A scenario: what to simulate, in the words of its TOML file; units are part of the keys."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Field, InstanceOf, model_validator

from pmg.pipeline.files.strict_tables import (
    Strict,
    key_of,
    number_within,
    one_of,
    refuse,
    refuse_unknown,
    refusing,
    within,
    word_of,
)
from pmg.pipeline.fit.calibration import CONSTANTS
from pmg.pipeline.simulate.scenario_mechanisms import Switched, switch_on
from pmg.pipeline.simulate.scenario_words import Amplitude, Frequency, Length, Motor, Rpm, Torque, refuse_foreign_units
from pmg.pipeline.wording.option_words import DampingMethod
from pmg.sim.dynamics.assumptions import CHOICES, RANGES, Assumptions
from pmg.sim.dynamics.constants import Control
from pmg.sim.dynamics.transient import OUTPUTS, OnSlip, Solver
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, Member


class Bench(Strict):
    """The bench's mode."""

    gear: Annotated[int, within(1, 2, "")] = 1
    configuration: Annotated[Configuration, one_of(Configuration.ENGAGED, Configuration.NEUTRAL)] = (
        Configuration.ENGAGED
    )
    held: Annotated[Member, one_of(*Member)] = Member.CARRIER
    control_sun: Annotated[Control, one_of(*Control)] = Control.TORQUE
    control_ring: Annotated[Control, one_of(*Control)] = Control.TORQUE
    history: Literal["settled", "run"] = "settled"


SOURCES = ("grids", "analysis", "model", "none")
"""Keys that say where the losses come from."""


class Losses(Strict):
    """Where the losses come from: one source, and what is set by hand."""

    grids: str | None = None
    analysis: str | None = None
    model: str | None = None
    none: bool = False
    K_corr: Annotated[float, within(*CONSTANTS["K_corr"].bounds, "")] | None = None
    b: Annotated[float, within(*CONSTANTS["b"].bounds, CONSTANTS["b"].unit)] | None = None
    c: Annotated[float, within(*CONSTANTS["c"].bounds, CONSTANTS["c"].unit)] | None = None
    d: Annotated[float, within(*CONSTANTS["d"].bounds, CONSTANTS["d"].unit)] | None = None
    terms_sun: str | None = None
    terms_ring: str | None = None
    robust: bool | None = None
    damping: Annotated[DampingMethod, one_of(*DampingMethod)] | None = None
    printed_torques: bool | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Losses:
        named = [name for name in SOURCES if getattr(self, name)]
        if len(named) != 1:
            came = f"{' and '.join(named)} together" if named else "no source"
            refuse(came, "exactly one of grids, analysis, model, none = true", "Name one source of the losses.")
        if self.printed_torques and self.grids is None:
            refuse("without grids", "grids of the thesis beside it", "Name the folder of its grids.", "printed_torques")
        if self.printed_torques and self.terms_sun is not None:
            do = "Take one of them out: the printed torques decide the sun's terms."
            refuse("beside printed_torques", "the sun's terms from one source", do, "terms_sun")
        changed = [name for name in type(self).model_fields if name not in SOURCES]
        for name in changed:
            if getattr(self, name) is not None and (self.none or self.model):
                came = "together with none = true" if self.none else "together with a model, which holds it"
                refuse(came, "a source of losses to change", "Take it out, or name grids or an analysis.", name)
        return self


class Map(Strict):
    """The magnetic torques: the analytic map with more in it, or a table of field computations."""

    fem: str | None = None
    harmonics: dict[str, Annotated[float, within(-10.0, 10.0, "of the fundamental")]] = Field(default_factory=dict)
    cogging_sun_nm: Amplitude | None = None
    cogging_sun_order: Annotated[int, within(1, 10_000, "")] | None = None
    cogging_ring_nm: Amplitude | None = None
    cogging_ring_order: Annotated[int, within(1, 10_000, "")] | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Map:
        if self.fem is not None and self.model_fields_set != {"fem"}:
            other = key_of(min(self.model_fields_set - {"fem"}))
            refuse("together with fem", "a table, or harmonics and cogging of the analytic map", "Take one out.", other)
        for order in self.harmonics:
            if not (order.isdecimal() and 2 <= int(order) <= 100):
                refuse(f"order '{order}'", "whole orders from 2 to 100, such as 3 = 0.05", "Correct it.", "harmonics")
        for side in SIDES:
            if getattr(self, f"cogging_{side}_order") is not None and getattr(self, f"cogging_{side}_nm") is None:
                refuse("an order alone", "an amplitude with it", "Add it.", f"cogging_{side}_Nm")
        return self


class Point(Strict):
    """One steady point: two of its four quantities."""

    speed_sun_rpm: Rpm | None = None
    speed_ring_rpm: Rpm | None = None
    torque_sun_nm: Torque | None = None
    torque_ring_nm: Torque | None = None


class Levels(Strict):
    """A grid of steady points: every combination of the levels."""

    speed_sun_rpm: Annotated[list[Rpm], Field(min_length=1)]
    load_nm: Annotated[list[Amplitude], Field(min_length=1)] | None = None
    speed_ring_rpm: Annotated[list[Rpm], Field(min_length=1)] | None = None
    drive: Literal["sun", "ring"] = "sun"


class Pairs(Strict):
    """Steady points one by one, each a speed of the sun and a torque of the ring motor."""

    speed_sun_rpm: Annotated[list[Rpm], Field(min_length=1)]
    torque_ring_nm: Annotated[list[Torque], Field(min_length=1)]


class Transient(Strict):
    """A run in time."""

    duration_s: Length
    outputs: Annotated[int, within(2, 200_000, "instants")] = OUTPUTS
    rtol: Annotated[float, within(1e-12, 1e-2, "")] = 1e-6
    on_slip: Annotated[OnSlip, one_of(*OnSlip)] = OnSlip.STOP
    solver: Annotated[Solver, one_of(*Solver)] = Solver.COMPILED
    start: Literal["rest", "steady"] = "rest"
    sun: Motor | None = None
    ring: Motor | None = None


class Response(Strict):
    """A frequency response."""

    side: Literal["sun", "ring"] = "sun"
    from_hz: Frequency = 0.1
    to_hz: Frequency = 1e4
    points: Annotated[int, within(2, 100_000, "frequencies")] = 400

    @model_validator(mode="after")
    def _rising(self) -> Response:
        if self.to_hz <= self.from_hz:
            refuse(f"{self.to_hz:g} Hz", f"more than from_Hz = {self.from_hz:g} Hz", "Exchange them.", "to_Hz")
        return self


Format: TypeAlias = Literal["csv", "parquet", "mcap"]
FORMATS: tuple[Format, ...] = ("csv", "parquet", "mcap")


class Output(Strict):
    """Formats and resolution of the output."""

    rate_hz: Annotated[float, within(1.0, 100_000.0, "Hz")] = 500.0
    seconds: Annotated[float, within(1.0, 3_600.0, "s")] = 5.0
    campaign: Annotated[str, Field(min_length=1)] = "simulated"
    formats: list[Format] = Field(default_factory=lambda: list(FORMATS))
    figures: bool = True


class PlannedCampaign(Strict):
    """A campaign that is to be run, for the design audit."""

    neutral_sun_rpm: Annotated[list[Rpm], Field(min_length=1)]
    neutral_ring_rpm: Annotated[list[Rpm], Field(min_length=1)]
    engaged_sun_rpm: list[Rpm] = Field(default_factory=list)
    engaged_load_nm: list[Amplitude] = Field(default_factory=list)
    order: Literal["random", "rising", "falling"] = "random"
    repeats: Annotated[int, Field(ge=0, le=1000)] = 0
    zero_checks: Annotated[int, Field(ge=0, le=1000)] = 0
    reversed_flow: bool = False
    reversed_rotation: bool = False
    seconds_a_point: Annotated[float, within(1.0, 3_600.0, "s")] = 45.0
    noise_sun_nm: Annotated[float, within(1e-6, 1.0, "N m")] = 1e-3
    noise_ring_nm: Annotated[float, within(1e-6, 1.0, "N m")] = 1e-3


def _assumptions(table: object) -> Assumptions:
    """Choices that the thesis leaves open, as a table of the file makes them."""
    if not isinstance(table, dict):
        refuse(repr(table), "a table", "Write [assumptions] above the keys.")
    if "rotor_inertia" in table:
        do = "Write rotor_inertia_sun and rotor_inertia_ring, one for each motor."
        refuse("one key for both motors", "a key for each", do, "rotor_inertia")
    refuse_unknown(table, [f.name for f in fields(Assumptions)])
    chosen: dict[str, Any] = {}
    for name, value in table.items():
        with refusing(name):
            if name in CHOICES:
                chosen[name] = CHOICES[name](word_of(value, [str(kind) for kind in CHOICES[name]]))
            elif name in RANGES:
                chosen[name] = float(number_within(value, *RANGES[name]))
            elif isinstance(value, bool):
                chosen[name] = value
            else:
                refuse(repr(value), "true or false", "Write it without quotation marks.")
    return Assumptions(**chosen)


class Scenario(Strict):
    """All that one file asks for."""

    title: str = ""
    bench: Bench = Bench()
    losses: Losses
    map: Map = Map()
    mechanism: Annotated[tuple[InstanceOf[Switched], ...], BeforeValidator(switch_on)] = ()
    assumptions: Annotated[InstanceOf[Assumptions], BeforeValidator(_assumptions)] = Assumptions()
    point: Point | None = None
    grid: Levels | None = None
    pairs: Pairs | None = None
    transient: Transient | None = None
    response: Response | None = None
    plan: PlannedCampaign | None = None
    output: Output = Output()

    @model_validator(mode="before")
    @classmethod
    def _units_of_control(cls, given: dict[str, Any]) -> dict[str, Any]:
        refuse_foreign_units(given)
        return given

    @model_validator(mode="after")
    def _whole(self) -> Scenario:
        if not (self.point or self.grid or self.pairs or self.transient or self.response or self.plan):
            expected = "[point], [grid], [pairs], [transient], [response] or [plan]"
            refuse("nothing to simulate", expected, "Add one of these tables.")
        return self
