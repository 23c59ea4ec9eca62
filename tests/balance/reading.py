"""One recording read by a case, whatever it withholds."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.balance.records.reading import read_recordings

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded


def read_one(path: Path, case: Case) -> Recorded:
    return read_recordings(replace(case, fit=(path,), withheld=()))[0]
