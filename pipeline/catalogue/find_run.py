"""One recording, or one of its windows, found in the store by whatever name the user gives it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from pmg.pipeline.catalogue.columns import BY_NAME, COLUMNS
from pmg.pipeline.catalogue.query import QueryError
from pmg.sim.errors import StoreError, closest, near_miss

if TYPE_CHECKING:
    from pmg.pipeline.catalogue.entries import Cell
    from pmg.pipeline.catalogue.index import Catalogue
    from pmg.pipeline.store.manifest import Manifest
    from pmg.pipeline.store.store import Store

LISTED = 6
"""Candidates that are named."""


@dataclass(frozen=True)
class FoundRun:
    """Run or window that a name stands for.

    Parameters
    ----------
    manifest : Manifest or None
        Of the recording; None for a grid that was read from tables.
    rows : tuple of dict
        Its windows as the catalogue has them, by column; of a test point that one only.
    """

    manifest: Manifest | None
    rows: tuple[dict[str, Cell], ...]

    @property
    def document(self) -> dict[str, Any]:
        """The manifest as JSON; empty where there is none."""
        return {} if self.manifest is None else self.manifest.document()

    @property
    def name(self) -> str:
        """Title in a listing."""
        first = self.rows[0]
        recording = str(first["file"] or first["campaign"])
        return f"{recording}: {first['point']}" if len(self.rows) == 1 and first["point"] else recording


def find_run(store: Store, catalogue: Catalogue, name: str) -> FoundRun:
    """The recording or test point of that name.

    Parameters
    ----------
    store : Store
        Holds the manifests.
    catalogue : Catalogue
        Of the same store.
    name : str
        Name in the store, file with or without its ending, start of the hash (six digits or more), or test point.

    Raises
    ------
    QueryError
        There is none, or several.
    StoreError
        It went away meanwhile.
    """
    rows = [dict(zip(BY_NAME, row, strict=True)) for row in catalogue.rows(COLUMNS)]
    ways = (
        lambda row: name in (row["name"], row["file"]),
        lambda row: name == PurePath(str(row["file"] or "")).stem,
        lambda row: len(name) >= 6 and str(row["sha256"] or "").startswith(name),
        lambda row: name == row["point"],
    )
    for way in ways:
        found = [row for row in rows if way(row)]
        if found:
            break
    else:
        known = {str(row[key]) for row in rows for key in ("name", "file", "point") if row[key]}
        few = len(known) <= LISTED
        hint = near_miss(name, known) if few else closest(name, known) or "'pmg runs list' names them."
        raise QueryError(str(store.path), f"no run {name!r}", "a recording or a test point", hint)
    recordings = sorted({str(row["name"]) for row in found})
    points = len(recordings) == 1 or way is not ways[-1]
    if len(recordings) > 1 or not points:
        more = f" and {len(recordings) - LISTED} more" if len(recordings) > LISTED else ""
        came = f"{name!r} is in {len(recordings)} recordings: {', '.join(recordings[:LISTED])}{more}"
        raise QueryError(str(store.path), came, "one", "Name the recording.")
    if found[0]["status"] == "table":
        return FoundRun(None, tuple(found))
    manifest = store.manifest(recordings[0])
    if manifest is None:
        raise StoreError(str(store.path), f"{recordings[0]} is unreadable", "its manifest", "Ingest its source again.")
    return FoundRun(manifest, tuple(found))
