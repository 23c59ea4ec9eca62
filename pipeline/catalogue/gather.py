"""All that a store knows of its runs, gathered for the catalogue; what cannot be read is reported and left out."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.catalogue.entries import (
    Cell,
    Entry,
    grid_entry,
    grid_uncertainty,
    recording_entry,
    rejected_as_copies,
)
from pmg.pipeline.files.atomic import PREFIX
from pmg.pipeline.grid.copies import without_copies
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.store.store import SOURCES
from pmg.sim.errors import PmgError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.store.manifest import Manifest
    from pmg.pipeline.store.store import Store
    from pmg.sim.grid import Grid

Key = tuple[Cell, Cell, Cell]


@dataclass(frozen=True)
class Gathered:
    """Recordings with their windows, and what was left out, as findings of a stage."""

    recordings: tuple[Entry, ...]
    remarks: tuple[Remark, ...]


def gather(store: Store) -> Gathered:
    """Every recording of a store, with the uncertainties of its analysis where there is one."""
    manifests, remarks = _read(store)
    entries = list[Entry]()
    by_campaign: dict[Cell, list[tuple[Manifest, Entry]]] = defaultdict(list)
    for manifest, entry in manifests:
        if manifest.ingested:
            by_campaign[entry.fields["campaign"]].append((manifest, entry))
        else:
            entries.append(entry)
    for pairs in by_campaign.values():
        entries += rejected_as_copies([entry for _, entry in pairs], without_copies([m for m, _ in pairs]))
    entries.sort(key=lambda entry: str(entry.fields["name"]))
    grid, lacking = _analysed(store)
    if grid is not None and grid.origin == "published":
        entries.append(grid_entry(grid))
    elif grid is not None:
        entries, lacking = _with_grid(entries, grid)
    return Gathered(tuple(entries), (*remarks, *lacking))


def _read(store: Store) -> tuple[list[tuple[Manifest, Entry]], list[Remark]]:
    found, remarks = [], []
    for path in sorted((store.path / SOURCES).glob("*.json")):
        if path.name.startswith(PREFIX):
            continue
        try:
            manifest = store.read_manifest(path.stem)
            found.append((manifest, recording_entry(manifest)))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            if path.exists():
                came = f"lacks {error}" if isinstance(error, KeyError) else str(error)
                remarks.append(
                    Remark(
                        "error",
                        f"{SOURCES}/{path.name}",
                        f"unreadable ({came}) and left out. Ingest its source again.",
                    )
                )
    return found, remarks


def _analysed(store: Store) -> tuple[Grid | None, list[Remark]]:
    from pmg.pipeline.analysis.outputs import (  # it brings scipy; most calls need no analysis
        FOLDER,
        SUMMARY,
        read_analysis,
        unproven_analysis,
    )

    if not (store.path / FOLDER / SUMMARY).is_file():
        return None, []
    try:
        return read_analysis(store.path)[0], list(unproven_analysis(store.path))
    except PmgError as error:
        return None, [Remark("warning", FOLDER, f"{error.came}; left out. {error.do}")]


def _with_grid(entries: Sequence[Entry], grid: Grid) -> tuple[list[Entry], list[Remark]]:
    """The entries with the uncertainties of a grid; windows and points belong together by name and start."""
    at = grid.points
    rows: dict[Key, list[int]] = defaultdict(list)
    for row in range(len(grid)):
        rows[grid.campaign, str(at.name[row]), float(at.started_at[row])].append(row)
    found = []
    for entry in entries:
        windows = tuple(_analysed_window(entry.fields["campaign"], part, rows, grid) for part in entry.parts)
        found.append(Entry(entry.fields, windows))
    without = sum(
        part.fields.get("analysed", 1) == 0  # what no grid can hold has no such field
        for entry in found
        for part in entry.parts
        if entry.fields["campaign"] == grid.campaign
    )
    left = sum(map(len, rows.values()))
    if not without and not left:
        return found, []
    message = f"the analysis is of other recordings: it lacks {without} windows and has {left} others. Run it again."
    return found, [Remark("warning", f"campaign {grid.campaign}", message)]


def _analysed_window(campaign: Cell, part: Entry, rows: dict[Key, list[int]], grid: Grid) -> Entry:
    """A window with the row of the grid that is its own taken out of ``rows``; copies have rows alike."""
    rows_left = rows.get((campaign, part.fields["name"], part.fields["begin_s"]), [])
    own = next((row for row in rows_left if bool(grid.accepted[row]) == bool(part.fields["accepted"])), None)
    row = own if own is not None else (rows_left[0] if rows_left else None)
    if row is None:
        return part
    rows_left.remove(row)
    parts = tuple(
        Entry(quantity.fields | grid_uncertainty(grid, str(quantity.fields["name"]).removeprefix("torque_"), row))
        if str(quantity.fields["name"]).startswith("torque_")
        else quantity
        for quantity in part.parts
    )
    taken: dict[str, Cell] = {"analysed": 1, "accepted": int(grid.accepted[row]), "reasons": str(grid.reason[row])}
    return Entry(part.fields | taken, parts)
