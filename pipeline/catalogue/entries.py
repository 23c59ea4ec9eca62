"""Rows of the catalogue's tables, from a manifest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from pmg.pipeline.grid.window_facts import marked_as_simulated
from pmg.pipeline.recording.codes import Severity
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES
from pmg.sim.signals import SPEED_RING, SPEED_SUN, SPEEDS, TORQUES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pmg.pipeline.recording.means import ShaftMeans
    from pmg.pipeline.store.manifest import Manifest, StoredWindow
    from pmg.pipeline.store.moving_record import MovingRecord
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

Cell = str | int | float | None
LARGEST = 2**53
"""Whole numbers beyond this are damage."""


@dataclass(frozen=True)
class Entry:
    """One row, its name and its parts.

    Parameters
    ----------
    fields : dict
        Value of each field.
    parts : tuple of Entry
        Rows that belong to it: windows of a recording, quantities of a window.
    """

    fields: dict[str, Cell]
    parts: tuple[Entry, ...] = ()


def recording_entry(manifest: Manifest) -> Entry:
    """A recording with its windows and their quantities.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError
        The manifest is damaged.
    """
    run, origin = manifest.run, manifest.origin
    severities = [finding.severity for finding in manifest.findings]
    fields: dict[str, Cell] = {
        "campaign": _text(run.campaign),
        "name": _text(manifest.identifier),
        "file": _text(manifest.file),
        "status": _text(manifest.status),
        "point": _text(run.point),
        "configuration": _text(run.configuration),
        "gear": _whole(run.gear),
        "drive": _text(run.drive),
        "manoeuvre": _text(run.manoeuvre),
        "measurement_begin": _text(run.started_at),
        "findings": len(manifest.findings),
        "errors": severities.count(Severity.ERROR),
        "simulated": int(marked_as_simulated(manifest)),
        "rate_hz": _number(manifest.rate_hz),
        "samples": _whole(manifest.samples),
        "size": _whole(manifest.size),
        "sha256": _text(manifest.sha256),
        "origin": None if origin is None else _text(origin.source),
        "note": _text(run.note),
    }
    moving = (_moving(record, manifest.rate_hz) for record in manifest.moving)
    return Entry(fields, (*map(_window, manifest.windows), *moving))


def _moving(record: MovingRecord, rate: float) -> Entry:
    """A run in motion: what it is asked for, and its mean, is no one value, and no grid holds it."""
    samples, begin = record.stop_sample - record.first_sample, _number(record.started_at_s)
    fields: dict[str, Cell] = {
        "name": _text(record.point),
        "measurement_begin": None if begin is None else _moment(begin),
        "begin_s": begin,
        "seconds": _number(samples / rate) if rate else None,
        "number_of_rows": _whole(samples),
        "accepted": int(record.sound),
        "reasons": _text("; ".join(record.reasons)),
        "rest_sun": int(not record.turns.sun),
        "rest_ring": int(not record.turns.ring),
    }
    return Entry(fields)


def _window(window: StoredWindow) -> Entry:
    means, asked = window.means, window.setpoints
    load = _number(asked.torque_ring)
    if window.configuration is not Configuration.ENGAGED:
        load = 0.0
    elif load is None and not math.isnan(means.ring.torque):
        load = round(means.ring.torque, 1)
    begin = _number(window.started_at_s)
    fields: dict[str, Cell] = {
        "name": _text(window.point),
        "configuration": _text(window.configuration.value),
        "gear": _whole(window.gear),
        "drive": _text(window.drive),
        "measurement_begin": None if begin is None else _moment(begin),
        "begin_s": begin,
        "seconds": _number(means.duration),
        "number_of_rows": _whole(window.stop_sample - window.first_sample),
        "sun_set": _shown(SPEED_SUN.display, asked.speed_sun),
        "ring_set": _shown(SPEED_RING.display, asked.speed_ring),
        "load": load,
        "accepted": int(window.accepted),
        "reasons": _text("; ".join(window.reasons)),
        "rest_sun": int(window.rest_sun),
        "rest_ring": int(window.rest_ring),
        "analysed": 0,
    }
    return Entry(fields, tuple(entry for side in SIDES for entry in _quantities(side, means[side])))


def _quantities(side: str, means: ShaftMeans) -> tuple[Entry, Entry]:
    """Torque and speed of a shaft over a window; the uncertainty is that from within the window."""
    speed, torque = SPEEDS[side], TORQUES[side]
    return (
        Entry(_quantity(torque.name, torque.unit, means.torque) | {"u": _number(means.within)} | _scatter(means)),
        Entry(_quantity(speed.name, speed.display_unit, _shown(speed.display, means.speed))),
    )


def _quantity(name: str, unit: str, average: object) -> dict[str, Cell]:
    return {"name": name, "unit": unit, "average": _number(average)}


def _scatter(means: ShaftMeans) -> dict[str, Cell]:
    return {"standard_deviation": _number(means.std)}


def grid_entry(grid: Grid) -> Entry:
    """A grid that was read from tables, as one recording whose windows are its points."""
    fields: dict[str, Cell] = {"campaign": grid.campaign, "name": grid.campaign, "status": "table"}
    fields |= {"findings": 0, "errors": 0, "simulated": 0}
    return Entry(fields, tuple(_point(grid, row) for row in range(len(grid))))


def _point(grid: Grid, row: int) -> Entry:
    at, begin = grid.points, _number(float(grid.points.started_at[row]))
    fields: dict[str, Cell] = {
        "name": str(at.name[row]),
        "configuration": str(at.configuration[row]),
        "gear": int(at.gear[row]),
        "drive": str(at.drive[row]),
        "measurement_begin": None if begin is None else _moment(begin),
        "begin_s": begin,
        "load": _number(float(at.load_set[row])),
        "accepted": int(grid.accepted[row]),
        "reasons": str(grid.reason[row]),
        "rest_sun": int(at.rest_sun[row]),
        "rest_ring": int(at.rest_ring[row]),
        "analysed": 1,
    }
    parts = []
    for side in SIDES:
        speed, torque = SPEEDS[side], TORQUES[side]
        mean = float(getattr(grid, torque.name)[row])
        shown = _shown(speed.display, getattr(at, speed.name)[row])
        parts.append(Entry(_quantity(torque.name, torque.unit, mean) | grid_uncertainty(grid, side, row)))
        parts.append(Entry(_quantity(speed.name, speed.display_unit, shown)))
    return Entry(fields, tuple(parts))


def grid_uncertainty(grid: Grid, side: str, row: int) -> dict[str, Cell]:
    """Both parts of the standard uncertainty of a point's torque, as the analysis gives them [N m]."""
    return {
        "u": _number(float(getattr(grid, f"u_{side}")[row])),
        "u_common": _number(float(getattr(grid, f"common_{side}")[row])),
    }


