"""The campaign file: which tables and keys it may hold, and how it is read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError

from pmg.pipeline.files.refusals import first_fault, keys_of, refusal
from pmg.pipeline.files.strict_tables import Strict, refuse
from pmg.pipeline.files.toml import read_toml
from pmg.pipeline.fit.loss_fit import check_powers
from pmg.pipeline.fit.options import AUTO, AnalysisOptions, parse_powers
from pmg.pipeline.settings.tolerance import Tolerances, tolerances
from pmg.pipeline.windows.limits import limit_of, limits_of
from pmg.sim.errors import BenchError, FitError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.files.toml import TomlFile


def _terms(value: object) -> object:
    """Terms as their option writes them; a list of numbers is as good as the text."""
    numbers = isinstance(value, list) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
    text = ",".join(f"{v!r}" for v in value) if isinstance(value, list) and numbers else value
    if isinstance(text, str) and text != AUTO:
        try:
            check_powers(parse_powers(text, ""))
        except FitError as problem:
            refuse(repr(value), problem.expected, problem.do)
    return text


def _correction(value: object) -> object:
    """K_corr as its option writes it."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    text = repr(value) if number else value
    if isinstance(text, str):
        try:
            _ = AnalysisOptions(correction=text).fixed_correction
        except FitError as problem:
            refuse(repr(value), problem.expected, problem.do)
    return text


def key(meaning: str, option: str, example: str) -> Any:  # noqa: ANN401 - what pydantic takes for a field
    """A key that may be left out: its meaning, the option that does the same, and a value as it may be written."""
    return Field(default=None, description=meaning, json_schema_extra={"option": option, "example": example})


Place = Annotated[str, Field(min_length=1)]
Terms = Annotated[str, BeforeValidator(_terms)]
Correction = Annotated[str, BeforeValidator(_correction)]


class RecordingsTable(Strict):
    """What is analysed; paths are relative to the file."""

    path: Place | None = key("folder of recordings, or one file", "RECORDINGS", '"recordings"')
    grids: Place | None = key("folder of published grids, instead of recordings", "--grids", '"raw/published"')
    campaign: str | None = key("which campaign, if the store holds several", "--campaign", '"reference"')


class StoreTable(Strict):
    """Where decoded runs and results are kept."""

    path: Place | None = key("folder of the store; made if absent", "--store", '"store"')


class ReportTable(Strict):
    """Where the report goes."""

    path: Place | None = key("folder of the report", "--report", '"report"')


class IngestTable(Strict):
    """How recordings are decoded."""

    workers: Annotated[int, Field(ge=1)] | None = key("parallel workers", "--workers", "2")
    scheduler: str | None = key("address of a dask cluster", "--scheduler", '"tcp://host:8786"')
    limits: Place | None = key("file with a table [windows], instead of the table here", "--limits", '"limits.toml"')
    map: Place | None = key("file with what recordings lack: run, calibration, channels", "--map", '"map.toml"')


class AnalysisTable(Strict):
    """How losses are fitted."""

    terms_sun: Terms | None = key("powers of speed in the sun's loss curve, or auto", "--terms-sun", '"0,1/2,1,2"')
    terms_ring: Terms | None = key("the same for the ring", "--terms-ring", '"auto"')
    k_corr: Correction | None = key("correction factor: joint, rule, or a number", "--k-corr", '"joint"')
    include_rest: bool | None = key("use readings of resting shafts in the curves", "--include-rest", "false")
    robust: bool | None = key("Huber's M-estimate instead of least squares", "--robust", "false")


class CompareTable(Strict):
    """How simulation and bench are compared."""

    note: str | None = key("told at the head of the report", "--note", '"first run after the rebuild"')
    model: Place | None = key("model file to simulate", "--model", '"model.toml"')
    tolerance: dict[str, str] | None = key(
        "by signal: absolute, relative in %, or the larger of both",
        "",
        '{ torque_sun = "10 mN m or 2 %", efficiency = "1 %", loss = "0.5 W" }',
    )


class Campaign(Strict):
    """All tables of a campaign file; each may be left out."""

    recordings: RecordingsTable = RecordingsTable()
    store: StoreTable = StoreTable()
    report: ReportTable = ReportTable()
    ingest: IngestTable = IngestTable()
    windows: dict[str, Any] = Field(default_factory=dict, description="What counts as a steady window.")
    analysis: AnalysisTable = AnalysisTable()
    compare: CompareTable = CompareTable()


PATHS = (
    "recordings.path",
    "recordings.grids",
    "store.path",
    "report.path",
    "ingest.limits",
    "ingest.map",
    "compare.model",
)
"""Keys that name files or folders, relative to the file they stand in."""


@dataclass(frozen=True)
class CampaignFile:
    """A checked campaign file.

    Parameters
    ----------
    file : TomlFile
        The file.
    values : dict
        What it sets, by full key such as ``analysis.k_corr``; paths are complete.
    windows : dict
        Its table ``[windows]``.
    tolerance : Tolerances
        By signal.
    lines : dict of str to int
        Line of each full key.
    """

    file: TomlFile
    values: dict[str, Any]
    windows: dict[str, Any]
    tolerance: Tolerances
    lines: Mapping[str, int]

    def origin(self, name: str) -> str:
        """File and line of a key."""
        return f"{self.file.path}:{self.lines[name]}"


def read_campaign(path: Path) -> CampaignFile:
    """The campaign file at a path.

    Raises
    ------
    BenchError
        The file cannot be read, is no TOML, or holds something unknown, out of range or contradictory; with the line.
    RecordingError
        A limit of its windows is none.
    """
    file = read_toml(path, "a campaign")
    lines = {".".join(words): number for words, number in file.lines().items()}

    def where(name: str) -> str:
        words = name.split(".")
        line = next((lines[".".join(words[:n])] for n in range(len(words), 0, -1) if ".".join(words[:n]) in lines), 0)
        return f"{path}: line {line}, {name}" if line else str(path)

    try:
        campaign = Campaign.model_validate(file.data)
    except ValidationError as error:
        found = first_fault(error)
        words = keys_of(found)
        raise refusal(where(".".join(words)), found, Campaign, words[-1]) from None
    for name, given in campaign.windows.items():
        limit_of(name, given, f"{path}: line {lines[f'windows.{name}']}")
    limits_of(campaign.windows, str(path))
    values = {
        f"{table}.{name}": value
        for table, part in campaign
        if isinstance(part, Strict)
        for name, value in part
        if value is not None and name != "tolerance"
    }
    for one, other in (("recordings.path", "recordings.grids"), ("ingest.limits", "windows")):
        if one in values and (other in values or (other == "windows" and campaign.windows)):
            raise BenchError(where(other), f"beside {one}", "one of the two", "Leave one of them out.")
    table = campaign.compare.tolerance or {}
    allowed = tolerances(table, {word: where(f"compare.tolerance.{word}") for word in table})
    whole = {name: path.parent / value if name in PATHS else value for name, value in values.items()}
    return CampaignFile(file, whole, campaign.windows, allowed, lines)
