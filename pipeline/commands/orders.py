"""The stage behind ``pmg orders``: lines of a campaign, what they follow, the load angle; as lines and as JSON."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from pmg.pipeline.chapters.measured.orders import orders_section
from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.commands.crate import recordings_of
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_files, now
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.json_values import with_nulls
from pmg.pipeline.grid.crosschecks.checked import checked_campaign
from pmg.pipeline.orders.band import FALSE_ALARM
from pmg.pipeline.orders.example import choose_example
from pmg.pipeline.orders.load_angle import LoadAngle, wind_up
from pmg.pipeline.orders.statement import statement, unit_of
from pmg.pipeline.orders.stored_lines import SCHEMA, TYPES, kept_lines, orders_of_manifest
from pmg.pipeline.orders.survey import NOTHING_FOLLOWED, follow_lines
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.document import Facts, Headline, Report
from pmg.pipeline.report.write import write_report
from pmg.pipeline.settings.bench_in_force import bench_of_store
from pmg.pipeline.store.store import Store
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.spreadsheet import spreadsheet_csv
from pmg.sim.errors import FitError, StoreError, near_miss

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pmg.pipeline.orders.stored_lines import SourceOrders
    from pmg.pipeline.orders.survey import LineSurvey, UncertainValue
    from pmg.pipeline.report.document import Section
    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.bench import BenchParameters

SLIPPED = 0.5
"""Poles lost over a window from which on it has no load angle."""
TINY = 1e-12
"""Uncertainty of an angle [rad] below which it is rounding."""
ANGLES: dict[str, Any] = {
    "source": pl.String,
    "point": pl.String,
    "gear": pl.Int64,
    "first_sample": pl.Int64,
    "torque_ring_Nm": pl.Float64,
    "speed_sun_rad_s": pl.Float64,
} | {f.name: TYPES[str(f.type)] for f in fields(LoadAngle)}
"""Columns of ``load_angles.csv``."""


def run_orders(
    store: Path,
    *,
    campaign: str | None = None,
    point: str | None = None,
    out: Path | None = None,
    report: Path | None = None,
) -> Outcome:
    """Say which lines a campaign's signals hold, what they follow and how far the gear is wound up.

    Parameters
    ----------
    store : Path
        Holds the ingested recordings.
    campaign : str, optional
        Which campaign, where the store holds several.
    point : str, optional
        One test point, of which every line is reported; the whole campaign when not given.
    out : Path, optional
        Folder of ``orders.csv``, ``load_angles.csv`` and ``orders.json``; none when not given.
    report : Path, optional
        Folder of a report on the campaign; none when not given.

    Raises
    ------
    StoreError
        No such store, campaign or point.
    """
    began = now()
    home, bench = Store(store), bench_of_store(store)
    name, checked = checked_campaign(home, campaign, bench)
    found, left_out = kept_lines(home, checked.manifests)
    recomputed = sum(orders is None for _, orders in found)
    sources = [(m, orders_of_manifest(home, m, bench) if orders is None else orders) for m, orders in found]
    table = pl.concat([_with_points(m, orders) for m, orders in sources])
    if point is not None:
        known = sorted(set(table["point"]))
        if point not in known:
            raise StoreError(f"campaign {name}", f"no point '{point}'", "one of its points", near_miss(point, known))
        table = table.filter(pl.col("point") == point)
    followed = () if point is not None else follow_lines(table.filter("accepted"), bench)
    angles = [angle for m, orders in sources for angle in _load_angles(m, orders) if point in (None, angle["point"])]
    law = [] if point is not None else _laws(angles, bench)
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "campaign": name,
        "points": table.select("point", "first_sample", "source").unique().height,
        "without_coils_and_index": recomputed,
        "false_alarm_rate": FALSE_ALARM,
        "lines": [_followed_document(line) for line in followed],
        "load_angles": angles,
        "wind_up": law,
        "statements": [statement(line) for line in followed if line.present],
    }
    if point is not None:
        data["rows"] = table.to_dicts()
    if out is not None:
        data["files"] = _write(out, table, angles, data)
    lines = list(_point_lines(table) if point is not None else _campaign_lines(name, followed))
    lines += _angle_lines(angles, law)
    if report is not None:
        section = orders_section(followed, table.filter("accepted"), angles, choose_example(home, checked.manifests))
        files = write_report(_page(name, followed, section, len(sources)), report)
        leave_crate_of_files(report, "pmg orders", recordings_of(store, name), files, began)
        data |= {"report": str(files[0])}
        lines.append(f"report: {files[0]}")
    findings = (finding for _, orders in sources for finding in orders.findings)
    return Outcome(data, tuple(lines), (*left_out, *findings), partial=bool(left_out))


def orders_chapter(
    store: Store, manifests: Sequence[Manifest], bench: BenchParameters
) -> tuple[Section | None, tuple[Remark, ...]]:
    """The chapter for the report of a campaign, None where one of its recordings has no lines, and what it lacks."""
    found, left_out = kept_lines(store, manifests)
    sources = [(manifest, orders) for manifest, orders in found if orders is not None]
    if len(sources) < len(found):
        return None, left_out
    table = pl.concat([_with_points(manifest, orders) for manifest, orders in sources]).filter("accepted")
    angles = [angle for manifest, orders in sources for angle in _load_angles(manifest, orders)]
    return orders_section(follow_lines(table, bench), table, angles, choose_example(store, manifests)), left_out


def _page(campaign: str, followed: tuple[LineSurvey, ...], section: Section, recordings: int) -> Report:
    """A report of this chapter alone."""
    return Report(
        title=f"Order analysis of campaign {campaign}",
        subtitle="Lines of torque, speed and flux density, and the load angle",
        verdict=Headline(f"{_present(followed)}.", "neutral"),
        sections=(section,),
        provenance=Facts((("Input", counted(recordings, "recording")), ("Versions", versions(PACKAGES)))),
    )


def _with_points(manifest: Manifest, orders: SourceOrders) -> pl.DataFrame:
    """Lines of a source next to speeds, load and acceptance of their windows."""
    rows = [
        (
            w.point,
            w.first_sample,
            manifest.identifier,
            w.accepted,
            w.means.sun.speed,
            w.means.ring.speed,
            w.means.ring.torque,
        )
        for w in manifest.windows
    ]
    schema = {
        "point": pl.String,
        "first_sample": pl.Int64,
        "source": pl.String,
        "accepted": pl.Boolean,
        "speed_sun": pl.Float64,
        "speed_ring": pl.Float64,
        "load": pl.Float64,
    }
    windows = pl.DataFrame(rows, schema=schema, orient="row").fill_nan(None)
    return orders.table.join(windows, on=["point", "first_sample"], how="inner")


def _load_angles(manifest: Manifest, orders: SourceOrders) -> list[dict[str, Any]]:
    """Load angles of the accepted windows of a source, with their load."""
    windows = {(w.point, w.first_sample): w for w in manifest.windows if w.accepted}
    found = []
    for angle in orders.document["load_angles"]:
        window = windows.get((angle["point"], angle["first_sample"]))
        if window is not None:
            own = {"source": manifest.identifier, "gear": window.gear}
            means = {"torque_ring_Nm": window.means.ring.torque, "speed_sun_rad_s": window.means.sun.speed}
            found.append(own | with_nulls(means) | angle)
    return found


def _laws(angles: list[dict[str, Any]], bench: BenchParameters) -> list[dict[str, Any]]:
    """The load angle against the load, for each set of points with a common zero."""
    sets: dict[tuple[int, str], list[dict[str, Any]]] = {}
    for angle in angles:
        usable = angle["u"] is not None and angle["torque_ring_Nm"] is not None and abs(angle["slipped"]) < SLIPPED
        if usable:
            zero = "index pulses" if angle["from_index"] else angle["source"]
            sets.setdefault((angle["gear"], zero), []).append(angle)
    laws = []
    for (gear, zero), members in sorted(sets.items()):
        document: dict[str, Any] = {"gear": gear, "zero": zero, "points": len(members)}
        several = len({member["source"] for member in members}) > 1
        own = np.array([member["u"] for member in members])
        u = np.hypot(own, [member["u_index"] if several else 0.0 for member in members])
        dof = np.array([member["dof"] or 1.0 for member in members]) * (u / np.maximum(own, TINY)) ** 4
        torque, value = (np.array([m[key] for m in members]) for key in ("torque_ring_Nm", "angle"))
        try:
            law = wind_up(torque, value, u, bench.gear(gear), dof)
        except FitError as error:
            laws.append(document | {"reason": error.advice})
        else:
            laws.append(document | asdict(law))
    return laws


def _followed_document(line: LineSurvey) -> dict[str, Any]:
    def estimate(given: UncertainValue | None) -> dict[str, float] | None:
        return None if given is None or math.isnan(given.value) else asdict(given)

    plain = asdict(line) | {"amplitude": estimate(line.amplitude)}
    plain |= {"exponent": estimate(line.exponent), "per_load": estimate(line.per_load)}
    return plain


def _campaign_lines(name: str, followed: tuple[LineSurvey, ...]) -> tuple[str, ...]:
    lines = (statement(line) for line in followed if line.present)
    return (f"campaign {name}: {_present(followed)}", *lines)


def _present(followed: tuple[LineSurvey, ...]) -> str:
    if not followed:
        return NOTHING_FOLLOWED
    present = [line for line in followed if line.present]
    named = sum(line.belongs is not None for line in present)
    return (
        f"{len(present)} of {len(followed)} lines are beyond what noise exceeds in {FALSE_ALARM:.0%} of points; "
        f"{named} have order and growth of a mechanism of the catalogue"
    )


def _point_lines(table: pl.DataFrame) -> tuple[str, ...]:
    """Every line of one point, those beyond their band first."""
    lines, silent = [], 0
    for row in table.iter_rows(named=True):
        if row["amplitude"] is None:
            silent += 1
            continue
        unit, scale = unit_of(row["signal"])
        beyond = row["amplitude"] > row["band"]
        size = f"{row['amplitude'] / scale:.4g} {unit} [{row['low'] / scale:.4g}, {row['high'] / scale:.4g}]"
        phase = "" if row["phase"] is None else f", phase {math.degrees(row['phase']):+.1f} deg"
        if beyond:
            lines.append(f"{row['signal']}  {row['line']}  {size}, band {row['band'] / scale:.2g} {unit}{phase}")
    within = table.height - silent - len(lines)
    head = f"{counted(len(lines), 'line')} beyond their band, {within} within it, {silent} without a number"
    reasons = sorted({f"{r['line']}: {r['reason']}" for r in table.iter_rows(named=True) if r["reason"]})
    return (head, *lines, *(f"no number for {reason}" for reason in reasons))


def _angle_lines(angles: list[dict[str, Any]], laws: list[dict[str, Any]]) -> tuple[str, ...]:
    lines = []
    indexed = sum(angle["from_index"] for angle in angles)
    if angles:
        lines.append(f"load angle of {counted(len(angles), 'window')}, {indexed} of them from index pulses")
    slipped = [angle["point"] for angle in angles if abs(angle["slipped"]) >= SLIPPED]
    if slipped:
        lines.append(f"poles slipped at {', '.join(slipped)}")
    for law in laws:
        zero = f"gear {law['gear']}, zero from {law['zero']}, {counted(law['points'], 'point')}"
        if "reason" in law:
            lines.append(f"load angle against load ({zero}): not judged; {law['reason']}")
        else:
            lines.append(
                f"load angle against load ({zero}): it changes by {law['slope']:.3f} (u {law['u']:.3f}, 95 % within "
                f"{law['reach']:.3f}) of what the published pull-out torque implies over these loads, "
                f"{law['span']:.4f} rad"
            )
    # files without index pulses have a zero each: one sentence for all of them
    alone = [line for line in lines if "zero from index" not in line and "not judged" in line]
    if len(alone) > 1:
        lines = [line for line in lines if line not in alone]
        lines.append(f"load angle against load: {len(alone)} files without index pulses lack a common zero; not judged")
    return tuple(lines)


def _write(out: Path, table: pl.DataFrame, angles: list[dict[str, Any]], data: dict[str, Any]) -> list[str]:
    """Tables and summary; returns their paths."""
    tables = {"orders.csv": table, "load_angles.csv": pl.DataFrame(angles, schema=ANGLES)}
    for name, frame in tables.items():
        write_atomic(out / name, spreadsheet_csv(frame).encode())
    text = json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n"
    write_atomic(out / "orders.json", text.encode())
    return [str(out / name) for name in (*tables, "orders.json")]
