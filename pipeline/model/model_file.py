"""A model with the physics in: baseline and named mechanisms, kept as TOML for people to read and change."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.calibration import CONSTANTS, parameter_names, parameter_values
from pmg.sim.mechanisms import CANDIDATES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.diagnosis.grid.refit import Refit
    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.losscurve import LossCurve
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.mechanisms import Mechanism

SCHEMA, MOTION_SCHEMA = "pmg.model/1", "pmg.motion-model/1"
"""Of a model of steady points, and of one of runs in motion."""
FILE = "model.toml"


@dataclass(frozen=True)
class Part:
    """A mechanism in addition to the baseline.

    Parameters
    ----------
    kind : type of Mechanism
        From the catalogue.
    shaft : str
        ``sun``, ``ring`` or ``both``.
    values : mapping of str to float
        Its parameters; those that are not there have their null.
    errors : mapping of str to float
        Their standard errors, where they have one.
    """

    kind: type[Mechanism]
    shaft: str
    values: Mapping[str, float]
    errors: Mapping[str, float] = field(default_factory=dict)

    def mechanism(self, bench: BenchParameters, model: LossModel) -> Mechanism:
        """The mechanism on the numbers of a bench and a baseline."""
        return replace(self.kind.of(bench, model), **self.values)


@dataclass(frozen=True)
class Model:
    """Baseline and mechanisms.

    Parameters
    ----------
    baseline : LossModel
        As it is with the mechanisms in.
    errors : mapping of str to float
        Standard errors of its parameters, by the names of `pmg.pipeline.fit.calibration.parameter_names`, where they
        have one.
    parts : tuple of Part
        The mechanisms.
    provenance : mapping of str to str
        Campaign, version of pmg, hash of the measured grid, verdict.
    """

    baseline: LossModel
    errors: Mapping[str, float] = field(default_factory=dict)
    parts: tuple[Part, ...] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)

    def mechanisms(self, bench: BenchParameters, baseline: LossModel | None = None) -> tuple[Mechanism, ...]:
        """The mechanisms, on the model's own baseline or on another one."""
        return tuple(part.mechanism(bench, baseline or self.baseline) for part in self.parts)

    @property
    def description(self) -> str:
        """The mechanisms by name, for people."""
        return ", ".join(f"{part.kind.title} ({part.shaft})" for part in self.parts) or "baseline alone"


def grid_digest(grid: Grid) -> str:
    """SHA-256 over what was measured: names, configurations, speeds and torques of the points."""
    digest, at = hashlib.sha256(), grid.points
    for column in (at.name, at.configuration):
        digest.update("\n".join(map(str, column)).encode() + b"\0")
    for values in (at.speed_sun, at.speed_ring, grid.torque_sun, grid.torque_ring):
        digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()


def model_of(grid: Grid, calibration: FittedBaseline, diagnosis: Diagnosis | None) -> Model:
    """The model that a campaign gives: with the mechanisms where some were named, else the calibrated baseline."""
    provenance = {"campaign": grid.campaign, "pmg": version("pmg-bench"), "grid_sha256": grid_digest(grid)}
    if diagnosis is not None:
        provenance["verdict"] = str(diagnosis.verdict)
    if diagnosis is not None and diagnosis.naming is not None and diagnosis.refit is not None:
        twins = [name for name, shaft in diagnosis.naming.shafts.items() if shaft == "either"]
        rivals = [" + ".join(f.candidate.identifier for f in r.explanation.fits) for r in diagnosis.rivals]
        provenance |= {"either_shaft": ", ".join(twins)} if twins else {}
        provenance |= {"cannot_be_told_from": "; ".join(rivals)} if rivals else {}
    if diagnosis is None or diagnosis.refit is None:
        errors = {name: calibration.standard_error(name) for name in calibration.names}
        return Model(calibration.model, _known(errors), (), provenance)
    return fitted_model(diagnosis.refit, provenance)


def fitted_model(found: Refit, provenance: Mapping[str, str]) -> Model:
    """The model that a joint fit gives."""
    parts = tuple(
        Part(
            candidate.kind,
            candidate.shaft,
            {p.name: float(value) for p, value in zip(candidate.parameters, values, strict=True)},
            _known({p.name: float(u) for p, u in zip(candidate.parameters, spread, strict=True)}),
        )
        for candidate, values, spread in zip(found.candidates, found.values, found.standard_errors, strict=True)
    )
    return Model(found.model, _known(found.baseline_errors), parts, provenance)


def _known(errors: Mapping[str, float | None]) -> dict[str, float]:
    return {name: float(u) for name, u in errors.items() if u is not None and math.isfinite(u)}


def model_text(model: Model) -> str:
    """The model as TOML; numbers as their shortest decimals that read back bit for bit."""
    return "\n".join(_lines(model)) + "\n"


def _lines(model: Model) -> Iterator[str]:
    yield "# Model of the bench: calibrated baseline, and the mechanisms that a diagnosis named beside it."
    yield "# Use it with --model, or as 'model' under [losses] of a scenario. Values may be changed by hand."
    yield f"schema = {_word(SCHEMA)}"
    yield ""
    yield "[provenance]"
    yield from (f"{name} = {_word(value)}" for name, value in model.provenance.items())
    base, names = model.baseline, tuple(CONSTANTS)
    values = dict(zip(parameter_names(base, names), parameter_values(base, names).tolist(), strict=True))
    yield ""
    yield "[baseline]"
    for name, known in CONSTANTS.items():
        yield f"{name} = {_quantity(values[name], model.errors.get(name), known.unit)}"
    for shaft, curve in base.curves.items():
        yield ""
        yield f"[baseline.{shaft}]  # loss torque [N m]: sum of coefficient x (speed / speed_reference)^power"
        yield from _curve(shaft, curve, model.errors)
    for part in model.parts:
        yield ""
        yield "[[mechanism]]"
        yield f"id = {_word(part.kind.identifier)}  # {part.kind.title}"
        if _is_refined(part.kind):
            yield "refined = true"
        yield f"shaft = {_word(part.shaft)}"
        yield f"component = {_word(str(part.kind.component_on(part.shaft)))}"
        yield "[mechanism.parameters]"
        for known in part.kind.parameters():
            if known.name in part.values:
                quantity = _quantity(part.values[known.name], part.errors.get(known.name), known.unit)
                yield f"{known.name} = {quantity}  # {known.meaning}"


def _is_refined(kind: type[Mechanism]) -> bool:
    """Whether it is the more detailed form of a mechanism of the catalogue."""
    return kind not in CANDIDATES


def _curve(shaft: str, curve: LossCurve, errors: Mapping[str, float]) -> Iterator[str]:
    coefficients = curve.coefficients.tolist()
    yield f"powers = {_numbers(curve.powers)}"
    yield f"coefficients_Nm = {_numbers(coefficients)}"
    spread = [errors.get(f"{shaft}[{p:g}]", math.nan) for p in curve.powers]
    if any(map(math.isfinite, spread)):
        yield f"standard_errors_Nm = {_numbers(spread)}"
    yield f"speed_reference_rad_per_s = {float(curve.speed_reference)!r}"
    yield f"speed_limit_rad_per_s = {float(curve.speed_limit)!r}  # fastest tested; beyond, along the tangent"


def _numbers(values: Iterable[float]) -> str:
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def _quantity(value: float, error: float | None, unit: str) -> str:
    spread = "" if error is None else f"standard_error = {float(error)!r}, "
    return f"{{ value = {float(value)!r}, {spread}unit = {_word(unit)} }}"


def _word(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
