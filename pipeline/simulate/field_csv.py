"""Field computations as CSV: four columns in any order of rows, one row a pair of angles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pmg.sim.errors import GridError, near_miss
from pmg.sim.maps.table import FemTable

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt

    from pmg.sim.signals import Array

COLUMNS = ("sun_angle_deg", "ring_angle_deg", "sun_torque_Nm", "ring_torque_Nm")
"""Columns of a table of field computations; others are passed over."""

_SAME_ANGLE = 1e-7
"""Angles nearer than this [degrees] are one: 0.1 and 0.30000000000000004 - 0.2 as other tools print them."""


def _numbers(frame: pd.DataFrame, name: str, path: Path) -> Array:
    if name not in frame.columns:
        came = f"columns {', '.join(map(str, frame.columns))}"
        raise GridError(str(path), came, f"a column {name}", near_miss(name, map(str, frame.columns)))
    values = pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=np.float64)
    unusable = np.flatnonzero(~np.isfinite(values))
    if len(unusable):
        row = int(unusable[0])
        came = repr(str(frame[name].iloc[row]))
        raise GridError(f"{path}: row {row + 1}, column {name}", came, "a finite number", "Fill the cell.")
    return values


def _levels(angle: Array) -> tuple[Array, npt.NDArray[np.int64]]:
    """Distinct angles, ascending, and the place of every row among them."""
    order = np.argsort(angle, kind="stable")
    rises = np.diff(angle[order]) > _SAME_ANGLE
    rank = np.concatenate([[0], np.cumsum(rises)])
    place = np.empty(len(angle), dtype=np.int64)
    place[order] = rank
    return angle[order][np.concatenate([[True], rises])], place


def read_fem_csv(path: Path) -> FemTable:
    """The table of field computations in a file.

    Parameters
    ----------
    path : Path
        Comma-separated, with the columns `COLUMNS`: angles in degrees, torques of the field on the rotors in N m.

    Returns
    -------
    FemTable
        Sorted by angle. Whether it is periodic and conservative is judged when a map is made of it.

    Raises
    ------
    GridError
        When the file or a column is missing, a cell is no number, or the rows do not make a full rectangle.
    """
    if not path.is_file():
        raise GridError(str(path), "no such file", "a table of field computations", "Check the path.")
    try:
        frame = pd.read_csv(path, skipinitialspace=True)
    except (ValueError, UnicodeDecodeError) as error:
        raise GridError(str(path), f"not a table ({error})", "comma-separated values", "Check the file.") from error
    sun, ring, torque_sun, torque_ring = (_numbers(frame, name, path) for name in COLUMNS)
    if frame.empty:
        raise GridError(str(path), "no rows", "one row a pair of angles", "Check the file.")
    (angle_sun, i), (angle_ring, j) = _levels(sun), _levels(ring)
    count = np.zeros((len(angle_sun), len(angle_ring)), dtype=np.int64)
    np.add.at(count, (i, j), 1)
    if (count != 1).any():
        a, b = (int(k) for k in np.argwhere(count != 1)[0])
        raise GridError(
            f"{path}: sun angle {angle_sun[a]:.6g}, ring angle {angle_ring[b]:.6g} degrees",
            f"{count[a, b]} rows in a table of {len(angle_sun)} sun and {len(angle_ring)} ring angles",
            "exactly one row for every pair of angles",
            "Complete the rectangle." if count[a, b] == 0 else "Leave one of the rows out.",
        )
    on_sun, on_ring = np.empty(count.shape), np.empty(count.shape)
    on_sun[i, j], on_ring[i, j] = torque_sun, torque_ring
    return FemTable(np.radians(angle_sun), np.radians(angle_ring), on_sun, on_ring, str(path))
