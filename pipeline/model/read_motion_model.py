"""A model of the bench in motion read from its TOML file, each fault reported with the file and the key."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

from pydantic import BeforeValidator, Field, FiniteFloat, model_validator

from pmg.pipeline.diagnosis.motion.constants import sheet_of
from pmg.pipeline.files.strict_tables import Strict, number_within, one_of, refuse, refusing, word_of
from pmg.pipeline.files.table_file import read_table_file
from pmg.pipeline.model.model_file import MOTION_SCHEMA, SCHEMA
from pmg.pipeline.model.motion_model import TERMS, MotionCause, MotionModel
from pmg.pipeline.model.read_model import read_model
from pmg.sim.errors import near_miss

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.model.model_file import Model
    from pmg.sim.bench import BenchParameters


class _ConstantTable(Strict):
    """A constant with its standard error [SI]."""

    value: FiniteFloat
    standard_error: Annotated[FiniteFloat, Field(gt=0.0)]


class _CauseTable(Strict):
    """A cause, as a table ``[[cause]]``."""

    key: Annotated[str, one_of(*TERMS)]
    amplitudes: list[FiniteFloat]
    shape: FiniteFloat | None = None

    @model_validator(mode="after")
    def _fits_the_term(self) -> _CauseTable:
        term = TERMS[self.key]
        if len(self.amplitudes) != len(term.amplitudes):
            expected = f"{len(term.amplitudes)}: {', '.join(q.name for q in term.amplitudes)}"
            refuse(f"{len(self.amplitudes)} numbers", expected, "Complete the list.", "amplitudes")
        for place, (value, known) in enumerate(zip(self.amplitudes, term.amplitudes, strict=True)):
            with refusing("amplitudes", place):
                number_within(value, *known.bounds, known.unit)
        if (self.shape is None) is not (term.shape is None):
            if term.shape is None:
                refuse("a shape", "none", "Take it out.", "shape")
            refuse("no shape", f"{term.shape.name} [{term.shape.unit}]", "Give it.", "shape")
        if term.shape is not None:
            with refusing("shape"):
                number_within(self.shape, *term.shape.bounds, term.shape.unit)
        return self

    def cause(self) -> MotionCause:
        """The cause with its numbers."""
        return MotionCause(TERMS[self.key], tuple(self.amplitudes), math.nan if self.shape is None else self.shape)


def _of_motion(value: object) -> str:
    if value == SCHEMA:
        refuse(repr(value), f'"{MOTION_SCHEMA}"', "It is a model of steady points: use it on a campaign that has some.")
    return word_of(value, (MOTION_SCHEMA,))


class _MotionModelTable(Strict):
    """All tables of a model file in motion."""

    schema_: Annotated[str, BeforeValidator(_of_motion), Field(alias="schema")]
    campaign: str
    gear: Annotated[int, Field(ge=1, le=2)]
    provenance: dict[str, Annotated[str, BeforeValidator(str)]] = Field(default_factory=dict)
    constants: dict[str, _ConstantTable]
    cause: list[_CauseTable] = Field(default_factory=list)


def read_motion_model(path: Path, bench: BenchParameters) -> MotionModel:
    """The model in a file.

    Raises
    ------
    BenchError
        The file is not there, is no TOML, or holds something unknown, contradictory or out of its bounds.
    """

    class OfThisBench(_MotionModelTable):
        @model_validator(mode="after")
        def _known_constants(self) -> OfThisBench:
            known = sheet_of(bench, self.gear, ()).names
            for name in self.constants:
                if name not in known:
                    refuse("unknown key", "a constant of the bench", near_miss(name, known), "constants", name)
            return self

    given = read_table_file(path, "a model that 'pmg compare' wrote of runs in motion,", OfThisBench).table
    constants = {name: (table.value, table.standard_error) for name, table in given.constants.items()}
    return MotionModel(
        given.campaign, given.gear, constants, tuple(cause.cause() for cause in given.cause), given.provenance
    )


def read_any_model(path: Path, bench: BenchParameters) -> Model | MotionModel:
    """The model in a file, of steady points or of runs in motion, as its schema says.

    Raises
    ------
    BenchError
        The file is not there, is no TOML, or holds something unknown, contradictory or out of its bounds.
    """
    text = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
    return read_motion_model(path, bench) if MOTION_SCHEMA in text else read_model(path)
