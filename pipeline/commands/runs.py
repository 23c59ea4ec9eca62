"""The stages behind ``pmg runs``: list, show, diff."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from pmg.pipeline.catalogue.columns import BY_NAME, COLUMNS, SHOWN, Column, Kind
from pmg.pipeline.catalogue.difference import (
    MeanDifference,
    differing,
    differing_rows,
    mean_differences,
    paired,
)
from pmg.pipeline.catalogue.find_run import FoundRun, find_run
from pmg.pipeline.catalogue.index import Catalogue, open_catalogue
from pmg.pipeline.catalogue.listing import aligned, comma_separated, for_json, shown
from pmg.pipeline.catalogue.query import column_named, texts_asked_for
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.settings.bench_in_force import bench_of_store
from pmg.pipeline.store.store import RUNS, Store
from pmg.pipeline.windows.limits import limit_text
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.probability import COVERAGE_FACTOR
from pmg.pipeline.wording.safe_text import printable
from pmg.sim.errors import closest, near_miss
from pmg.sim.shafts import SIDES
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from pmg.pipeline.catalogue.entries import Cell
    from pmg.pipeline.store.moving_record import MovingRecord

LIMITS = "limits"
"""Part of a manifest with the limits by which windows were judged."""


def run_list(
    store: Path, where: str | None = None, sort: str | None = None, columns: str | None = None, as_csv: bool = False
) -> Outcome:
    """List the runs of a store, one row a window or run in motion.

    Parameters
    ----------
    store : Path
        The store.
    where : str, optional
        Condition in SQL, such as ``sun_rpm > 1000 and load = 1.56``.
    sort : str, optional
        Column to sort by; a minus before it puts the largest first.
    columns : str, optional
        Columns by name, with commas; ``all`` for every one. Where none are asked for, text leaves out what no run has.
    as_csv : bool
        Comma-separated values instead of aligned text.
    """
    chosen = _chosen(columns)
    by = None if sort is None else (column_named(sort.removeprefix("-"), "--sort"), sort.startswith("-"))
    catalogue = open_catalogue(Store(store))
    rows = catalogue.rows(chosen, where, by)
    if as_csv:
        lines = comma_separated(chosen, rows)
    else:
        known = [k for k in range(len(chosen)) if columns is not None or any(row[k] is not None for row in rows)]
        table = aligned([chosen[k] for k in known], [[row[k] for k in known] for row in rows]) if rows else ()
        lines = [*table, f"{counted(len(rows), 'run')}"]
    plain = [{column.name: for_json(column, value) for column, value in zip(chosen, row, strict=True)} for row in rows]
    data = {
        "where": where,
        "columns": [{"name": column.name, "unit": column.unit, "meaning": column.meaning} for column in chosen],
        "runs": plain,
    }
    hints = () if rows or where is None else tuple(_unmet(catalogue, where))
    return Outcome(data, tuple(lines), (*catalogue.remarks, *hints), partial=not catalogue.whole)


def _chosen(columns: str | None) -> tuple[Column, ...]:
    if columns is None:
        return tuple(BY_NAME[name] for name in SHOWN)
    if columns == "all":
        return COLUMNS
    return tuple(column_named(name.strip(), "--columns") for name in columns.split(","))


def _unmet(catalogue: Catalogue, condition: str) -> Iterator[Remark]:
    """Words that no run has, with the nearest that one has."""
    for column, text in texts_asked_for(condition):
        known = catalogue.values(column)
        if known and text not in known:
            hint = near_miss(text, known) if len(known) < 20 else closest(text, known)
            yield Remark("warning", column.name, f"no run has {text!r}. {hint}".rstrip())


def run_show(store: Path, name: str) -> Outcome:
    """Show all that a store knows of one recording or test point.

    Parameters
    ----------
    store : Path
        The store.
    name : str
        Recording or test point; `find_run` says by what names.
    """
    catalogue = open_catalogue(Store(store))
    found = find_run(Store(store), catalogue, name)
    channels = _channels(store, found)
    windows = [{column.name: for_json(column, row[column.name]) for column in COLUMNS} for row in found.rows]
    data = {"recording": found.document, "channels": channels, "windows": windows}
    lines = [*_head(found), *_section("channels", channels.items())]
    moving = () if found.manifest is None else found.manifest.moving
    for run in moving:
        lines += _section(f"run in motion {printable(run.point)}", _run_lines(run, found.rows[0]["rate_hz"]))
    for row in found.rows:
        if row["point"] is not None and not moving:
            lines += ["", f"window {printable(str(row['point']))}"]
            lines += [f"  {label:<18} {value}" for label, value in _window_lines(row)]
    lines += _finding_lines(found)
    return Outcome(data, tuple(lines), catalogue.remarks, partial=not catalogue.whole)


def _channels(store: Path, found: FoundRun) -> dict[str, str]:
    """Columns of the samples that are kept, each with its type."""
    import polars as pl

    if found.manifest is None or not found.manifest.ingested:
        return {}
    schema = pl.read_parquet_schema(store / RUNS / f"{found.rows[0]['name']}.parquet")
    units = {"torque": "N m", "angle": "rad", "sample": "number since the start", "lines": "a bit for each line"}
    unit_of = {name: units.get(name.partition("_")[0]) for name in schema}
    return {name: f"{kind} [{unit_of[name]}]" if unit_of[name] else str(kind) for name, kind in schema.items()}


def _head(found: FoundRun) -> Iterator[str]:
    row, document = found.rows[0], found.document
    yield printable(str(row["file"] or row["campaign"]))
    for key in ("name", "status", "sha256", "size", "rate_hz", "samples"):
        if row[key] is not None:
            yield f"  {key:<18} {shown(BY_NAME[key], row[key])}"
    windows = found.manifest is None or not found.manifest.moving  # whose limits say nothing of a run in motion
    for part in ("origin", "run", "calibration", *((LIMITS,) if windows else ())):
        given = document.get(part, {})
        yield from _section(part, _limits(given) if part == LIMITS else _flat(given))


def _section(title: str, pairs: Iterable[tuple[str, object]]) -> list[str]:
    lines = [f"  {printable(key):<28} {printable(str(value))}" for key, value in pairs]
    return ["", title, *lines] if lines else []


def _limits(given: Mapping[str, Any]) -> list[tuple[str, object]]:
    """Limits with the units of a campaign file."""
    return [(name, limit_text(name, given)) for name in given]


def _flat(document: Mapping[str, Any]) -> list[tuple[str, object]]:
    flat: list[tuple[str, object]] = []
    for key, value in document.items():
        flat += (
            [(f"{key} {name}", inner) for name, inner in _flat(value)] if isinstance(value, dict) else [(key, value)]
        )
    return flat


def _run_lines(run: MovingRecord, rate_hz: Cell) -> Iterator[tuple[str, str]]:
    """What is known of a run in motion: its length, how it was judged, the reach of both shafts."""
    if isinstance(rate_hz, float | int):
        yield "length", f"{(run.stop_sample - run.first_sample) / rate_hz:.1f} s"
    yield "judged", "accepted" if run.sound else f"set aside: {printable('; '.join(run.reasons))}"
    for side in SIDES:
        low, high = (end / RPM for end in (run.speed[side].lowest, run.speed[side].highest))
        known = f"{low:.1f} to {high:.1f} rpm" if run.turns[side] else "held"
        yield f"speed_{side}", "not known" if math.isnan(low) else known
    for masked in run.masked:
        yield "left out", f"{masked.column}, samples {masked.first_sample} to {masked.stop_sample}: {masked.why}"


def _window_lines(row: Mapping[str, Cell]) -> Iterator[tuple[str, str]]:
    for name in ("start", "seconds", "configuration", "gear", "drive", "sun_set_rpm", "ring_set_rpm", "load"):
        column = BY_NAME[name]
        if row[name] is not None:
            unit = f" {column.unit}" if column.unit and column.kind is Kind.NUMBER else ""
            yield name, f"{shown(column, row[name])}{unit}"
    state = "accepted" if row["accepted"] else f"rejected: {printable(str(row['reasons'] or 'no reason kept'))}"
    yield "judged", state
    for side in SIDES:
        torque, u, common = row[f"torque_{side}_Nm"], row[f"u_torque_{side}_Nm"], row[f"common_{side}_Nm"]
        if isinstance(torque, float):
            scope = "from point to point" if row["analysed"] else "within the window only: not analysed"
            own = f", u {u:.2g} ({scope})" if isinstance(u, float) else ""
            shared = f", shared by all points {common:.2g}" if isinstance(common, float) else ""
            yield f"torque_{side}", f"{torque:.5f} N m{own}{shared}"
        if row[f"{side}_rpm"] is not None:
            yield f"speed_{side}", f"{row[f'{side}_rpm']:.3f} rpm"


def _finding_lines(found: FoundRun) -> list[str]:
    if found.manifest is None:
        return []
    lines = ["", counted(len(found.manifest.findings), "finding")]
    for finding in found.manifest.findings:
        lines.append(f"  {finding.severity}: {printable(finding.where)}: {printable(finding.message)}")
        words = (("kept", finding.kept), ("lost", finding.lost), ("do", finding.do))
        lines += [f"    {word}: {printable(text)}" for word, text in words if text]
    return lines


def run_diff(store: Path, a: str, b: str, store_b: Path | None = None) -> Outcome:
    """Set two recordings or test points side by side.

    Parameters
    ----------
    store : Path
        Holds the first, and the second too where no other store is named.
    a, b : str
        Recordings or test points.
    store_b : Path, optional
        Holds the second.

    Returns
    -------
    Outcome
        A mismatch where a mean differs beyond U.
    """
    catalogue = open_catalogue(Store(store))
    other = catalogue if store_b is None else open_catalogue(Store(store_b))
    one, two = find_run(Store(store), catalogue, a), find_run(Store(store_b or store), other, b)
    metadata = differing(one.document, two.document)
    calibrations = tuple(None if each.manifest is None else each.manifest.calibration for each in (one, two))
    bench = bench_of_store(store)
    lines = [f"a: {printable(one.name)}", f"b: {printable(two.name)}"]
    lines += _side_by_side("what is said of the recordings", metadata)
    windows, beyond, remarks = [], False, list(catalogue.remarks)
    remarks += other.remarks if other is not catalogue else ()
    for own, their in paired(one, two):
        if own is None or their is None:
            alone = (own or their or {}).get("point")
            remarks.append(Remark("warning", str(alone), f"only in {'a' if their is None else 'b'}"))
            continue
        said, means = differing_rows(own, their), mean_differences(own, their, calibrations, bench)
        beyond |= any(mean.beyond for mean in means)
        title = str(own["point"]) if own["point"] == their["point"] else f"{own['point']} and {their['point']}"
        whole = bool(own["analysed"] and their["analysed"])
        lines += _side_by_side(f"window {printable(title)}", said) + _mean_lines(means)
        if means and not whole:
            lines.append("  not analysed: U holds what varies within the windows, not what wanders between them")
            remarks.append(Remark("info", title, "not analysed: u holds what varies within the windows only"))
        windows.append({"a": own["point"], "b": their["point"], "differs": _plain(said)} | _documents(means))
    data = {"a": one.name, "b": two.name, "differs": _plain(metadata), "windows": windows, "beyond_U": beyond}
    partial = not (catalogue.whole and other.whole)
    return Outcome(data, tuple(lines), tuple(remarks), partial=partial, mismatch=beyond)


def _plain(differing: Mapping[str, tuple[Any, Any]]) -> dict[str, dict[str, Any]]:
    return {key: {"a": a, "b": b} for key, (a, b) in differing.items()}


def _documents(means: tuple[MeanDifference, ...]) -> dict[str, Any]:
    return {"means": [mean.document() for mean in means]}


def _side_by_side(title: str, differing: Mapping[str, tuple[Any, Any]]) -> list[str]:
    if not differing:
        return ["", title, "  nothing differs but the means" if title.startswith("window") else "  nothing differs"]
    cells = [(key, *(_cell(key, value) for value in pair)) for key, pair in differing.items()]
    wide = max(len(key) for key, _, _ in cells), max(len(a) for _, a, _ in cells)
    return ["", title, *(f"  {key:<{wide[0]}}  {a:<{wide[1]}}  {b}" for key, a, b in cells)]


def _cell(key: str, value: object) -> str:
    part, _, limit = key.partition(".")
    if part == LIMITS and isinstance(value, int | float):
        return limit_text(limit, {limit: value})
    column = BY_NAME.get(key)
    if column is not None and (value is None or isinstance(value, str | int | float)):
        return shown(column, value)
    return "-" if value is None else printable(value if isinstance(value, str) else json.dumps(value))


def _mean_lines(means: tuple[MeanDifference, ...]) -> list[str]:
    lines = []
    for mean in means:
        judged = {True: "beyond U", False: "within U", None: "U not known"}[mean.beyond]
        known = "" if mean.u is None else f", U {COVERAGE_FACTOR * mean.u:.2g}"
        value = f"{round(mean.value, 5) + 0.0:.5f} {mean.unit}"
        lines.append(f"  {mean.name:<15} {mean.a:.5f} - {mean.b:.5f} = {value}{known}: {judged}")
    return lines
