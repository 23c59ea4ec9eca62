"""A case in the words of a TOML file: which recordings, how they are prepared, which terms are known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field, model_validator

from pmg.pipeline.diagnosis.balance.case import Case, check_model
from pmg.pipeline.diagnosis.balance.known_terms import check_parameters
from pmg.pipeline.diagnosis.balance.library.drive import LIBRARIES
from pmg.pipeline.files.strict_tables import EACH_ONCE, Strict, one_of, refuse, refusing
from pmg.pipeline.files.table_file import read_table_file
from pmg.pipeline.importers.csv_dialect import CsvForm
from pmg.pipeline.machine.channel import TIMES, Channel, PrepareTable, in_si
from pmg.pipeline.machine.tables import PublishedErrors, ShaftChannels, TermParameter

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.machine.axis import Axis

SCHEMA = "pmg.terms/1"
"""Schema of the case file."""


class _ChannelsTable(ShaftChannels):
    """Table ``[channels]``: position or speed, or both; force or torque, none of a machine that coasts."""

    time: Channel

    def with_time(self, axis: Axis) -> dict[str, tuple[Channel, float]]:
        """The times among those of the axis."""
        if self.position is None and self.velocity is None:
            refuse("neither position nor velocity", "one of them", "Name a channel that moves.", "channels")
        with refusing("channels", "time"):
            time = in_si(self.time, TIMES)
        with refusing("channels"):
            return {"time": time, **self.of(axis)}


class _RecordTable(Strict):
    """Table ``[record]``: recordings, in a folder next to the file."""

    folder: str = "."
    fit: str
    withheld: str = ""


class _KnownTermsTable(Strict):
    """Table ``[baseline]``: terms taken for granted, and amplitudes that are known [SI]."""

    terms: Annotated[list[str], Field(min_length=1), EACH_ONCE]
    fixed: dict[str, float] = Field(default_factory=dict)


class _CaseTable(Strict):
    """All tables of a case file."""

    schema_: Annotated[str, one_of(SCHEMA), Field(alias="schema")]
    title: str
    library: Annotated[str, one_of(*LIBRARIES)]
    record: _RecordTable
    channels: _ChannelsTable
    csv: CsvForm = CsvForm()
    prepare: PrepareTable
    baseline: _KnownTermsTable
    published: list[TermParameter] = Field(default_factory=list)
    published_errors: PublishedErrors = PublishedErrors()

    @model_validator(mode="after")
    def _fits_the_library(self) -> _CaseTable:
        axis, library = LIBRARIES[self.library]
        self.prepare.check_axis(axis, "prepare")
        if "force" not in self.channels.with_time(axis) and self.baseline.fixed.get("inertia", 0.0) <= 0.0:
            do = "Coasting shows friction as part of the inertia only: fix that, or name the channel."
            refuse("missing", f"a {axis.pushes}, or baseline.fixed.inertia", do, "channels", axis.pushes)
        check_model(library, self.baseline.terms, self.baseline.fixed, ("baseline",), "terms")
        check_parameters(library, self.published, "published")
        return self


def read_case(path: Path, data: Path | None = None) -> Case:
    """The case in a file.

    Parameters
    ----------
    path : Path
        TOML of schema `SCHEMA`.
    data : Path, optional
        Folder of the recordings, instead of the one that the file names.

    Raises
    ------
    BenchError
        When the file cannot be read, or asks for something unknown, out of range or contradictory.
    """
    given = read_table_file(path, "a case", _CaseTable).table
    record = given.record
    folder = path.parent / record.folder if data is None else data
    axis, library = LIBRARIES[given.library]
    return Case(
        title=given.title,
        axis=axis,
        library=library,
        fit=(folder / record.fit,),
        withheld=(folder / record.withheld,) if record.withheld else (),
        channels=given.channels.with_time(axis),
        form=given.csv,
        prepare=given.prepare,
        baseline=tuple(given.baseline.terms),
        fixed=given.baseline.fixed,
        published=tuple(given.published),
        published_errors=given.published_errors.parts,
    )
