"""A model read from its TOML file, each fault reported with the file and the key."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, FiniteFloat, model_validator

from pmg.pipeline.files.strict_tables import (
    Strict,
    number_within,
    one_of,
    refuse,
    refuse_twice,
    refusing,
    within,
    word_of,
)
from pmg.pipeline.files.table_file import read_table_file
from pmg.pipeline.fit.calibration import CONSTANTS
from pmg.pipeline.model.model_file import MOTION_SCHEMA, SCHEMA, Model, Part
from pmg.sim.errors import BenchError, near_miss
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.mechanisms import CANDIDATES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.fit.options import AnalysisOptions
    from pmg.sim.mechanisms import Mechanism, Parameter

KIND_OF = {kind.identifier: kind for kind in CANDIDATES}
Speed = Annotated[float, within(1e-3, 1e6, "rad/s")]


class _StatedQuantity(Strict):
    """A value, which may be written alone, with its unit and standard error."""

    value: FiniteFloat
    standard_error: Annotated[FiniteFloat, Field(ge=0.0)] | None = None
    unit: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _alone(cls, given: object) -> object:
        return given if isinstance(given, dict) else {"value": given}

    def checked(self, known: Parameter, *key: str) -> float:
        """The value, inside the bounds of what it is; `key` leads to it."""
        with refusing(*key, "value"):
            number_within(self.value, *known.bounds, known.unit)
        if self.unit not in (None, known.unit):
            refuse(repr(self.unit), f'"{known.unit}"', "Convert the value.", *key, "unit")
        return self.value


def _constant(name: str) -> AfterValidator:
    """A check that a quantity lies inside the bounds of a constant of the baseline."""

    def check(given: _StatedQuantity) -> _StatedQuantity:
        given.checked(CONSTANTS[name])
        return given

    return AfterValidator(check)


def _exponents(powers: list[float]) -> list[float]:
    if not powers or min(powers) < 0.0 or len(set(powers)) != len(powers):
        refuse(repr(powers), "exponents from 0 up, each once", "Correct the list.")
    return powers


class _CurveTable(Strict):
    """A loss curve: powers of speed and their coefficients; a standard error that is not known is nan."""

    powers: Annotated[list[FiniteFloat], AfterValidator(_exponents)]
    coefficients_nm: list[FiniteFloat]
    standard_errors_nm: list[float] | None = None
    speed_reference_rad_per_s: Speed
    speed_limit_rad_per_s: Speed

    @model_validator(mode="after")
    def _one_for_each_power(self) -> _CurveTable:
        for key, numbers in (
            ("coefficients_Nm", self.coefficients_nm),
            ("standard_errors_Nm", self.standard_errors_nm or self.powers),
        ):
            if len(numbers) != len(self.powers):
                refuse(f"{len(numbers)} numbers", f"{len(self.powers)}, one for each power", "Complete the list.", key)
        return self

    def curve(self) -> LossCurve:
        """The curve."""
        coefficients = np.array(self.coefficients_nm, dtype=float)
        return LossCurve(tuple(self.powers), coefficients, self.speed_reference_rad_per_s, self.speed_limit_rad_per_s)

    def errors(self, shaft: str) -> dict[str, float]:
        """Standard errors of the coefficients [N m], by shaft and power."""
        pairs = zip(self.powers, self.standard_errors_nm or (), strict=False)
        return {f"{shaft}[{power:g}]": error for power, error in pairs if math.isfinite(error)}


class _BaselineTable(Strict):
    """Table ``[baseline]``."""

    K_corr: Annotated[_StatedQuantity, _constant("K_corr")]
    b: Annotated[_StatedQuantity, _constant("b")]
    c: Annotated[_StatedQuantity, _constant("c")]
    d: Annotated[_StatedQuantity, _constant("d")]
    sun: _CurveTable
    ring: _CurveTable

    def losses(self) -> LossModel:
        """The baseline's losses."""
        magnetic = (self.K_corr.value, self.b.value, self.c.value, self.d.value)
        return LossModel(self.sun.curve(), self.ring.curve(), *magnetic)

    def errors(self) -> dict[str, float]:
        """Standard errors, by name of the parameter."""
        constants = {name: quantity for name, quantity in self if isinstance(quantity, _StatedQuantity)}
        return {**_errors_of(constants), **self.sun.errors("sun"), **self.ring.errors("ring")}


