"""Findings: what a recording lacks, damages or contradicts, reported so that someone can act on it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.remark import Remark
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["LISTED", "LONGEST_TEXT", "Code", "Extent", "Finding", "Findings", "Severity", "UnusableRecordingError"]


@dataclass(frozen=True)
class Finding(Remark):
    """One thing found in one file.

    Parameters
    ----------
    severity : Severity
        ``error``: data are lost or cannot be trusted; ``warning``: usable, but someone should look; ``info``.
    where : str
        Topic, record, key or byte offset.
    message : str
        What came and what was expected.
    file : str
        Name of the file.
    code : Code
        What kind of thing.
    do : str
        What the user can do about it.
    byte_range, sample_range : (int, int), optional
        The stretch of the file [bytes], or of the samples, that it is about; its end left out.
    kept, lost : str
        What is used all the same, and what is not; empty where the message says all.
    """

    severity: Severity
    file: str = field()
    code: Code
    do: str
    byte_range: tuple[int, int] | None = None
    sample_range: tuple[int, int] | None = None
    kept: str = ""
    lost: str = ""

    def __str__(self) -> str:
        """One line for a log."""
        return f"{self.file}: {self.where}: {self.message}. {self.do}"

    def to_dict(self) -> dict[str, Any]:
        """Plain form for JSON; empty fields are left out."""
        plain = {"code": self.code.value, **super().to_dict(), "do": self.do}
        ranges = {"byte_range": self.byte_range, "sample_range": self.sample_range}
        plain |= {name: list(stretch) for name, stretch in ranges.items() if stretch is not None}
        return plain | {name: text for name, text in (("kept", self.kept), ("lost", self.lost)) if text}

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Finding:
        """The finding that `to_dict` wrote."""
        return cls(
            code=Code(plain["code"]),
            severity=Severity(plain["severity"]),
            file=plain["file"],
            where=plain["where"],
            message=plain["message"],
            do=plain["do"],
            byte_range=_stretch(plain.get("byte_range")),
            sample_range=_stretch(plain.get("sample_range")),
            kept=plain.get("kept", ""),
            lost=plain.get("lost", ""),
        )


def _stretch(ends: Sequence[int] | None) -> tuple[int, int] | None:
    return None if ends is None else (ends[0], ends[1])


class Extent(TypedDict, total=False):
    """Optional fields of a finding; see `Finding`."""

    byte_range: tuple[int, int]
    sample_range: tuple[int, int]
    kept: str
    lost: str


LISTED = 50
"""Findings of one code and severity that are listed one by one; the others of the file are counted."""

LONGEST_TEXT = 2000
"""Longest text of a finding [characters]; names and metadata in a damaged file can be as long as the file."""


@dataclass
class Rest:
    """Findings of one code and severity beyond those listed.

    Parameters
    ----------
    place : int
        Where among the gathered ones they belong.
    count : int
        How many.
    covered : int
        Bytes of the file in their ranges, each once for ranges in the order of the file [bytes].
    byte_range : (int, int), optional
        From the first of these bytes to the last; its end left out.
    sample_range : (int, int), optional
        From the first of the samples in their ranges to the last; its end left out.
    """

    place: int
    count: int = 0
    covered: int = 0
    byte_range: tuple[int, int] | None = None
    sample_range: tuple[int, int] | None = None

    def add(self, stretch: tuple[int, int] | None, samples: tuple[int, int] | None = None) -> None:
        """Count one more, with the bytes and the samples it is about."""
        self.count += 1
        if samples is not None:
            low, high = self.sample_range or samples
            self.sample_range = min(low, samples[0]), max(high, samples[1])
        if stretch is not None:
            first, last = self.byte_range or (stretch[0], stretch[0])
            self.covered += max(0, stretch[1] - max(stretch[0], last))
            self.byte_range = min(first, stretch[0]), max(last, stretch[1])


@dataclass
class Findings:
    """The findings of one file, gathered while it is read.

    Parameters
    ----------
    file : str
        Name of the file, written into each finding.
    gathered : list of Finding
        In the order in which they were met, at most `LISTED` of one code and severity.
    more : dict
        Those beyond, by code and severity.
    """

    file: str
    gathered: list[Finding] = field(default_factory=list)
    more: dict[tuple[Code, Severity], Rest] = field(default_factory=dict)
    _count: Counter[tuple[Code, Severity]] = field(default_factory=Counter)

    def error(self, code: Code, where: str, message: str, do: str, **extent: Unpack[Extent]) -> None:
        """Data are lost or cannot be trusted."""
        self._add(Severity.ERROR, code, where, message, do, **extent)

    def warning(self, code: Code, where: str, message: str, do: str, **extent: Unpack[Extent]) -> None:
        """Usable, but someone should look."""
        self._add(Severity.WARNING, code, where, message, do, **extent)

    def info(self, code: Code, where: str, message: str, do: str, **extent: Unpack[Extent]) -> None:
        """Worth knowing."""
        self._add(Severity.INFO, code, where, message, do, **extent)

    def give_up(self, run: Mapping[str, Any] | None = None) -> UnusableRecordingError:
        """The error that carries all findings so far, and what is known of the run; the last error heads it."""
        return UnusableRecordingError(self.listed(), run)

    def listed(self) -> tuple[Finding, ...]:
        """All findings in order; where there were too many of a kind, one that says how many more."""
        lines: list[Finding] = []
        rest = {more.place: _counted(self.file, *kind, more) for kind, more in self.more.items() if more.count}
        for place, finding in enumerate(self.gathered):
            lines.append(finding)
            if place in rest:
                lines.append(rest[place])
        return tuple(lines)

    def _add(self, severity: Severity, code: Code, where: str, message: str, do: str, **extent: Unpack[Extent]) -> None:
        kind = code, severity
        self._count[kind] += 1
        if self._count[kind] > LISTED:
            self.more[kind].add(extent.get("byte_range"), extent.get("sample_range"))
            return
        self.gathered.append(Finding(severity, _short(where), _short(message), self.file, code, do, **extent))
        if self._count[kind] == LISTED:
            self.more[kind] = Rest(len(self.gathered) - 1)


def _counted(file: str, code: Code, severity: Severity, more: Rest) -> Finding:
    """The finding that stands for those of its kind that are not listed."""
    count, stretch = f"{more.count} more findings {code}", more.byte_range
    over = "" if stretch is None else f" over {more.covered} bytes between {stretch[0]} and {stretch[1]}"
    return Finding(
        severity,
        "whole file",
        f"{count}{over}; expected at most {LISTED}, which are listed one by one",
        file,
        code,
        "Treat them as those listed. A file with so much damage is best copied again.",
        byte_range=stretch,
        sample_range=more.sample_range,
        lost=f"what {more.count} more findings name" if severity is Severity.ERROR else "",
    )


def _short(text: str) -> str:
    """A text with its middle left out where it is too long."""
    half = LONGEST_TEXT // 2
    return text if len(text) <= LONGEST_TEXT else f"{text[:half]} ... {text[-half:]}"


class UnusableRecordingError(RecordingError):
    """A recording from which no torque and speed can be had; it carries every finding.

    Parameters
    ----------
    findings : tuple of Finding
        At least one of them is an error.
    run : mapping, optional
        What is known of the run all the same.
    """

    def __init__(self, findings: tuple[Finding, ...], run: Mapping[str, Any] | None = None) -> None:
        """Head the error with the last finding that is one."""
        self.findings, self.run = findings, dict(run or {})
        head = [f for f in findings if f.severity is Severity.ERROR][-1]
        came, _, expected = head.message.partition("; expected ")
        super().__init__(f"{head.file}: {head.where}", came, expected or "a recording of layout pmg.v1", head.do)

    def __reduce__(self) -> tuple[type[UnusableRecordingError], tuple[tuple[Finding, ...], dict[str, Any]]]:
        """Pickle with the findings, so that it survives the way back from a worker."""
        return type(self), (self.findings, self.run)