def _shown(display: Callable[[float], Array], value: object) -> float | None:
    known = _number(value)
    return None if known is None else float(display(known))


def _moment(seconds: float) -> str:
    """A time since 1970 [s] as ISO 8601 in UTC, to the millisecond."""
    try:
        return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")
    except (OverflowError, OSError) as error:
        raise ValueError(f"{seconds} is no time") from error


def _text(value: object) -> str | None:
    """Text that a table can hold; what UTF-8 cannot is spelled out."""
    if value is None:
        return None
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value.encode("utf-8", "backslashreplace").decode()


def _number(value: object) -> float | None:
    """A finite number; None where it is not known."""
    if value is None or isinstance(value, bool) or not isinstance(value, int | float):
        if value is None:
            return None
        raise TypeError(f"{value!r} is no number")
    return float(value) if math.isfinite(value) else None


def _whole(value: object) -> int | None:
    """A whole number of a size that is one; None where it is not known."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) > LARGEST:
        raise TypeError(f"{value!r} is no whole number")
    return value


def rejected_as_copies(entries: Sequence[Entry], manifests: Sequence[Manifest]) -> list[Entry]:
    """The entries with acceptance and reasons as these manifests of the same recordings have them."""
    return [
        Entry(
            entry.fields,
            (
                *(
                    Entry(
                        part.fields | {"accepted": int(window.accepted), "reasons": _text("; ".join(window.reasons))},
                        part.parts,
                    )
                    for part, window in zip(entry.parts[: len(manifest.windows)], manifest.windows, strict=True)
                ),
                *entry.parts[len(manifest.windows) :],
            ),
        )
        for entry, manifest in zip(entries, manifests, strict=True)
    ]
