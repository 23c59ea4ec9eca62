"""Grids as tables: CSV and Parquet for people and other tools, the published grids, and back."""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pmg.pipeline.files.notes import note_read
from pmg.pipeline.grid.transducer_uncertainty import common_uncertainty
from pmg.pipeline.store.sources import PUBLISHED
from pmg.sim.errors import GridError
from pmg.sim.grid import ROW_FIELDS, Configuration, Grid, OperatingPoints
from pmg.sim.signals import RPM, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

ROUNDING_PUBLISHED = 0.01
"""Step to which the published torques are rounded [N m]."""

ROUNDING_FINE = 1e-4
"""Step to which the ring torques of the engaged points are rounded where they are printed once more [N m]."""

FINE_COLUMN = "ring_torque_simulation_input_Nm"
"""Column with those: the measured ring torques that the source gave its simulation (its tables 6.2 and 6.3)."""

RATIO_TOLERANCE = 0.02
"""Largest deviation of engaged speeds from the gear ratio, as part of the sun speed."""

BEYOND = {"_rpm": 1e6, "_Nm": 1e3}
"""Speeds and torques, by the end of a column's name, that no encoder and no transducer of such a bench gives."""

_NEUTRAL_COLUMNS = ("sun_speed_rpm", "ring_speed_rpm", "sun_loss_torque_Nm", "ring_loss_torque_Nm")
_ENGAGED_COLUMNS = (
    "sun_speed_rpm",
    "ring_speed_rpm",
    "ring_torque_set_Nm",
    "sun_torque_measured_Nm",
    "ring_torque_measured_Nm",
)


def grid_frame(grid: Grid) -> pd.DataFrame:
    """One row a point, speeds in rpm next to the SI torques; the inverse of `frame_grid`."""
    at = grid.points
    columns: dict[str, object] = {
        "point": at.name,
        "configuration": at.configuration,
        "gear": at.gear,
        "drive": at.drive,
        SPEED_SUN.display_name: SPEED_SUN.display(at.speed_sun),
        SPEED_RING.display_name: SPEED_RING.display(at.speed_ring),
        "load_set_Nm": at.load_set,
        "started_at_s": at.started_at,
        "rest_sun": at.rest_sun,
        "rest_ring": at.rest_ring,
    }
    for name in ROW_FIELDS:
        plain = name in ("accepted", "reason")
        columns[name if plain else f"{name}_Nm"] = getattr(grid, name)
    return pd.DataFrame(columns)


def frame_grid(frame: pd.DataFrame, origin: str, campaign: str) -> Grid:
    """The grid that `grid_frame` wrote."""

    def column(name: str) -> Array:
        return frame[name].to_numpy(dtype=np.float64)

    def words(name: str) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
        return frame[name].fillna("").to_numpy(dtype=np.str_)

    torque_ring = column("torque_ring_Nm")
    points = OperatingPoints(
        name=words("point"),
        configuration=words("configuration"),
        gear=frame["gear"].to_numpy(dtype=np.int64),
        drive=words("drive"),
        speed_sun=column(SPEED_SUN.display_name) * SPEED_SUN.scale,
        speed_ring=column(SPEED_RING.display_name) * SPEED_RING.scale,
        torque_ring=torque_ring,
        load_set=column("load_set_Nm"),
        started_at=column("started_at_s"),
        rest_sun=frame["rest_sun"].to_numpy(dtype=bool),
        rest_ring=frame["rest_ring"].to_numpy(dtype=bool),
    )
    values = {name: column(f"{name}_Nm") for name in ROW_FIELDS if name not in ("accepted", "reason")}
    return Grid(
        origin=origin,
        campaign=campaign,
        points=points,
        accepted=frame["accepted"].to_numpy(dtype=bool),
        reason=words("reason"),
        **values,
        rounding=ROUNDING_PUBLISHED if origin == "published" else 0.0,
    )


def _read_published_csv(path: Path, needed: tuple[str, ...], further: tuple[str, ...] = ()) -> pd.DataFrame:
    """The table with the columns needed, and those of `further` that it has, all checked."""
    if not path.is_file():
        raise GridError(str(path), "no such file", "a published grid", "Name a folder that holds it.")
    try:
        data = path.read_bytes()
        frame = pd.read_csv(io.BytesIO(data))
    except (ValueError, UnicodeDecodeError) as error:
        raise GridError(str(path), f"not a table ({error})", "comma-separated values", "Check the file.") from error
    note_read(path, data)
    for name in (*needed, *(name for name in further if name in frame.columns)):
        if name not in frame.columns:
            raise GridError(
                str(path),
                f"columns {', '.join(map(str, frame.columns))}",
                f"a column {name}",
                "Add or rename it.",
            )
        values = pd.to_numeric(frame[name], errors="coerce")
        if values.isna().any():
            row = int(np.flatnonzero(values.isna())[0])
            raise GridError(
                f"{path}: line {row + 2}, column {name}",
                repr(str(frame[name].iloc[row])),
                "a number",
                "A grid must have no holes: fill the cell, or leave the whole line out.",
            )
        outside = ~np.isfinite(values) | ((values < 0.0) if name.endswith("_rpm") else False)
        if outside.any():
            row = int(np.flatnonzero(outside)[0])
            raise GridError(
                f"{path}: line {row + 2}, column {name}",
                repr(str(frame[name].iloc[row])),
                "a finite number, and a magnitude for a speed",
                "Published grids hold forward rotation only; ingest recordings for the rest.",
            )
        most = next(limit for end, limit in BEYOND.items() if name.endswith(end))
        if (beyond := values.abs() > most).any():
            row = int(np.flatnonzero(beyond)[0])
            raise GridError(
                f"{path}: line {row + 2}, column {name}",
                repr(str(frame[name].iloc[row])),
                f"a value that a bench can give, at most {most:g}",
                "Correct the cell, or leave the whole line out.",
            )
        frame[name] = values.astype(float)
    if frame.empty:
        raise GridError(str(path), "no rows", "at least one point", "Check the file.")
    return frame


