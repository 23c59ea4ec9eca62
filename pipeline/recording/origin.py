"""Origin of an imported recording, as the import wrote it down."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.recording.findings import Code, Finding

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.recording.findings import Findings

RECORD = "pmg.import"
"""Metadata record in which an import names its source."""


@dataclass(frozen=True)
class ImportRecord:
    """Source of an imported recording: name, SHA-256, bytes, format, reader, and the number of findings."""

    source: str = ""
    sha256: str = ""
    size: str = ""
    format: str = ""
    reader: str = ""
    findings: int = 0


@dataclass(frozen=True)
class Origin:
    """The file that a recording was made of.

    Parameters
    ----------
    source, sha256, size, format, reader : str
        Name, hash, length [bytes], format, and the library that read it.
    findings : tuple of Finding
        What reading it brought up.
    """

    source: str
    sha256: str
    size: str
    format: str
    reader: str
    findings: tuple[Finding, ...] = ()

    @property
    def record(self) -> ImportRecord:
        """The same for a manifest; the findings stand among those of the recording."""
        return ImportRecord(self.source, self.sha256, self.size, self.format, self.reader, len(self.findings))


def read_origin(metadata: Sequence[tuple[str, Mapping[str, str]]], findings: Findings) -> Origin | None:
    """Origin of a recording; None for one that was recorded as it is.

    Parameters
    ----------
    metadata : sequence of (name, mapping)
        Metadata records of the file.
    findings : Findings
        Receives what of the record cannot be read.
    """
    said = next((dict(texts) for name, texts in metadata if name == RECORD), None)
    if said is None:
        return None
    try:
        plain = json.loads(said.get("findings", "[]"))
        imported = tuple(Finding.from_dict(each) for each in plain)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        imported = ()
        findings.warning(
            Code.RUN_VALUE,
            f"{RECORD}.findings",
            "it is no list of findings; expected what the import found, in JSON",
            "Import the source again.",
            lost="the findings of the import",
        )
    source, sha256, size, kind, reader = (
        said.get(key, "") for key in ("source", "source_sha256", "source_bytes", "source_format", "source_reader")
    )
    return Origin(source, sha256, size, kind, reader, imported)
