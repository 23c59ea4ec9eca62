"""The lines of each point, kept in the store next to the samples they are from."""

from __future__ import annotations

import io
import json
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

import polars as pl

from pmg.pipeline.files.json_values import read_json, with_nulls
from pmg.pipeline.orders.angle import index_of
from pmg.pipeline.orders.point import Span, orders_of_point
from pmg.pipeline.orders.row import OrderRow
from pmg.pipeline.recording.findings import Finding
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.store.store import ORDERS
from pmg.sim.errors import StoreError
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from pmg.pipeline.orders.angle import Index
    from pmg.pipeline.orders.point import PointOrders
    from pmg.pipeline.recording.read import Recording
    from pmg.pipeline.store.manifest import Manifest
    from pmg.pipeline.store.store import Store
    from pmg.pipeline.windows.window import Window
    from pmg.sim.bench import BenchParameters

SCHEMA = "pmg.orders/1"
KEYS = {"point": pl.String, "configuration": pl.String, "gear": pl.Int64, "first_sample": pl.Int64}
"""Columns that say which window a line belongs to."""
TYPES: dict[str, Any] = {"str": pl.String, "int": pl.Int64, "float": pl.Float64, "bool": pl.Boolean}
COLUMNS: dict[str, Any] = KEYS | {f.name: TYPES[str(f.type)] for f in fields(OrderRow)}


@dataclass(frozen=True)
class SourceOrders:
    """The lines of one source.

    Parameters
    ----------
    table : polars.DataFrame
        One row a window, signal and line: `KEYS` and the fields of `OrderRow`, SI, null where there is no number.
    document : dict
        Places of the index pulses, load angle of each window, and findings in plain form.
    """

    table: pl.DataFrame
    document: dict[str, Any]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings on coils and index pulses."""
        return tuple(Finding.from_dict(plain) for plain in self.document["findings"])


def _orders_of_source(recording: Recording, windows: Iterable[Window], bench: BenchParameters) -> SourceOrders:
    """The lines of every accepted window of a recording.

    Parameters
    ----------
    recording : Recording
        As it was read, with its coils and index pulses.
    windows : iterable of Window
        Its windows, judged.
    bench : BenchParameters
        Its machine.
    """
    steps = {side: REVOLUTION / recording.calibration.counts_per_rev[side] for side in SIDES}
    index = {side: index_of(recording, side) for side in SIDES}
    points = [
        orders_of_point(
            recording.samples,
            Span(w.point, str(w.configuration), w.gear, w.first_sample, w.stop_sample),
            recording.rate_hz,
            bench,
            steps=steps,
            index=index,
            coils=recording.auxiliary.coils,
        )
        for w in windows
        if w.accepted
    ]
    return _source(points, index, [finding.to_dict() for finding in recording.auxiliary.findings])


def orders_of_manifest(store: Store, manifest: Manifest, bench: BenchParameters) -> SourceOrders:
    """The lines of a source of which only decoded samples are there: no coils, no index pulses."""
    samples = store.samples(manifest)
    steps = {side: REVOLUTION / manifest.calibration.counts_per_rev[side] for side in SIDES}
    index: dict[str, Index | None] = dict.fromkeys(SIDES)
    points = [
        orders_of_point(
            samples,
            Span(w.point, str(w.configuration), w.gear, w.first_sample, w.stop_sample),
            manifest.rate_hz,
            bench,
            steps=steps,
            index=index,
        )
        for w in manifest.windows
        if w.accepted
    ]
    return _source(points, index, [])


def order_files(
    identifier: str, recording: Recording, windows: Sequence[Window], bench: BenchParameters
) -> dict[str, bytes]:
    """Files of the lines of a recording by their place in the store: the table first, the document last."""
    found, buffer = _orders_of_source(recording, windows, bench), io.BytesIO()
    found.table.write_parquet(buffer, compression="zstd", statistics=False)
    text = json.dumps({"schema": SCHEMA} | found.document, indent=1, allow_nan=False, ensure_ascii=False)
    return {
        f"{ORDERS}/{identifier}.parquet": buffer.getvalue(),
        f"{ORDERS}/{identifier}.json": (text + "\n").encode(),
    }


def kept_orders(store: Store, manifest: Manifest) -> SourceOrders | None:
    """The lines that an ingest kept of a source; None where it kept none.

    Raises
    ------
    StoreError
        What it kept cannot be read.
    """
    name = f"{ORDERS}/{manifest.identifier}"
    path = store.path / f"{name}.json"
    if not path.is_file():
        return None
    try:
        store.read_proven(manifest, f"{name}.json")
        document = read_json(path)
        table = pl.read_parquet(io.BytesIO(store.read_proven(manifest, f"{name}.parquet")))
    except (OSError, ValueError, pl.exceptions.PolarsError) as error:
        raise StoreError(str(path), f"unreadable ({error})", SCHEMA, "Remove it: it is made again.") from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA or dict(table.schema) != COLUMNS:
        return None
    return SourceOrders(table, document)


def kept_lines(
    store: Store, manifests: Sequence[Manifest]
) -> tuple[list[tuple[Manifest, SourceOrders | None]], tuple[Remark, ...]]:
    """Lines that an ingest kept of each source, None where it kept none; those damaged or changed are left out.

    Raises
    ------
    StoreError
        All of them are damaged or changed.
    """
    found: list[tuple[Manifest, SourceOrders | None]] = []
    left_out: list[Remark] = []
    for manifest in manifests:
        try:
            found.append((manifest, kept_orders(store, manifest)))
        except StoreError as error:
            left_out.append(Remark("error", "lines of its shafts' orders", f"left out: {error}", manifest.file))
            if len(left_out) == len(manifests):
                raise
    return found, tuple(left_out)


def _source(
    points: Iterable[PointOrders], index: Mapping[str, Index | None], findings: list[dict[str, Any]]
) -> SourceOrders:
    points = tuple(points)
    rows = [
        {
            "point": p.span.point,
            "configuration": p.span.configuration,
            "gear": p.span.gear,
            "first_sample": p.span.first,
        }
        | with_nulls(vars(row))
        for p in points
        for row in p.rows
    ]
    table = pl.DataFrame(rows, schema=COLUMNS)
    document: dict[str, Any] = {
        "index": {side: None if place is None else asdict(place) for side, place in index.items()},
        "load_angles": [
            {"point": p.span.point, "first_sample": p.span.first} | with_nulls(asdict(p.load_angle))
            for p in points
            if p.load_angle is not None
        ],
        "findings": findings,
    }
    return SourceOrders(table, document)
