"""A case in the words of a TOML file: which recordings, how they are prepared, which terms are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.diagnose.balance.drive import LIBRARIES
from pmg.pipeline.files.toml import read_toml
from pmg.pipeline.files.toml_table import Reader
from pmg.sim.errors import BenchError, near_miss

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnose.balance.term import Term

SCHEMA = "pmg.terms/1"
"""Schema of the case file."""

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "position": {"m": 1.0, "mm": 1e-3, "um": 1e-6},
    "force": {"N": 1.0, "kN": 1e3, "V": 1.0, "A": 1.0},
}
"""Units of each channel, and what one is in SI; a command in V or A needs `newton_per_unit`."""


@dataclass(frozen=True)
class Channel:
    """A channel of the recordings.

    Parameters
    ----------
    name : str
        Column or variable.
    unit : str
        Unit in the file.
    scale : float
        SI value of one unit, without `factor`.
    factor : str or float
        Newton per unit of the command: a number, or the name of a variable of the file.
    """

    name: str
    unit: str
    scale: float
    factor: str | float = 1.0


@dataclass(frozen=True)
class Published:
    """A published parameter that ours is set beside."""

    term: str
    parameter: str
    value: float
    unit: str


@dataclass(frozen=True)
class Case:
    """A checked case file.

    Parameters
    ----------
    path : Path
        The file.
    text : str
        What stands in it.
    title : str
        What it is about.
    library : tuple of Term
        Terms that may be named.
    fit, withheld : Path
        Recordings; the second is never used for a choice or a fit. None without one.
    channels : dict of str to Channel
        ``time``, ``position`` and ``force``.
    rate : float
        Sample rate [Hz].
    low_pass : float
        Corner of the zero-phase Butterworth filter on position [Hz].
    order : int
        Its order.
    drop : int
        Samples left out at both ends.
    keep_every : int
        Decimation of the regression.
    rest_speed : float
        Speed below which the machine is at rest [m/s].
    baseline : tuple of str
        Terms that are taken for granted, their amplitudes free.
    fixed : dict of str to float
        Amplitudes of baseline terms that are known [SI].
    published : tuple of Published
        Parameters to compare with.
    published_errors : dict of str to float
        Relative force errors [1] on the recordings ``fit`` and ``withheld``.
    """

    path: Path
    text: str
    title: str
    library: tuple[Term, ...]
    fit: Path
    withheld: Path | None
    channels: dict[str, Channel]
    rate: float
    low_pass: float
    order: int
    drop: int
    keep_every: int
    rest_speed: float
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
    file = read_toml(path, "a case")
    top = Reader(str(path), file.data)
    schema = top.text("schema")
    if schema != SCHEMA:
        raise BenchError(f"{path}: schema", repr(schema), repr(SCHEMA), "Write the case anew for this schema.")
    title = top.text("title")
    library = LIBRARIES[top.word("library", LIBRARIES)]
    record, prepare, baseline = top.sub("record"), top.sub("prepare"), top.sub("baseline")
    beside = path.parent / record.text("folder", ".")
    folder = beside if data is None else data
    withheld = record.text("withheld", "")
    fit = folder / record.text("fit")
    columns = top.sub("channels")
    channels = {name: _channel(columns.sub(name), name) for name in UNITS}
    names = _terms(baseline, library)
    fixed = _fixed(baseline.sub("fixed", optional=True), names, library)
    rate = prepare.number("rate_Hz", 1.0, 1e6)
    keep = prepare.whole("keep_every", 1, 100, 1)
    case = Case(
        path,
        file.text,
        title,
        library,
        fit,
        folder / withheld if withheld else None,
        channels,
        rate,
        prepare.number("low_pass_Hz", 0.01, 0.49 * rate),
        prepare.whole("order", 1, 8, 4),
        prepare.whole("drop", 1, 100_000, 49),
        keep,
        prepare.number("rest_speed_m_s", 0.0, 10.0, 0.0),
        names,
        fixed,
        tuple(_published(row, library) for row in top.rows("published")),
        _errors(top.sub("published_errors", optional=True)),
    )
    for reader in (top, record, prepare, baseline, columns):
        reader.done()
    return case


def _channel(reader: Reader, kind: str) -> Channel:
    name, unit = reader.text("name"), reader.word("unit", UNITS[kind])
    factor: str | float = 1.0
    if kind == "force":
        given = reader.table.get("newton_per_unit")
        needs = None if unit in ("V", "A") else 1.0
        text = isinstance(given, str)
        factor = reader.text("newton_per_unit") if text else reader.number("newton_per_unit", -1e9, 1e9, needs)
        if factor == 0.0:
            raise BenchError(f"{reader.where}: newton_per_unit", "0", "a factor other than zero", "Correct the value.")
    reader.done()
    return Channel(name, unit, UNITS[kind][unit], factor)


def _terms(reader: Reader, library: tuple[Term, ...]) -> tuple[str, ...]:
    known = [term.identifier for term in library if not term.of_model and term.shape is None]
    names = reader.words("terms", known)
    if len(set(names)) < len(names):
        raise BenchError(f"{reader.where}: terms", "a term twice", "each term once", "Take one of them out.")
    return tuple(names)


def _fixed(reader: Reader, baseline: tuple[str, ...], library: tuple[Term, ...]) -> dict[str, float]:
    terms = {term.identifier: term for term in library}
    fixed = {}
    for name in list(reader.table):
        if name not in baseline:
            do = near_miss(name, baseline)
            raise BenchError(f"{reader.where}: {name}", "not in the baseline", "a term of baseline.terms", do)
        fixed[name] = reader.number(name, *terms[name].amplitudes[0].bounds)
    if len(fixed) == len(baseline):
        raise BenchError(reader.where, "every term is fixed", "at least one free term", "Leave one out.")
    return fixed


def _published(reader: Reader, library: tuple[Term, ...]) -> Published:
    terms = {term.identifier: term for term in library}
    term = terms[reader.word("term", terms)]
    quantities = {quantity.name: quantity for quantity in term.parameters}
    quantity = quantities[reader.word("parameter", quantities)]
    row = Published(
        term.identifier, quantity.name, reader.number("value", -1e12, 1e12), reader.word("unit", [quantity.unit])
    )
    reader.done()
    return row


def _errors(reader: Reader) -> dict[str, float]:
    names = [name for name in ("fit", "withheld") if f"{name}_percent" in reader.table]
    given = {name: reader.number(f"{name}_percent", 0.0, 1e4) / 100.0 for name in names}
    reader.done()
    return given
