"""The campaign file: which tables and keys it may hold, and how it is read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from pmg.pipeline.files.strict_tables import Strict, refuse, refuse_unknown, refusing
from pmg.pipeline.files.table_file import TableFile, read_table_file
from pmg.pipeline.grid.crosschecks.catalogue import CROSS_CHECKS, allowed_actions
from pmg.pipeline.settings.tolerance import Tolerances, tolerance
from pmg.pipeline.windows.limits_file import WindowsTable
from pmg.pipeline.wording.option_words import AUTO, check_powers, parse_correction, parse_damping, parse_powers
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.windows.limits import Steadiness
    from pmg.sim.errors import PmgError


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
            parse_correction(text)
        except FitError as problem:
            refuse(repr(value), problem.expected, problem.do)
    return text


def _damping(value: object) -> object:
    """Weights as their option names them."""
    if isinstance(value, str):
        try:
            parse_damping(value)
        except FitError as problem:
            refuse(repr(value), problem.expected, problem.do)
    return value


def _key(meaning: str, option: str, example: str) -> Any:  # noqa: ANN401 - what pydantic takes for a field
    """A key that may be left out: its meaning, the option that does the same, and a value as it may be written."""
    return Field(default=None, description=meaning, json_schema_extra={"option": option, "example": example})


Place = Annotated[str, Field(min_length=1)]
Terms = Annotated[str, BeforeValidator(_terms)]
Correction = Annotated[str, BeforeValidator(_correction)]
Damping = Annotated[str, BeforeValidator(_damping)]


class RecordingsTable(Strict):
    """Campaign to be analysed; paths are relative to the file."""

    path: Place | None = _key("folder of recordings, or one file", "RECORDINGS", '"recordings"')
    grids: Place | None = _key("folder of published grids, instead of recordings", "--grids", '"raw/published"')
    campaign: str | None = _key("which campaign, if the store holds several", "--campaign", '"reference"')
    machine: Place | None = _key("machine file of another magnetic gear, or one that ships", "--machine", '"my.toml"')


class StoreTable(Strict):
    """Where decoded runs and results are kept."""

    path: Place | None = _key("folder of the store; made if absent", "--store", '"store"')


class ReportTable(Strict):
    """Where the report goes."""

    path: Place | None = _key("folder of the report", "--report", '"report"')


class IngestTable(Strict):
    """Options for decoding recordings."""

    workers: Annotated[int, Field(ge=1)] | None = _key("parallel workers", "--workers", "2")
    scheduler: str | None = _key("address of a dask cluster", "--scheduler", '"tcp://host:8786"')
    limits: Place | None = _key("file with a table [windows], instead of the table here", "--limits", '"limits.toml"')
    map: Place | None = _key("file with what recordings lack: run, calibration, channels", "--map", '"map.toml"')


class AnalysisTable(Strict):
    """Options for fitting losses."""

    terms_sun: Terms | None = _key("powers of speed in the sun's loss curve, or auto", "--terms-sun", '"0,1/2,1,2"')
    terms_ring: Terms | None = _key("the same for the ring", "--terms-ring", '"auto"')
    k_corr: Correction | None = _key("correction factor: joint, rule, or a number", "--k-corr", '"joint"')
    include_rest: bool | None = _key("use readings of resting shafts in the curves", "--include-rest", "false")
    robust: bool | None = _key("Huber's M-estimate instead of least squares", "--robust", "false")
    damping: Damping | None = _key("weights of the calibration: least-squares or bisquare", "--damping", '"bisquare"')


def _tolerances(table: object) -> object:
    """The tolerances of a table, each by its word: name of the signal, and its parts as `tolerance` gives them."""
    if not isinstance(table, dict):
        return table
    found: dict[str, tuple[str, tuple[float, float]]] = {}
    for word, text in table.items():
        if not isinstance(text, str):
            refuse(repr(text), "text in quotation marks", "Correct the value.", word)
        with refusing(word):
            name, parts = tolerance(word, text, "")
        if name in (other for other, _ in found.values()):
            refuse(f"a second tolerance of {name}", "one", "Leave one of them out.", word)
        found[word] = (name, parts)
    return found


CHECKS = "checks"
"""Table of the actions of cross-checks."""


def _checks(table: object) -> object:
    """The actions of a table, each by the name of a cross-check."""
    if not isinstance(table, dict):
        return table
    refuse_unknown(table, [check.name for check in CROSS_CHECKS], "a cross-check")
    for name, action in table.items():
        if action not in (allowed := allowed_actions(name)):
            refuse(repr(action), " or ".join(f'"{each}"' for each in allowed), "Choose one of them.", name)
    return table


class CompareTable(Strict):
    """Options for comparing simulation and bench."""

    note: str | None = _key("printed at the head of the report", "--note", '"first run after the rebuild"')
    model: Place | None = _key("model file to simulate", "--model", '"model.toml"')
    tolerance: Annotated[dict[str, tuple[str, tuple[float, float]]], BeforeValidator(_tolerances)] | None = _key(
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
    windows: Annotated[WindowsTable | None, BeforeValidator(lambda table: table or None)] = Field(
        default=None, description="What counts as a steady window."
    )
    checks: Annotated[dict[str, str], BeforeValidator(_checks)] = Field(
        default_factory=dict, description="What is done where a recording contradicts what else is known."
    )
    analysis: AnalysisTable = AnalysisTable()
    compare: CompareTable = CompareTable()

    @model_validator(mode="after")
    def _one_of_two(self) -> Campaign:
        if self.recordings.path is not None and self.recordings.grids is not None:
            refuse("together with recordings.path", "one of the two", "Leave one of them out.", "recordings", "grids")
        if self.ingest.limits is not None and self.windows is not None:
            refuse("together with ingest.limits", "one of the two", "Leave one of them out.", "windows")
        return self

    @property
    def tolerances(self) -> Tolerances:
        """Tolerances by signal."""
        return {} if self.compare.tolerance is None else dict(self.compare.tolerance.values())


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


MACHINE_KEY = "recordings.machine"
"""Key that names a file next to this one, or a machine that ships."""


@dataclass(frozen=True)
class CampaignFile:
    """A checked campaign file.

    Parameters
    ----------
    file : TableFile
        The file.
    values : dict
        What it sets, by full key such as ``analysis.k_corr``; paths are complete.
    """

    file: TableFile[Campaign]
    values: dict[str, Any]

    @property
    def windows(self) -> Steadiness | None:
        """Limits from its table ``[windows]``; None without one."""
        return self.file.table.windows

    def count(self, table: str) -> int:
        """Count of keys in a table of the file."""
        return sum(words[0] == table and len(words) == 2 for words in self.file.lines)

    def has(self, name: str) -> bool:
        """Whether a full key stands in the file."""
        return tuple(name.split(".")) in self.file.lines

    def origin(self, name: str) -> str:
        """File and line of a full key."""
        return f"{self.file.path}:{self.file.lines[tuple(name.split('.'))]}"


def read_campaign(path: Path, faults: list[PmgError] | None = None) -> CampaignFile:
    """The campaign file at a path.

    Parameters
    ----------
    path : Path
        The file.
    faults : list of PmgError, optional
        Receives every fault of its tables; the file is then read without the keys at fault.

    Raises
    ------
    BenchError
        The file cannot be read, is no TOML, or holds something unknown, out of range or contradictory; with the line.
    """
    file = read_table_file(path, "a campaign", Campaign, faults=faults)
    values = {
        f"{table}.{name}": value
        for table, part in file.table
        if isinstance(part, Strict)
        for name, value in part
        if value is not None and name != "tolerance"
    }
    if MACHINE_KEY in values and (path.parent / values[MACHINE_KEY]).is_file():
        values[MACHINE_KEY] = str(path.parent / values[MACHINE_KEY])
    return CampaignFile(file, {name: path.parent / value if name in PATHS else value for name, value in values.items()})