def _errors_of(quantities: Mapping[str, _StatedQuantity]) -> dict[str, float]:
    """Standard errors of those that state one."""
    return {name: q.standard_error for name, q in quantities.items() if q.standard_error is not None}


class _MechanismTable(Strict):
    """A mechanism in addition to the baseline, as a table ``[[mechanism]]``."""

    id: Annotated[str, one_of(*KIND_OF)]
    refined: bool = False
    shaft: str
    component: str | None = None
    parameters: dict[str, _StatedQuantity]

    @property
    def kind(self) -> type[Mechanism]:
        """The mechanism of the catalogue, in more detail where that is asked for."""
        plain = KIND_OF[self.id]
        return plain.refined if self.refined and plain.refined is not None else plain

    @model_validator(mode="after")
    def _fits_the_mechanism(self) -> _MechanismTable:
        if self.refined and KIND_OF[self.id].refined is None:
            refuse("true", f"false: {self.id} has no more detail", "Take it out.", "refined")
        kind = self.kind
        shafts = (*kind.by_shaft, *(("both",) if kind.both_at_once else ()))
        component = str(kind.component_on(word_of(self.shaft, shafts, "shaft")))
        if self.component is not None:
            word_of(self.component, [component], "component")
        known = {p.name: p for p in kind.parameters() if p.name in names_on(kind, self.shaft)}
        for name, quantity in self.parameters.items():
            if name not in known:
                refuse("unknown key", f"a parameter of {self.id}", near_miss(name, known), "parameters", name)
            quantity.checked(known[name], "parameters", name)
        sizes = [name for name in known if name not in kind.shape]
        if not set(sizes) & set(self.parameters):
            refuse("no size", f"one of {', '.join(sizes)}", "Add it, or take the mechanism out.", "parameters")
        return self

    def part(self) -> Part:
        """The mechanism with its numbers."""
        given = {name: self.parameters[name] for name in names_on(self.kind, self.shaft) if name in self.parameters}
        values = {name: quantity.value for name, quantity in given.items()}
        return Part(self.kind, self.shaft, values, _errors_of(given))


def _of_steady_points(value: object) -> str:
    if value == MOTION_SCHEMA:
        refuse(repr(value), f'"{SCHEMA}"', "It is a model of runs in motion: use it on a campaign of such runs alone.")
    return word_of(value, (SCHEMA,))


class _ModelTable(Strict):
    """All tables of a model file."""

    schema_: Annotated[str, BeforeValidator(_of_steady_points), Field(alias="schema")]
    provenance: dict[str, Annotated[str, BeforeValidator(str)]] = Field(default_factory=dict)
    baseline: _BaselineTable
    mechanism: list[_MechanismTable] = Field(default_factory=list)

    @model_validator(mode="after")
    def _each_once(self) -> _ModelTable:
        refuse_twice((part.id for part in self.mechanism), "mechanism", "id")
        return self


def read_model(path: Path) -> Model:
    """The model in a file.

    Raises
    ------
    BenchError
        The file is not there, is no TOML, or holds something unknown, contradictory or out of its bounds.
    """
    given = read_table_file(path, "a model that 'pmg compare' wrote,", _ModelTable).table
    baseline, parts = given.baseline, tuple(part.part() for part in given.mechanism)
    return Model(baseline.losses(), baseline.errors(), parts, given.provenance)


def with_model(options: AnalysisOptions, path: Path, correction: str | None) -> AnalysisOptions:
    """Choices of an analysis that holds K_corr where a model has it; its curves and damping are of its own campaign."""
    model = read_model(path)
    if correction is not None:
        came = f"K_corr = {model.baseline.correction:g} of {path} and --k-corr {correction}"
        raise BenchError("pmg analyse", came, "one of them", "Leave --model or --k-corr out.")
    return replace(options, correction=repr(model.baseline.correction))


def names_on(kind: type[Mechanism], shaft: str) -> tuple[str, ...]:
    """Names of the parameters of a mechanism that count on a shaft: sizes, then shapes."""
    groups: Mapping[str, tuple[str, ...]] = kind.by_shaft
    chosen = groups.values() if shaft not in groups else [groups[shaft]]
    return (*dict.fromkeys(name for names in chosen for name in names), *kind.shape)
