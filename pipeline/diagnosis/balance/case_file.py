"""A case in the words of a TOML file: which recordings, how they are prepared, which terms are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from pydantic import BeforeValidator, Field, model_validator

from pmg.pipeline.diagnosis.balance.drive import LIBRARIES
from pmg.pipeline.files.strict_tables import EACH_ONCE, Strict, number_within, one_of, refuse, refusing, within, word_of
from pmg.pipeline.files.table_file import read_table_file
from pmg.pipeline.importers.csv_dialect import CsvForm
from pmg.sim.errors import near_miss

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.axis import Axis
    from pmg.pipeline.diagnosis.balance.term import Motion, Term

SCHEMA = "pmg.terms/1"
"""Schema of the case file."""

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
"""Units of a time channel, and what one is in SI."""

COMMANDS = ("V", "A")
"""Units of a command, of which a factor makes a force or a torque."""


def _newton(value: object) -> object:
    return value if isinstance(value, str) else number_within(value, -1e9, 1e9, "N or N m")


class Channel(Strict):
    """A channel of the recordings: column or variable, and its unit there; of a command, what one unit of it makes."""

    name: str
    unit: str
    newton_per_unit: Annotated[str | float, BeforeValidator(_newton)] | None = None
    newton_metre_per_unit: Annotated[str | float, BeforeValidator(_newton)] | None = None

    @property
    def factor(self) -> str | float:
        """Force or torque per unit of a command: a number, or the name of a variable of the file."""
        given = self.newton_per_unit if self.newton_metre_per_unit is None else self.newton_metre_per_unit
        return 1.0 if given is None else given


class _ChannelsTable(Strict):
    """Table ``[channels]``: position or speed, or both; force or torque, none of a machine that coasts."""

    time: Channel
    position: Channel | None = None
    velocity: Channel | None = None
    force: Channel | None = None
    torque: Channel | None = None

    def of(self, axis: Axis) -> dict[str, tuple[Channel, float]]:
        """Channels that are there, and what one unit of each is in SI; what drives the machine is ``force``."""
        if self.position is None and self.velocity is None:
            refuse("neither position nor velocity", "one of them", "Name a channel that moves.", "channels")
        other = "torque" if axis.pushes == "force" else "force"
        if getattr(self, other) is not None:
            refuse(other, axis.pushes, "Choose the library of the axis, or rename the channel.", "channels", other)
        found = {}
        units = {"time": TIMES, "position": axis.positions, "velocity": axis.speeds, axis.pushes: axis.forces}
        for kind, known in units.items():
            channel: Channel | None = getattr(self, kind)
            if channel is not None:
                word_of(channel.unit, known, "channels", kind, "unit")
                _check_factor(channel, axis, kind)
                found["force" if kind == axis.pushes else kind] = channel, known[channel.unit]
        return found


def _check_factor(channel: Channel, axis: Axis, kind: str) -> None:
    """Refuse a command without its factor, and a factor where none belongs."""
    needs = channel.unit in COMMANDS
    for key in ("newton_per_unit", "newton_metre_per_unit"):
        given = getattr(channel, key)
        if given is not None and (key != axis.factor or kind != axis.pushes):
            refuse(f"{given}", f"{axis.factor} of a {axis.pushes} only", "Leave it out.", "channels", kind, key)
        if given == 0.0:
            refuse("0", "a factor other than zero", "Correct the value.", "channels", kind, key)
    if needs and getattr(channel, axis.factor) is None:
        expected = f"{axis.push} of one {channel.unit}"
        refuse("missing", expected, f"Add {axis.factor}.", "channels", kind, axis.factor)


class _RecordTable(Strict):
    """Table ``[record]``: recordings, in a folder next to the file."""

    folder: str = "."
    fit: str
    withheld: str = ""


class PrepareTable(Strict):
    """Table ``[prepare]``: a zero-phase Butterworth low-pass, samples left out at both ends, decimation.

    Left out are as many samples as the filter takes to settle, unless `drop` says otherwise; below the rest speed the
    machine counts as at rest, by default where noise hides that it moves.
    """

    rate_hz: Annotated[float, within(1.0, 1e6, "Hz")]
    low_pass_hz: float
    order: Annotated[int, within(1, 8)] = 4
    drop: Annotated[int, within(1, 100_000)] | None = None
    keep_every: Annotated[int, within(1, 100)] = 1
    rest_speed_m_s: Annotated[float, within(0.0, 10.0, "m/s")] | None = None
    rest_speed_rad_s: Annotated[float, within(0.0, 1000.0, "rad/s")] | None = None

    @model_validator(mode="after")
    def _below_half_the_rate(self) -> PrepareTable:
        with refusing("low_pass_Hz"):
            number_within(self.low_pass_hz, 0.01, 0.49 * self.rate_hz, "Hz")
        return self

    @property
    def rest_speed(self) -> float | None:
        """Speed below which the machine counts as at rest [SI]; None where the data say it."""
        return self.rest_speed_m_s if self.rest_speed_rad_s is None else self.rest_speed_rad_s


class _KnownTermsTable(Strict):
    """Table ``[baseline]``: terms taken for granted, and amplitudes that are known [SI]."""

    terms: Annotated[list[str], Field(min_length=1), EACH_ONCE]
    fixed: dict[str, float] = Field(default_factory=dict)


class Published(Strict):
    """A published parameter that ours is compared with."""

    term: str
    parameter: str
    value: Annotated[float, within(-1e12, 1e12)]
    unit: str


class _ErrorsTable(Strict):
    """Table ``[published_errors]``: relative force errors [%]."""

    fit_percent: Annotated[float, within(0.0, 1e4, "%")] | None = None
    withheld_percent: Annotated[float, within(0.0, 1e4, "%")] | None = None


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
    published: list[Published] = Field(default_factory=list)
    published_errors: _ErrorsTable = _ErrorsTable()

    @model_validator(mode="after")
    def _fits_the_library(self) -> _CaseTable:
        axis, library = LIBRARIES[self.library]
        terms = {term.identifier: term for term in library}
        given = {"m": self.prepare.rest_speed_m_s, "rad": self.prepare.rest_speed_rad_s}
        for length in (length for length, value in given.items() if value is not None and length != axis.length):
            key = f"rest_speed_{length}_s"
            refuse(f"{key}", f"rest_speed_{axis.length}_s", "Give it in the unit of the axis.", "prepare", key)
        if "force" not in self.channels.of(axis) and self.baseline.fixed.get("inertia", 0.0) <= 0.0:
            do = "Coasting shows friction as part of the inertia only: fix that, or name the channel."
            refuse("missing", f"a {axis.pushes}, or baseline.fixed.inertia", do, "channels", axis.pushes)
        plain = [name for name, term in terms.items() if not term.of_model and term.shape is None]
        for i, name in enumerate(self.baseline.terms):
            word_of(name, plain, "baseline", "terms", i)
        for name, value in self.baseline.fixed.items():
            if name not in self.baseline.terms:
                do = near_miss(name, self.baseline.terms)
                refuse("not in the baseline", "a term of baseline.terms", do, "baseline", "fixed", name)
            with refusing("baseline", "fixed", name):
                number_within(value, *terms[name].amplitudes[0].bounds)
        if len(self.baseline.fixed) == len(self.baseline.terms):
            refuse("every term is fixed", "at least one free term", "Leave one out.", "baseline", "fixed")
        for i, row in enumerate(self.published):
            term = terms[word_of(row.term, terms, "published", i, "term")]
            quantities = {quantity.name: quantity for quantity in term.parameters}
            word_of(row.parameter, quantities, "published", i, "parameter")
            word_of(row.unit, [quantities[row.parameter].unit], "published", i, "unit")
        return self


@dataclass(frozen=True)
class Case:
    """A checked case file.

    Parameters
    ----------
    title : str
        What it is about.
    axis : Axis
        Whether it slides or turns.
    library : tuple of Term
        Terms that may be named.
    fit, withheld : Path
        Recordings; the second takes part in no fit, and in no choice but to drop refinements that hurt it. None without
        one.
    channels : dict of str to (Channel, float)
        ``time``; ``position``, ``velocity`` or both; ``force``, which may be missing; what one unit of each is in SI.
    form : CsvForm
        How they are written, if they are CSV.
    prepare : PrepareTable
        How they are filtered and thinned.
    baseline : tuple of str
        Terms that are taken for granted, their amplitudes free.
    fixed : dict of str to float
        Amplitudes of baseline terms that are known [SI].
    published : tuple of Published
        Parameters to compare with.
    published_errors : dict of str to float
        Relative force errors [1] on the recordings ``fit`` and ``withheld``.
    """

    title: str
    axis: Axis
    library: tuple[Term[Motion], ...]
    fit: Path
    withheld: Path | None
    channels: dict[str, tuple[Channel, float]]
    form: CsvForm
    prepare: PrepareTable
    baseline: tuple[str, ...]
    fixed: dict[str, float]
    published: tuple[Published, ...]
    published_errors: dict[str, float]


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
    record, errors = given.record, given.published_errors
    folder = path.parent / record.folder if data is None else data
    axis, library = LIBRARIES[given.library]
    percents = {"fit": errors.fit_percent, "withheld": errors.withheld_percent}
    return Case(
        title=given.title,
        axis=axis,
        library=library,
        fit=folder / record.fit,
        withheld=folder / record.withheld if record.withheld else None,
        channels=given.channels.of(axis),
        form=given.csv,
        prepare=given.prepare,
        baseline=tuple(given.baseline.terms),
        fixed=given.baseline.fixed,
        published=tuple(given.published),
        published_errors={name: value / 100.0 for name, value in percents.items() if value is not None},
    )
