"""The signals behind every point of a measured grid, from the store, one recording at a time."""

from __future__ import annotations

import math
from collections import defaultdict, deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.point_signals.cell import BudgetRow, CellSignals, ChannelSignals, ShaftRows
from pmg.pipeline.point_signals.traces import bins_for, speed_signals, stretch_of, torque_signals
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.wording.plurals import counted, listed
from pmg.sim.errors import GridError, StoreError
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION, SPEEDS, TORQUES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pmg.pipeline.fit.budget import Budget
    from pmg.pipeline.grid.contributions import ShaftBudget
    from pmg.pipeline.grid.window_facts import ShaftFacts
    from pmg.pipeline.store.manifest import Manifest, StoredWindow
    from pmg.pipeline.store.store import Store
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

NO_NUMBER = "No number of the analysis is taken from them: means and their uncertainty come from its proven document"
"""Why a recording whose samples were changed in the store keeps its place in the grid."""
SAME_START = 3
"""Decimals of a second to which the start of a window is the same in grid and store."""


@dataclass(frozen=True)
class CampaignSignals:
    """The signals behind a grid.

    Parameters
    ----------
    cells : tuple of CellSignals
        One a row of the grid, in its order; none of a grid that comes from tables.
    findings : tuple of Remark
        What is lacking, in the plain form of a stage's findings.
    """

    cells: tuple[CellSignals, ...]
    findings: tuple[Remark, ...] = ()


@dataclass(frozen=True)
class _WindowPlace:
    """A window in the store."""

    manifest: Manifest
    window: StoredWindow


def campaign_signals(store: Store, grid: Grid, budget: Budget) -> CampaignSignals:
    """The signals behind every point of a grid.

    Parameters
    ----------
    store : Store
        Holds the recordings of the grid's campaign.
    grid : Grid
        Measured; one that is published or simulated has no signals.
    budget : Budget
        Of this very grid.

    Returns
    -------
    CampaignSignals
        A point whose samples cannot be had stands with its budget and says why; the finding names the points.

    Raises
    ------
    GridError
        The budget is of another grid.
    StoreError
        There is no store.
    """
    if not np.array_equal(budget.grid.points.name, grid.points.name):
        raise GridError(
            "budget", f"that of {len(budget.grid)} other points", f"the grid's {len(grid)}", "Reckon it anew."
        )
    if grid.origin != "measured":
        message = f"a {grid.origin} grid has no recordings; expected a store of them. Its points show no signals."
        return CampaignSignals((), (Remark("info", "signals of the points", message),))
    rows = [_rows_of(shaft) for shaft in budget]
    cells = [_without_signals(grid, budget, row, tuple(shaft(row) for shaft in rows)) for row in range(len(grid))]
    places = _places(store, grid)
    runs: dict[str, list[int]] = defaultdict(list)
    for row, place in places.items():
        runs[place.manifest.identifier].append(row)
    for row in set(range(len(grid))) - set(places):
        cells[row] = replace(cells[row], lacking="no samples of this window are in the store; ingest its recording")
    for of_run in runs.values():
        manifest = places[of_run[0]].manifest
        try:
            run = _run(store, manifest)
        except StoreError as error:
            lacking = f"samples {error.came}. {NO_NUMBER}; ingest {manifest.file} again"
            for row in of_run:
                cells[row] = replace(cells[row], file=manifest.file, lacking=lacking)
            continue
        for row in of_run:
            cells[row] = _with_signals(cells[row], places[row], run, bins_for(len(grid)))
    return CampaignSignals(tuple(cells), _findings(cells))


def _run(store: Store, manifest: Manifest) -> dict[str, Array]:
    """The columns of a run that are shown, and the numbers of its samples."""
    samples = store.samples(manifest)
    needed = ("sample", *(signal.name for signal in TORQUES), *(f"angle_{side}" for side in SIDES))
    lacking = [name for name in needed if name not in samples.columns]
    if lacking:
        raise StoreError(
            f"run {manifest.identifier}", f"without {', '.join(lacking)}", "decoded samples", "Ingest its source again."
        )
    return {name: samples[name].to_numpy() for name in needed}


