"""Outcome of a command: its results, its remarks and how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pmg.pipeline.recording.remark import Remark
    from pmg.sim.errors import PmgError


@dataclass(frozen=True)
class Outcome:
    """Outcome of a command.

    Parameters
    ----------
    data : dict
        Results, as JSON.
    lines : tuple of str
        The same for people, a few lines.
    findings : tuple of Remark
        Remarks, among them the findings on recordings.
    partial : bool
        Something was left out that a new call, with better input, could add.
    mismatch : bool
        Simulation and recordings differ.
    failed : bool
        Nothing can be done with what was given; the remarks say why.
    refusal : PmgError, optional
        Why the command stopped after what it remarks on; then there are no results.
    """

    data: dict[str, Any]
    lines: tuple[str, ...]
    findings: tuple[Remark, ...] = ()
    partial: bool = False
    mismatch: bool = False
    failed: bool = False
    refusal: PmgError | None = None