def read_published(folder: Path, bench: BenchParameters) -> Grid:
    """The published campaign: the neutral and the engaged grid of a folder as one measured grid.

    Parameters
    ----------
    folder : Path
        Holds ``neutral_grid.csv`` and ``engaged_grid.csv``, both with magnitudes: forward rotation, the loss torques
        of both shafts in neutral, driving and load torque when engaged. A column
        ``ring_torque_simulation_input_Nm``, where there is one, is the measured load torque to four decimals, and is
        used instead of the one to two.
    bench : BenchParameters
        For the uncertainty that all readings of a transducer share.

    Returns
    -------
    Grid
        Signed as recordings are. The standard uncertainty of each torque is that of its rounding to 0.01 N m,
        0.01/sqrt(12), or to 0.0001 N m; the order of the points is not known.

    Raises
    ------
    GridError
        A file is missing, a column is missing, a cell is empty or not a number.
    """
    neutral = _read_published_csv(folder / PUBLISHED[0], _NEUTRAL_COLUMNS)
    engaged = _read_published_csv(folder / PUBLISHED[1], _ENGAGED_COLUMNS, (FINE_COLUMN,))
    fine = FINE_COLUMN in engaged.columns
    ring_column = FINE_COLUMN if fine else "ring_torque_measured_Nm"
    stage = bench.stages[0]
    ratio = bench.gear(stage).ratio
    slip = np.abs(engaged.sun_speed_rpm - ratio * engaged.ring_speed_rpm)
    stray = (slip > RATIO_TOLERANCE * engaged.sun_speed_rpm) | (engaged.sun_speed_rpm == 0.0)
    if stray.any():
        row = int(np.flatnonzero(stray)[0])
        raise GridError(
            f"{folder / 'engaged_grid.csv'}: line {row + 2}",
            f"{engaged.sun_speed_rpm[row]:g} and {engaged.ring_speed_rpm[row]:g} rpm",
            f"speeds in the ratio {ratio:g} within {RATIO_TOLERANCE:.0%}",
            "Correct the line; an engaged gear cannot run like that.",
        )
    n, m = len(neutral), len(engaged)
    speed_sun = np.r_[neutral.sun_speed_rpm, engaged.sun_speed_rpm] * RPM
    speed_ring = np.r_[neutral.ring_speed_rpm, -engaged.ring_speed_rpm] * RPM
    torque_sun = np.r_[neutral.sun_loss_torque_Nm, engaged.sun_torque_measured_Nm]
    torque_ring = np.r_[neutral.ring_loss_torque_Nm, engaged[ring_column]]
    names = [f"N_s{s:+05.0f}_r{r:+04.0f}" for s, r in zip(neutral.sun_speed_rpm, neutral.ring_speed_rpm, strict=True)]
    names += [f"E_s{s:+05.0f}_l{t:.2f}" for s, t in zip(engaged.sun_speed_rpm, engaged.ring_torque_set_Nm, strict=True)]
    u = np.full(n + m, ROUNDING_PUBLISHED / math.sqrt(12.0))
    u_ring = np.r_[u[:n], np.full(m, (ROUNDING_FINE if fine else ROUNDING_PUBLISHED) / math.sqrt(12.0))]
    common_sun, common_ring = common_uncertainty(torque_sun, torque_ring, bench)
    points = OperatingPoints(
        name=np.array(names, dtype=np.str_),
        configuration=np.array([Configuration.NEUTRAL] * n + [Configuration.ENGAGED] * m, dtype=np.str_),
        gear=np.full(n + m, stage, dtype=np.int64),
        drive=np.full(n + m, "sun"),
        speed_sun=speed_sun,
        speed_ring=speed_ring,
        torque_ring=torque_ring,
        load_set=np.r_[np.zeros(n), engaged.ring_torque_set_Nm],
        started_at=np.full(n + m, np.nan),
        rest_sun=speed_sun == 0.0,
        rest_ring=speed_ring == 0.0,
    )
    return Grid(
        origin="published",
        campaign="published",
        points=points,
        torque_sun=torque_sun,
        torque_ring=torque_ring,
        within_sun=u,
        within_ring=u_ring,
        u_sun=u,
        u_ring=u_ring,
        common_sun=common_sun,
        common_ring=common_ring,
        accepted=np.ones(n + m, dtype=bool),
        reason=np.full(n + m, ""),
        rounding=ROUNDING_PUBLISHED,
    )