def _places(store: Store, grid: Grid) -> dict[int, _WindowPlace]:
    """Where the window of each row of a grid stands; rows without one are left out.

    Rows and windows meet by start and name of the point; copies of a window, which share both, by their order.
    """
    found: dict[tuple[float, str], deque[_WindowPlace]] = defaultdict(deque)
    for manifest in store.manifests(whole=False):
        if manifest.ingested and manifest.campaign == grid.campaign:
            for window in manifest.windows:
                key = round(window.started_at_s, SAME_START), window.point
                found[key].append(_WindowPlace(manifest, window))
    places = {}
    for row, (started, name) in enumerate(zip(grid.points.started_at, grid.points.name, strict=True)):
        waiting = found.get((round(float(started), SAME_START), str(name)))
        if waiting:
            places[row] = waiting.popleft()
    return places


def _without_signals(grid: Grid, budget: Budget, row: int, shafts: tuple[ShaftRows, ...]) -> CellSignals:
    """Facts of a point from grid and budget."""
    at, reason = grid.points, str(grid.reason[row])
    flags: list[str] = []
    if budget.facts is not None:
        for side, facts in budget.facts.items():
            flags += _flags(side, facts, row)
    speeds = float(at.speed_sun[row]), float(at.speed_ring[row])
    return CellSignals(
        row=row,
        point=str(at.name[row]),
        accepted=bool(grid.accepted[row]),
        reasons=tuple(reason.split("; ")) if reason else (),
        flags=tuple(flags),
        turns=(abs(speeds[0]) / REVOLUTION, abs(speeds[1]) / REVOLUTION),
        shafts=shafts,
    )


def _flags(side: str, facts: ShaftFacts, row: int) -> list[str]:
    flags = []
    if facts.correlated[row]:
        flags.append(f"{side}: the torque noise is slow for the window")
    if facts.remembered[row]:
        flags.append(f"{side}: the uncertainty rests on what slow noise may be, not on batches")
    return flags


def _rows_of(shaft: ShaftBudget) -> Callable[[int], ShaftRows]:
    """The rows of a shaft's budget at a point; what is reckoned over all points is reckoned once."""
    contributions = [(c, c.u) for c in shaft.contributions]
    sums = shaft.torque, shaft.independent, shaft.common, shaft.u, shaft.dof, shaft.factor, shaft.expanded

    def at(row: int) -> ShaftRows:
        torque, independent, common, u, dof, factor, expanded = (float(column[row]) for column in sums)
        return ShaftRows(
            side=shaft.side,
            torque=torque,
            rows=tuple(
                BudgetRow(c.key, c.name, c.kind, c.distribution, c.common, float(us[row]), float(c.dof[row]), c.remark)
                for c, us in contributions
            ),
            independent=independent,
            common=common,
            u=u,
            dof=dof,
            factor=factor,
            expanded=expanded,
        )

    return at


def _with_signals(cell: CellSignals, place: _WindowPlace, run: Mapping[str, Array], most: int) -> CellSignals:
    """A point with the signals of its window; without, and why, where the run holds none of its samples.

    There are at most `most` bins of each.
    """
    manifest, window = place.manifest, place.window
    rate, rows = manifest.rate_hz, len(run["sample"])
    known = replace(
        cell,
        file=manifest.file,
        rate=rate,
        first_sample=window.first_sample,
        stop_sample=window.stop_sample,
    )
    offset = int(run["sample"][0]) if rows else 0
    stretch = stretch_of(known.first_sample - offset, known.stop_sample - offset, rows, rate, most=most)
    if stretch.first == stretch.stop:
        return replace(known, lacking="the recording holds no samples of this window")
    channels: list[ChannelSignals] = []
    for signal, shaft in zip(TORQUES, cell.shafts, strict=True):
        made = torque_signals(signal, run[signal.name], stretch, window.means[shaft.side].resolution)
        channels.append(replace(made, mean=shaft.torque, u=shaft.u, expanded=shaft.expanded))
    for side, signal in SPEEDS.items():
        counts = manifest.calibration.counts_per_rev[side]
        count = REVOLUTION / counts if counts else math.nan
        channels.append(speed_signals(signal, run[f"angle_{side}"], stretch, count))
    return replace(known, channels=tuple(channels))


def _findings(cells: list[CellSignals]) -> tuple[Remark, ...]:
    """One finding for each way in which signals are lacking."""
    lacking: dict[str, list[str]] = defaultdict(list)
    for cell in cells:
        if cell.lacking:
            lacking[cell.lacking].append(cell.point)
    return tuple(
        Remark(
            "warning",
            "signals of the points",
            f"{counted(len(points), 'point')} without signals: {listed(points)}; {why}",
        )
        for why, points in lacking.items()
    )
