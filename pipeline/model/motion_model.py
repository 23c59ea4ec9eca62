"""A model of the bench in motion: constants and named causes, kept as TOML for people to read and change."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.library import library
from pmg.pipeline.diagnosis.motion.traces import named_fits
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.model.model_file import FILE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.terms import MotionTerm

SCHEMA = "pmg.motion-model/1"
OWN = ("zero", "ripple", "eccentricity", "pole_angle", "skew")
"""Beginnings of the names of constants that every campaign has of its own: clocks, zeros, and phases of a counter."""

TERMS = {term.key: term for term in library()}
"""Every candidate in motion by its key."""


@dataclass(frozen=True)
class MotionCause:
    """A cause with its numbers.

    Parameters
    ----------
    term : MotionTerm
        From the library.
    amplitudes : tuple of float
        Its sizes [SI].
    shape : float
        Its shape; NaN without one.
    """

    term: MotionTerm
    amplitudes: tuple[float, ...]
    shape: float = math.nan


@dataclass(frozen=True)
class MotionModel:
    """Constants of the bench in motion, and what a diagnosis named beside them.

    Parameters
    ----------
    campaign : str
        The runs that it is of.
    gear : int
        1 or 2.
    constants : mapping of str to (float, float)
        Value and standard error of each constant that another campaign has too [SI].
    causes : tuple of MotionCause
        What was named; a constant that is off its data sheet is among the constants.
    """

    campaign: str
    gear: int
    constants: Mapping[str, tuple[float, float]]
    causes: tuple[MotionCause, ...] = ()

    @property
    def description(self) -> str:
        """The causes by name, for people."""
        causes = ", ".join(f"{cause.term.title} ({cause.term.place})" for cause in self.causes)
        return f"Model of {self.campaign}, {causes or 'constants alone'}"


NO_MODEL = MotionModel("", 0, {})
"""Where none is given."""


def motion_model_of(diagnosis: MotionDiagnosis, given: MotionModel = NO_MODEL) -> MotionModel:
    """The model that runs in motion give; with the causes of a `given` one, which were taken out of them before."""
    rows = zip(diagnosis.before.sheet.names, diagnosis.constants, diagnosis.errors, strict=True)
    constants = {name: (float(v), float(u)) for name, v, u in rows if not name.startswith(OWN) and u > 0.0}
    found = []
    for fit, values in zip(named_fits(diagnosis), diagnosis.sizes, strict=False):
        term, count = TERMS[fit.candidate.key], len(fit.amplitudes)
        if not term.constants:
            shape = float(np.clip(values[count], *term.shape.bounds)) if term.shape is not None else math.nan
            found.append(MotionCause(term, tuple(values[:count].tolist()), shape))
    (gear,) = {stretch.run.run.gear for stretch in diagnosis.before.stretches if stretch.run.run.manoeuvre.moves}
    return MotionModel(diagnosis.campaign, gear, constants, (*given.causes, *found))


def _text(model: MotionModel) -> str:
    """The model as TOML; numbers as their shortest decimals that read back bit for bit."""
    return "\n".join(_lines(model)) + "\n"


def _lines(model: MotionModel) -> Iterator[str]:
    yield "# Model of the bench in motion: constants of its rotors, couplings and gear, and the causes that were named."
    yield "# Use it with 'pmg compare --model' on other runs in motion. Values may be changed by hand."
    yield f"schema = {json.dumps(SCHEMA)}"
    yield f"campaign = {json.dumps(model.campaign, ensure_ascii=False)}"
    yield f"gear = {model.gear}"
    yield f"pmg = {json.dumps(version('pmg-bench'))}"
    yield ""
    yield "[constants]  # SI units"
    for name, (value, error) in model.constants.items():
        yield f"{json.dumps(name)} = {{ value = {value!r}, standard_error = {error!r} }}"
    for cause in model.causes:
        yield ""
        yield f"[[cause]]  # {cause.term.title}: {cause.term.equation}"
        yield f"key = {json.dumps(cause.term.key)}"
        names = ", ".join(f"{q.name} [{q.unit}]" for q in cause.term.amplitudes)
        yield f"amplitudes = {list(cause.amplitudes)!r}  # {names}"
        if cause.term.shape is not None:
            yield f"shape = {cause.shape!r}  # {cause.term.shape.name} [{cause.term.shape.unit}]"


def leave_motion_model(model: MotionModel, folder: Path, given: Path | None) -> tuple[Path, ...]:
    """Write a model into a folder, and say where; a given one is not written over."""
    path = folder / FILE
    if given is not None and path.resolve() == given.resolve():
        return ()
    write_atomic(path, _text(model).encode())
    return (path,)
