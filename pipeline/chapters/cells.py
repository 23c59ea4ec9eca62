"""Points laid out over the test grid, for maps and for curves by load."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.report.document import Figure, SpeedMap
from pmg.sim.signals import Array

if TYPE_CHECKING:
    import numpy.typing as npt


def sun_speed_label(ratio: float) -> str:
    """Label of an axis of the sun's speed along which the ring turns with it."""
    return f"sun speed [rpm]; ring at 1/{ratio:.4g} of it"


def lay_out(x: Array, y: Array, values: Array) -> tuple[Array, Array, Array]:
    """Levels of x and of y, and the mean of the finite values in each cell (m, n); NaN where there is none."""
    levels_x, levels_y = np.unique(x), np.unique(y)
    total = np.zeros((len(levels_y), len(levels_x)))
    count = np.zeros_like(total)
    known = np.isfinite(values)
    index = (np.searchsorted(levels_y, y[known]), np.searchsorted(levels_x, x[known]))
    np.add.at(total, index, values[known])
    np.add.at(count, index, 1.0)
    with np.errstate(invalid="ignore"):
        return levels_x, levels_y, total / count


def names_in_cells(x: Array, y: Array, names: npt.NDArray[np.str_]) -> tuple[tuple[str, ...], ...]:
    """Name of the first point in each cell of `lay_out` (m, n); empty where there is none."""
    levels_x, levels_y = np.unique(x), np.unique(y)
    found = [[""] * len(levels_x) for _ in levels_y]
    rows, columns = np.searchsorted(levels_y, y), np.searchsorted(levels_x, x)
    for row, column, name in zip(rows, columns, names, strict=True):
        found[row][column] = found[row][column] or str(name)
    return tuple(tuple(row) for row in found)


def iso_levels(z: Array, lines: int = 6) -> tuple[float, ...]:
    """Round levels for about so many lines of equal value."""
    known = z[np.isfinite(z)]
    if len(known) < 2 or not np.ptp(known):
        return ()
    step = float(np.ptp(known)) / lines
    power = 10.0 ** np.floor(np.log10(step))
    step = next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= step * (1.0 - 1e-9))
    first, last = np.ceil(known.min() / step), np.floor(known.max() / step)
    return tuple(float(f"{level:.6g}") for level in np.arange(first, last + 1.0) * step)


def names_of(names: npt.NDArray[np.str_]) -> tuple[str, ...]:
    """Names of points as plain text."""
    return tuple(map(str, names))


def in_relief(maps: Figure, caption: str) -> tuple[Figure, ...]:
    """The maps of a figure once more, as surfaces; none where a surface would have a single row or column."""
    panels = [panel for panel in maps.panels if isinstance(panel, SpeedMap) and min(panel.z.shape) > 1]
    raised = tuple(replace(panel, relief=True, annotate=False, contours=()) for panel in panels)
    if not raised:
        return ()
    return (Figure(f"{maps.id}-surface", f"{maps.title}, in three dimensions", caption, raised, columns=maps.columns),)
