"""An analysed campaign with the recordings behind it: what a comparison and its report are made of."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.budget import budget_of
from pmg.pipeline.grid.campaign import failed_sources
from pmg.pipeline.grid.crosschecks.checked import checked_campaign
from pmg.pipeline.grid.transducer_remarks import transducer_remarks
from pmg.pipeline.grid.window_facts import marked_as_simulated, rated, window_facts
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.settings.bench_in_force import bench_of_store, machine_remarks, machine_title
from pmg.pipeline.store.store import Store

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.budget import Budget
    from pmg.pipeline.fit.options import AnalysisOptions
    from pmg.pipeline.grid.window_facts import WindowFacts
    from pmg.pipeline.point_signals.encoded import Encoded
    from pmg.pipeline.report.document import Section
    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid


@dataclass(frozen=True)
class SourceFacts:
    """Known facts of the sources of a grid.

    Parameters
    ----------
    remarks : tuple of Remark
        Findings of the recordings and of their transducers.
    inputs : tuple of (label, value)
        What the report says of its inputs: their number, first start, hash.
    facts : WindowFacts or None
        Of the windows, where each point has one.
    failed, used : tuple of Manifest
        Sources of the store that are not usable, and those of the campaign.
    """

    remarks: tuple[Remark, ...]
    inputs: tuple[tuple[str, str], ...]
    facts: WindowFacts | None
    failed: tuple[Manifest, ...]
    used: tuple[Manifest, ...]


@dataclass(frozen=True)
class StoredAnalysis:
    """An analysed campaign and the store of its recordings.

    Parameters
    ----------
    store : Path
        Holds the samples behind the points.
    options : AnalysisOptions
        Choices of the analysis.
    bench : BenchParameters
        With the nominal torques that the recordings state.
    analysis : Analysis
        Fits, calibration, balance.
    sources : SourceFacts
        What is known of the recordings.
    """

    store: Path
    options: AnalysisOptions
    bench: BenchParameters
    analysis: Analysis
    sources: SourceFacts

    @cached_property
    def budget(self) -> Budget:
        """What the uncertainty of its points is made of."""
        return budget_of(self.analysis.grid, self.analysis.floor, self.bench, self.sources.facts)

    @property
    def beside_motion(self) -> bool:
        """Whether the campaign holds runs in motion, too."""
        return any(record.sound for manifest in self.sources.used for record in manifest.moving)


def analysed(store: Path, grid: Grid, options: AnalysisOptions, remarks: tuple[Remark, ...] = ()) -> StoredAnalysis:
    """A grid analysed on the bench that its recordings state.

    Parameters
    ----------
    store : Path
        Holds the recordings of the grid, if it is of recordings.
    grid : Grid
        Of one campaign.
    options : AnalysisOptions
        Choices.
    remarks : tuple of Remark
        On the analysis that the grid is from; they stand before those on its recordings.
    """
    bench = bench_of_store(store)
    sources = _read_sources(store, grid, bench, options.checks)
    sources = replace(sources, remarks=remarks + sources.remarks + machine_remarks(store))
    bench = rated(bench, sources.facts)
    return StoredAnalysis(store, options, bench, analyse(grid, options, bench), sources)


def _read_sources(
    store: Path, grid: Grid, bench: BenchParameters, actions: Mapping[str, str] | None = None
) -> SourceFacts:
    """Known facts of the sources of a grid: recordings of a store, or published tables."""
    if grid.origin == "published":
        return SourceFacts((), (("Input", "published grids, torques rounded to 0.01 N m"),), None, (), ())
    _, checked = checked_campaign(Store(store), grid.campaign, bench, actions)
    manifests = checked.manifests
    failed = failed_sources(store)
    recorded = (finding for manifest in (*manifests, *failed) for finding in manifest.findings)
    remarks: tuple[Remark, ...] = (*checked.findings, *recorded)
    joined = "".join(sorted(manifest.sha256 for manifest in manifests))
    digest = hashlib.sha256(joined.encode()).hexdigest()
    first = min(manifest.started_at for manifest in manifests)
    simulated = any(map(marked_as_simulated, manifests))
    machine = machine_title(store)
    inputs = [
        *(() if machine is None else (("Machine", machine),)),
        ("Input", f"{len(manifests)} recordings" + (", marked as simulated by their writer" if simulated else "")),
        ("First recording started", first),
        ("SHA-256 over the sorted SHA-256 of the recordings", digest),
    ]
    facts = window_facts(manifests)
    remarks += tuple(transducer_remarks(facts, bench))
    known = facts if len(facts.sun.dof) == len(grid) else None
    return SourceFacts(remarks, tuple(inputs), known, failed, manifests)


@dataclass(frozen=True)
class RecordedPart:
    """The part of a page that only recordings give: the order chapter, the signals of each point, and remarks."""

    orders: Section | None
    signals: Encoded
    findings: tuple[Remark, ...]


def recorded_part(whole: StoredAnalysis) -> RecordedPart | None:
    """Chapter, signals and remarks of a recorded campaign; their rooms are loaded for no other, which has None."""
    if whole.analysis.grid.origin == "published":
        return None
    from pmg.pipeline.commands.orders import orders_chapter
    from pmg.pipeline.point_signals.campaign import campaign_signals
    from pmg.pipeline.point_signals.encoded import encode

    store, grid = Store(whole.store), whole.analysis.grid
    behind = campaign_signals(store, grid, whole.budget)
    orders, left_out = orders_chapter(store, whole.sources.used, whole.bench)
    return RecordedPart(orders, encode(behind.cells), behind.findings + left_out)
