"""A window: samples that were meant as one test point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.recording.run_records import WindowRecord

if TYPE_CHECKING:
    from datetime import datetime


@dataclass(frozen=True)
class Window(WindowRecord):
    """A stretch of samples that was meant as one test point.

    Parameters
    ----------
    started_at : datetime
        Time of the first sample [UTC].
    """

    started_at: datetime
