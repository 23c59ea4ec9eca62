"""Gaps of a campaign: holes in its grids, files that are not usable, windows that were rejected."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.levels import speed_levels
from pmg.pipeline.grid.missing_points import lost_data, unreached_findings
from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.windows.reduce import REDUCTION
from pmg.pipeline.wording.plurals import counted, listed
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array, Mask

MAIN_LEVEL = 0.5
"""A level belongs to the main grid when it holds at least this part of the cells of the fullest level."""


def holes(grid: Grid) -> tuple[str, ...]:
    """Cells of the main neutral and engaged grids without an accepted point, as words.

    The main grid is spanned by the forward set-points that most levels share; reversed flow, reversed rotation and
    repeats do not span it, and the neutral cell with both shafts at rest is not expected.
    """
    sun, ring, load, neutral, engaged = _layout(grid)
    lacking = [_neutral(a, b) for a, b in _lacking(sun, ring, neutral, neutral & grid.accepted) if a or b]
    lacking += [_engaged(a, b) for a, b in _lacking(sun, load, engaged, engaged & grid.accepted)]
    return tuple(lacking)


def _layout(grid: Grid) -> tuple[Array, Array, Array, Mask, Mask]:
    """Levels of speed [rpm] and load [N m] of the points, and which of them may belong to the main grids."""
    at = grid.points
    sun, ring = speed_levels(at)
    neutral = at.neutral & (sun >= 0) & (ring >= 0)
    return sun, ring, np.round(at.load_set, 3), neutral, at.engaged & (at.drive == "sun") & (sun > 0)


def _neutral(sun: float, ring: float) -> str:
    return f"neutral, sun {sun + 0.0:.0f} rpm, ring {ring + 0.0:.0f} rpm"


def _engaged(sun: float, load: float) -> str:
    return f"engaged, sun {sun + 0.0:.0f} rpm, load {load + 0.0:g} N m"


def _rejected_at(grid: Grid) -> dict[str, list[str]]:
    """Names of the rejected windows of each cell."""
    sun, ring, load, neutral, engaged = _layout(grid)
    found: dict[str, list[str]] = {}
    for row in np.flatnonzero(~grid.accepted & (neutral | engaged)):
        cell = _neutral(sun[row], ring[row]) if neutral[row] else _engaged(sun[row], load[row])
        found.setdefault(cell, []).append(str(grid.points.name[row]))
    return found


def _lacking(x: Array, y: Array, tried: Mask, accepted: Mask) -> list[tuple[float, float]]:
    """Cells of the product of the main levels that hold no accepted point."""
    cells = set(zip(_levelled(x[tried]), _levelled(y[tried]), strict=True))
    if not cells:
        return []
    present = set(zip(_levelled(x[accepted]), _levelled(y[accepted]), strict=True))
    return [(a, b) for a in _main([a for a, _ in cells]) for b in _main([b for _, b in cells]) if (a, b) not in present]


def _levelled(values: Array) -> list[float]:
    return [float(v) + 0.0 for v in values]


def _main(values: list[float]) -> list[float]:
    levels, counts = np.unique(values, return_counts=True)
    return [float(level) for level, count in zip(levels, counts, strict=True) if count >= MAIN_LEVEL * counts.max()]


def lack_findings(
    grid: Grid, lacking: Sequence[str], failed: Sequence[Manifest] = (), used: Sequence[Manifest] = ()
) -> tuple[Remark, ...]:
    """Gaps as remarks: holes, with what may have filled them, files, windows.

    Parameters
    ----------
    grid : Grid
        All points of the campaign.
    lacking : sequence of str
        Its holes, as `holes` names them.
    failed : sequence of Manifest
        Sources of the store that are not usable; of most of them no campaign is known.
    used : sequence of Manifest
        Sources of the campaign itself.

    Notes
    -----
    A hole is reported with the rejected windows at its speeds and load. Where there are none, with the files that are
    not usable, and with those that are and lost data.
    """
    files = [manifest.file for manifest in failed]
    short = [manifest.file for manifest in used if lost_data(manifest)]
    rejected = _rejected_at(grid) if lacking else {}
    found = []
    for cell in lacking:
        named = [file for file in files if _may_be(file, cell)]
        asked = [file for manifest, file in zip(failed, files, strict=True) if _asked_cell(manifest, grid) == cell]
        if asked:
            words = f"; {listed(asked)} was run there and is not usable"
        elif cell in rejected:
            words = f"; rejected there: {listed([f'window {name}' for name in rejected[cell]])}"
        elif named:
            words = f"; {listed(named)} is not usable and may be of it by its name"
        else:
            words = f"; it may be in what is not usable: {listed(files)}" if files else ""
            words += f"; it may be in what was lost of {listed(short)}" if short else ""
        found.append(Remark("warning", "grid", f"no accepted point at {cell}{words}"))
    for manifest, file in zip(failed, files, strict=True):
        why = next((f for f in manifest.findings if f.severity is Severity.ERROR), None)
        words = "" if why is None else f": {why.where}: {why.message}. {why.do}"
        cell = _asked_cell(manifest, grid)
        run = f" at {cell}" if cell else ""
        severity = "error" if why is not None and why.code is Code.STORE_CHANGED else "warning"
        found.append(Remark(severity, file, f"not usable, so not in the grid{run}{words}"))
    found += unreached_findings(used)
    for row in np.flatnonzero(~grid.accepted | (grid.reason != "")):
        where = f"window {grid.points.name[row]}"
        if grid.accepted[row]:
            found.append(Remark("info", where, f"accepted; {grid.reason[row]}"))
        else:
            found.append(Remark("warning", where, f"rejected: {grid.reason[row]}"))
    return tuple(found)


def stored_earlier(used: Sequence[Manifest]) -> tuple[Remark, ...]:
    """Sources stored in an earlier way than today: other means, or without a hash of what was written."""
    again = "Run 'pmg ingest' on the recordings again."
    found = []
    if files := [m.file for m in used if m.ingested and m.reduction != REDUCTION]:
        message = f"{counted(len(files), 'recording')} reduced in an earlier way: {listed(files)}"
        found.append(Remark("warning", "windows", f"{message}; expected today's means and temperatures. {again}"))
    if files := [m.file for m in used if m.ingested and not m.proven]:
        message = f"what the store holds of {counted(len(files), 'recording')} is unproven: {listed(files)}"
        found.append(Remark("warning", "store", f"{message}; expected the hash of each file that was written. {again}"))
    return tuple(found)


def _asked_cell(manifest: Manifest, grid: Grid) -> str:
    """The cell of a campaign at which a file that is not usable was run; empty where too little is known of its run."""
    run = manifest.run
    if run.campaign != grid.campaign:
        return ""
    sun, ring, load = run.setpoints.speed_sun, run.setpoints.speed_ring, run.setpoints.torque_ring
    if run.configuration == "neutral" and sun is not None and ring is not None:
        return _neutral(round(float(SPEED_SUN.display(sun))), round(float(SPEED_RING.display(ring))))
    if run.configuration == "engaged" and sun is not None and load is not None:
        return _engaged(round(float(SPEED_SUN.display(sun))), round(load, 3))
    return ""


def _may_be(file: str, cell: str) -> bool:
    """Whether the numbers in the name of a file hold those of a cell, in the same order."""
    in_file = [abs(float(number)) for number in re.findall(r"\d+(?:\.\d+)?", file.rpartition(".")[0] or file)]
    wanted = [abs(float(number)) for number in re.findall(r"\d+(?:\.\d+)?", cell)]
    return any(in_file[i : i + len(wanted)] == wanted for i in range(len(in_file)))
