"""A model read from its TOML file, each fault told with the file and the key."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from pmg.pipeline.files.toml import read_toml
from pmg.pipeline.fit.calibration import CONSTANTS
from pmg.pipeline.model.model_file import SCHEMA, Model, Part
from pmg.sim.errors import BenchError, near_miss
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.mechanisms import CANDIDATES

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from pmg.pipeline.fit.options import AnalysisOptions
    from pmg.sim.mechanisms import Mechanism, Parameter

TOP = ("schema", "provenance", "baseline", "mechanism")
PART = ("id", "refined", "shaft", "component", "parameters")
QUANTITY = ("value", "standard_error", "unit")
CURVE = (
    "powers",
    "coefficients_Nm",
    "standard_errors_Nm",
    "speed_reference_rad_per_s",
    "speed_limit_rad_per_s",
)


@dataclass(frozen=True)
class _Place:
    """Where in a file something stands."""

    path: Path
    key: str = ""

    def __truediv__(self, name: object) -> _Place:
        return _Place(self.path, f"{self.key}.{name}".lstrip("."))

    def refuse(self, came: str, expected: str, do: str) -> NoReturn:
        where = f"{self.path}: {self.key}" if self.key else str(self.path)
        raise BenchError(where, came, expected, do)

    def table(self, given: object, known: Iterable[str]) -> dict[str, Any]:
        """A table that holds known keys only."""
        if not isinstance(given, dict):
            self.refuse(repr(given) if given is not None else "missing", "a table", "Correct the file.")
        known = tuple(known)
        for name in given:
            if name not in known:
                (self / name).refuse("unknown key", "a known one", near_miss(name, known))
        return given

    def number(self, given: object, low: float = -math.inf, high: float = math.inf, unit: str = "") -> float:
        """A finite number in a range."""
        told = f" {unit}" if unit not in ("", "1") else ""
        if given is None:
            self.refuse("missing", "a number", "Add the key.")
        if isinstance(given, bool) or not isinstance(given, int | float) or not math.isfinite(given):
            self.refuse(repr(given), "a finite number", "Correct the value.")
        if not low <= given <= high:
            self.refuse(f"{given:g}{told}", f"{low:g} to {high:g}{told}", "Choose a value in that range.")
        return float(given)

    def word(self, given: object, known: Iterable[str]) -> str:
        """One of some words."""
        known = tuple(known)
        if not isinstance(given, str) or given not in known:
            told = " or ".join(f'"{name}"' for name in known) if len(known) < 5 else "a known one"
            came = "missing" if given is None else repr(given)
            self.refuse(came, told, near_miss(str(given), known))
        return given


def read_model(path: Path) -> Model:
    """The model in a file.

    Raises
    ------
    BenchError
        The file is not there, is no TOML, or holds something unknown, contradictory or out of its bounds.
    """
    place = _Place(path)
    data = read_toml(path, "a model that 'pmg compare' wrote,").data
    schema = data.get("schema")
    if schema != SCHEMA:
        (place / "schema").refuse("missing" if schema is None else repr(schema), f'"{SCHEMA}"', "Name a model file.")
    place.table(data, TOP)
    provenance = data.get("provenance", {})
    (place / "provenance").table(provenance, provenance if isinstance(provenance, dict) else ())
    baseline, errors = _baseline(place / "baseline", data.get("baseline"))
    parts = data.get("mechanism", [])
    if not isinstance(parts, list):
        (place / "mechanism").refuse("a single table", "[[mechanism]], each in double brackets", "Correct the head.")
    made = tuple(_part(place / f"mechanism[{i}]", part) for i, part in enumerate(parts, start=1))
    ids = [part.kind.identifier for part in made]
    for i, name in enumerate(ids):
        if name in ids[:i]:
            (place / f"mechanism[{i + 1}]").refuse(f"{name} twice", "each mechanism once", "Join the two tables.")
    return Model(baseline, errors, made, {name: str(value) for name, value in provenance.items()})


def with_model(options: AnalysisOptions, path: Path, correction: str | None) -> AnalysisOptions:
    """Choices of an analysis that holds K_corr where a model has it; its curves and damping are of its own campaign."""
    model = read_model(path)
    if correction is not None:
        came = f"K_corr = {model.baseline.correction:g} of {path} beside --k-corr {correction}"
        raise BenchError("pmg analyse", came, "one of them", "Leave --model or --k-corr out.")
    return replace(options, correction=repr(model.baseline.correction))


def _baseline(place: _Place, given: object) -> tuple[LossModel, dict[str, float]]:
    table = place.table(given, (*CONSTANTS, "sun", "ring"))
    values: dict[str, float] = {}
    errors: dict[str, float] = {}
    for name, known in CONSTANTS.items():
        values[name] = _quantity(place / name, table.get(name), replace(known, name=name), errors)
    sun, ring = (_curve(place / shaft, table.get(shaft), shaft, errors) for shaft in ("sun", "ring"))
    return LossModel(sun, ring, values["K_corr"], values["b"], values["c"], values["d"]), errors


def _quantity(place: _Place, given: object, known: Parameter, errors: dict[str, float]) -> float:
    """A value inside its bounds, written alone or with its unit and standard error."""
    if not isinstance(given, dict):
        return place.number(given, *known.bounds, known.unit)
    table = place.table(given, QUANTITY)
    value = (place / "value").number(table.get("value"), *known.bounds, known.unit)
    if table.get("unit", known.unit) != known.unit:
        (place / "unit").refuse(repr(table["unit"]), f'"{known.unit}"', "Convert the value.")
    if "standard_error" in table:
        errors[known.name] = (place / "standard_error").number(table["standard_error"], 0.0)
    return value


def _curve(place: _Place, given: object, shaft: str, errors: dict[str, float]) -> LossCurve:
    table = place.table(given, CURVE)
    powers = _list(place / "powers", table.get("powers"))
    if not powers or min(powers) < 0.0 or len(set(powers)) != len(powers):
        (place / "powers").refuse(repr(list(powers)), "exponents from 0 up, each once", "Correct the list.")
    coefficients = _list(place / "coefficients_Nm", table.get("coefficients_Nm"), len(powers))
    spread = table.get("standard_errors_Nm")
    if spread is not None:
        found = _list(place / "standard_errors_Nm", spread, len(powers), holes=True)
        errors |= {f"{shaft}[{p:g}]": u for p, u in zip(powers, found, strict=True) if math.isfinite(u)}
    reference, limit = (
        (place / name).number(table.get(name), 1e-3, 1e6, "rad/s")
        for name in ("speed_reference_rad_per_s", "speed_limit_rad_per_s")
    )
    return LossCurve(powers, np.array(coefficients), reference, limit)


def _list(place: _Place, given: object, length: int | None = None, *, holes: bool = False) -> tuple[float, ...]:
    if not isinstance(given, list):
        place.refuse("missing" if given is None else repr(given), "a list of numbers", "Correct the value.")
    if length is not None and len(given) != length:
        place.refuse(f"{len(given)} numbers", f"{length}, one for each power", "Complete the list.")
    return tuple(
        math.nan if holes and isinstance(value, float) and math.isnan(value) else (place / i).number(value)
        for i, value in enumerate(given, start=1)
    )


def _part(place: _Place, given: object) -> Part:
    table = place.table(given, PART)
    kinds = {kind.identifier: kind for kind in CANDIDATES}
    kind = kinds[(place / "id").word(table.get("id"), kinds)]
    place = _Place(place.path, f"mechanism {kind.identifier}")
    refined = table.get("refined", False)
    if not isinstance(refined, bool) or (refined and kind.refined is None):
        (place / "refined").refuse(repr(refined), "true or false, where there is more detail", "Take it out.")
    if refined and kind.refined is not None:
        kind = kind.refined
    shafts = (*kind.by_shaft, *(("both",) if kind.both_at_once else ()))
    shaft = (place / "shaft").word(table.get("shaft"), shafts)
    (place / "component").word(table.get("component", str(kind.component_on(shaft))), (str(kind.component_on(shaft)),))
    known = {p.name: p for p in kind.parameters() if p.name in names_on(kind, shaft)}
    place = place / "parameters"
    numbers = place.table(table.get("parameters"), known)
    errors: dict[str, float] = {}
    values = {name: _quantity(place / name, numbers[name], known[name], errors) for name in known if name in numbers}
    if not set(values) - set(kind.shape):
        sizes = [name for name in known if name not in kind.shape]
        place.refuse("no size", f"one of {', '.join(sizes)}", "Add it, or take the mechanism out.")
    return Part(kind, shaft, values, errors)


def names_on(kind: type[Mechanism], shaft: str) -> tuple[str, ...]:
    """Names of the parameters of a mechanism that count on a shaft: sizes, then shapes."""
    groups: Mapping[str, tuple[str, ...]] = kind.by_shaft
    chosen = groups.values() if shaft not in groups else [groups[shaft]]
    return (*dict.fromkeys(name for names in chosen for name in names), *kind.shape)
