"""The stages of a campaign's way, one verb each: ingest, analyse, compare; what the command line calls."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.analyse import Analysis, analyse
from pmg.pipeline.campaign import read_campaign
from pmg.pipeline.chapters.page import build_report
from pmg.pipeline.compare import compare
from pmg.pipeline.diagnose.decide import Diagnosis, Verdict, diagnose, diagnosis_document
from pmg.pipeline.gridtable import read_published
from pmg.pipeline.ingest import ingest
from pmg.pipeline.options import AnalysisOptions
from pmg.pipeline.outputs import analysis_document, read_analysis, write_analysis
from pmg.pipeline.report.write import write_report
from pmg.pipeline.store import Store, write_aside
from pmg.sim.bench import load_bench
from pmg.sim.gearbox import Gearbox
from pmg.sim.solve import steady

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.sim.grid import Grid

SEED = 20260101
"""Seed of the synthetic campaigns behind a p-value; named in the report."""


@dataclass(frozen=True)
class Outcome:
    """What a stage did.

    Parameters
    ----------
    data : dict
        Results, as JSON.
    lines : tuple of str
        The same for people, a few lines.
    findings : tuple of dict
        Remarks: severity, where, message.
    partial : bool
        Something was left out that a new call, with better input, could add.
    mismatch : bool
        Simulation and recordings differ.
    """

    data: dict[str, Any]
    lines: tuple[str, ...]
    findings: tuple[dict[str, Any], ...] = ()
    partial: bool = False
    mismatch: bool = False
    parts: tuple[Outcome, ...] = field(default=(), repr=False)
