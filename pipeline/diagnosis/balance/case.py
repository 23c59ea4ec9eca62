"""A case: recordings of a machine, how they are prepared, which terms of which library are known."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pmg.pipeline.files.strict_tables import number_within, refuse, refusing, word_of
from pmg.sim.errors import near_miss

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.known_terms import SetTerm
    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term
    from pmg.pipeline.importers.csv_dialect import CsvForm
    from pmg.pipeline.machine.axis import Axis
    from pmg.pipeline.machine.channel import Channel, PrepareTable
    from pmg.pipeline.machine.tables import TermParameter
    from pmg.pipeline.recording.findings import Finding

OUTPUT = "output_"
"""What the channels of the second shaft begin with."""


@dataclass(frozen=True)
class SecondFile:
    """Files of a second shaft, on a clock of their own.

    Parameters
    ----------
    replace : tuple of str
        What in the name of the first file is to be replaced, and by what.
    time : (Channel, float)
        Their times, and what one unit is in SI.
    """

    replace: tuple[str, str]
    time: tuple[Channel, float]

    def of(self, path: Path) -> Path:
        """The file beside the first one."""
        return path.with_name(path.name.replace(*self.replace))


@dataclass(frozen=True)
class Case:
    """A checked case.

    Parameters
    ----------
    title : str
        What it is about.
    axis : Axis
        Whether it slides or turns.
    library : tuple of Term
        Terms that may be named.
    fit, withheld : tuple of Path
        Recordings; the others take part in no fit, and in no choice but to drop refinements that hurt them.
    zero : tuple of Path
        Recordings at rest with the drive off, whose mean is taken for the zero.
    channels : mapping of str to (Channel, float)
        ``time``; ``position``, ``velocity`` or both; ``force``, which may be missing; of a second shaft the same
        with `OUTPUT` before them; ``temperature``. What one unit of each is in SI.
    form : CsvForm
        How they are written, if they are CSV.
    prepare : PrepareTable
        How they are filtered and thinned.
    baseline : tuple of str
        Terms that are taken for granted, their amplitudes free.
    fixed : mapping of str to float
        Amplitudes of baseline terms that are known [SI].
    known : tuple of SetTerm
        Further terms that are known.
    published : tuple of TermParameter
        Parameters to compare with.
    published_errors : mapping of str to float
        Relative force errors [1] on the recordings ``fit`` and ``withheld``.
    ratio : float, optional
        Speed of the first shaft over that of the second, of a machine with two torques.
    withheld_part : float, optional
        Part at the end of each recording that is withheld, where no whole ones are.
    own_zeros : bool
        Whether each recording has a zero of its own.
    shaft : str
        Name of the shaft that the balance is of; empty where there is no machine file.
    second : SecondFile, optional
        Where the channels of the second shaft lie, if not in the same file.
    gains : tuple of SetTerm
        Known gains of transducers: their channels are divided by them.
    tares, tare_errors : mapping of str to float
        Of channels that have one, what they show at rest with the drive off [SI]: it is taken out of them.
    tolerances : mapping of str to float
        Of gains of transducers, the half-width that is stated of their sensitivity.
    nominal : mapping of str to float
        Of channels of transducers, their nominal value [N, N m].
    findings : tuple of Finding
        What was lost, or found, in reading `zero`.
    """

    title: str
    axis: Axis
    library: tuple[Term[Motion], ...]
    fit: tuple[Path, ...]
    withheld: tuple[Path, ...]
    channels: Mapping[str, tuple[Channel, float]]
    form: CsvForm
    prepare: PrepareTable
    baseline: tuple[str, ...]
    fixed: Mapping[str, float]
    known: tuple[SetTerm, ...] = ()
    published: tuple[TermParameter, ...] = ()
    published_errors: Mapping[str, float] = field(default_factory=dict)
    ratio: float | None = None
    withheld_part: float | None = None
    own_zeros: bool = False
    shaft: str = ""
    second: SecondFile | None = None
    zero: tuple[Path, ...] = ()
    gains: tuple[SetTerm, ...] = ()
    tares: Mapping[str, float] = field(default_factory=dict)
    tare_errors: Mapping[str, float] = field(default_factory=dict)
    tolerances: Mapping[str, float] = field(default_factory=dict)
    nominal: Mapping[str, float] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    @property
    def free_terms(self) -> tuple[Term[Motion], ...]:
        """Terms of the baseline whose amplitudes are free."""
        return tuple(t for name in self.baseline for t in self.library if t.key == name and name not in self.fixed)

    @property
    def stated(self) -> tuple[SetTerm, ...]:
        """All that is known beside the baseline, gains of transducers too."""
        return (*self.known, *self.gains)

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file of it."""
        first = (*self.fit, *self.withheld, *self.zero)
        return first if self.second is None else (*first, *(self.second.of(path) for path in first))

    def label(self, path: Path) -> str:
        """Name of one of its files; with its folder where others are called alike."""
        alike = [other for other in self.files if other.name == path.name]
        return path.name if len(alike) == 1 else f"{path.parent.name}/{path.name}"


def check_model(
    library: tuple[Term[Motion], ...],
    baseline: Sequence[str],
    fixed: Mapping[str, float],
    table: tuple[str, ...],
    word: str,
) -> None:
    """Refuse a baseline that a library cannot give; `table` leads to it, `word` is the key of its terms.

    Raises
    ------
    RefusalError
        A term is unknown or has a shape, an amplitude is out of its range, or none is free.
    """
    terms = {term.key: term for term in library}
    plain = [name for name, term in terms.items() if not term.of_model and term.shape is None and term.single]
    for i, name in enumerate(baseline):
        word_of(name, plain, *table, word, i)
    for name, value in fixed.items():
        if name not in baseline:
            refuse("not in the baseline", f"a term of {word}", near_miss(name, baseline), *table, "fixed", name)
        with refusing(*table, "fixed", name):
            number_within(value, *terms[name].amplitudes[0].bounds)
    if len(fixed) == len(baseline):
        refuse("every term is fixed", "at least one free term", "Leave one out.", *table, "fixed")
