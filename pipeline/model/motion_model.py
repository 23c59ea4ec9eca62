"""A model of the bench in motion: constants and named causes, kept as TOML for people to read and change."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.traces import named_fits
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.model.model_file import FILE, MOTION_SCHEMA

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.motion.run import MovingRun

OWN = ("zero", "ripple", "eccentricity", "pole_angle", "skew")
"""Beginnings of the names of constants that every campaign has of its own: clocks, zeros, and phases of a counter."""

OF_CAMPAIGN = frozenset({"torque_zero_drift", "cogging", "shaft_unbalance", "coupling_misalignment"})
"""Causes that every campaign has in its own way: at its own time, or in the phase of a counter that began anew."""

WELL_KNOWN = 0.9
"""Standard error of a constant, over that of the data sheet, below which its runs have told something of it."""

SEEN = 1e-6
"""Length of a constant's column in the rows, over the longest, from which on the runs show it."""

TERMS = {term.key: term for term in library() if not term.constants and term.identifier not in OF_CAMPAIGN}
"""Every cause that other runs of the bench have too, by its key."""


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
    provenance : mapping of str to str
        Verdict, what cannot be told from the causes, what is not carried, hash of the recordings.
    """

    campaign: str
    gear: int
    constants: Mapping[str, tuple[float, float]]
    causes: tuple[MotionCause, ...] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)

    @property
    def description(self) -> str:
        """The causes by name, for people."""
        causes = ", ".join(f"{cause.term.title} ({cause.term.place})" for cause in self.causes)
        return f"Model of {self.campaign}, {causes or 'constants alone'}"


NO_MODEL = MotionModel("", 0, {})
"""Where none is given."""


def digest_of(runs: Iterable[MovingRun]) -> str:
    """SHA-256 over what was measured in some runs: names, torques and angles."""
    digest = hashlib.sha256()
    for run in runs:
        digest.update(run.name.encode() + b"\0")
        for values in (*(v for _, v in run.torque.items()), *(v for _, v in run.angle.items())):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()


def motion_model_of(
    diagnosis: MotionDiagnosis, runs: Iterable[MovingRun], given: MotionModel = NO_MODEL
) -> MotionModel:
    """The model that runs in motion give; with the causes of a `given` one, which were taken out of them before.

    A constant that the runs do not show, or tell no better than its data sheet does, is left out.
    """
    sheet, found = diagnosis.before.sheet, diagnosis.evidence
    length = np.linalg.norm(found.columns[~found.of_sheet], axis=0)
    seen = (length > SEEN * length.max()) & (diagnosis.errors < WELL_KNOWN * sheet.spread) & (diagnosis.errors > 0.0)
    rows = zip(sheet.names, diagnosis.constants, diagnosis.errors, seen, strict=True)
    constants = {name: (float(v), float(u)) for name, v, u, there in rows if there and not name.startswith(OWN)}
    causes, aside = [], []
    for fit, values in zip(named_fits(diagnosis), diagnosis.sizes, strict=False):
        term, count = TERMS.get(fit.candidate.key), len(fit.amplitudes)
        if term is not None:
            low, high = np.array([q.bounds for q in term.amplitudes]).T
            shape = float(np.clip(values[count], *term.shape.bounds)) if term.shape is not None else math.nan
            causes.append(MotionCause(term, tuple(np.clip(values[:count], low, high).tolist()), shape))
        elif fit.candidate.identifier in OF_CAMPAIGN:
            aside.append(fit.candidate.identifier)
    (gear,) = {stretch.run.run.gear for stretch in diagnosis.before.stretches if stretch.run.run.manoeuvre.moves}
    naming = diagnosis.naming
    rivals = () if naming is None or not diagnosis.verdict.names else naming.rivals
    provenance = {
        "verdict": str(diagnosis.verdict),
        "cannot_be_told_from": "; ".join(" + ".join(sorted(rival.ids)) for rival in rivals),
        "not_carried": ", ".join(aside),
        "runs_sha256": digest_of(runs),
    }
    return MotionModel(diagnosis.campaign, gear, constants, (*given.causes, *causes), provenance)


def _text(model: MotionModel) -> str:
    """The model as TOML; numbers as their shortest decimals that read back bit for bit."""
    return "\n".join(_lines(model)) + "\n"


def _lines(model: MotionModel) -> Iterator[str]:
    yield "# Model of the bench in motion: constants of its rotors, couplings and gear, and the causes that were named."
    yield "# Use it with 'pmg compare --model' on other runs in motion. Values may be changed by hand."
    yield f"schema = {json.dumps(MOTION_SCHEMA)}"
    yield f"campaign = {json.dumps(model.campaign, ensure_ascii=False)}"
    yield f"gear = {model.gear}"
    yield ""
    yield "[provenance]"
    for name, said in {"pmg": version("pmg-bench"), **model.provenance}.items():
        if said:
            yield f"{name} = {json.dumps(said, ensure_ascii=False)}"
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
