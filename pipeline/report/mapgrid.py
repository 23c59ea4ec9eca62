"""Parts common to the drawings of a map: borders of its cells, scale of its colours, lines and lettering."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import matplotlib
import numpy as np

from pmg.pipeline.wording import numerals

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

    from pmg.pipeline.report.figure import SpeedMap
    from pmg.sim.signals import Array

    Masked: TypeAlias = np.ma.MaskedArray[tuple[Any, ...], np.dtype[np.float64]]

SHADES = 47
"""Shades of a scale; an odd number has a neutral middle."""
VIEW = (26.0, -125.0)
"""Elevation and azimuth from which a surface is seen [degrees]."""
HATCHING = "#5a5a5a"
"""Colour of the strokes; cells keep their colours on a dark page, so they do as well."""

_DARK, _LIGHT = "#14181c", "#fffffe"
"""Text inside cells: colours of no role, so that they stay on a dark page."""


def known(chart: SpeedMap) -> Masked:
    """The values, with what is not finite masked."""
    return np.ma.masked_invalid(np.asarray(chart.z, dtype=np.float64))


def edges(centres: Array) -> Array:
    """Borders between cells: half way to the neighbour, and as far beyond the outermost centres."""
    values = np.asarray(centres, dtype=np.float64)
    if len(values) == 1:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    middle = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


def limits(z: Masked, diverging: bool) -> tuple[float, float]:
    """Ends of the colour scale; symmetric where zero is its middle, and never of no width."""
    values = z.compressed()
    if not len(values):
        return -1.0, 1.0
    if diverging:
        reach = float(np.abs(values).max()) or 1.0
        return -reach, reach
    low, high = float(values.min()), float(values.max())
    return (low, high) if high > low else (low - (abs(low) or 1.0) / 2, low + (abs(low) or 1.0) / 2)


def shades(diverging: bool) -> Colormap:
    """The colours of a scale."""
    return matplotlib.colormaps["RdBu_r" if diverging else "viridis"].resampled(SHADES)


def levels(chart: SpeedMap, z: Masked) -> list[float]:
    """Levels of lines of equal value that the measured values reach."""
    values = z.compressed()
    if min(z.shape) < 2 or not len(values):
        return []
    return sorted(level for level in set(chart.contours) if values.min() < level < values.max())


def hatched(chart: SpeedMap, z: Masked) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Cells to be hatched: of those with a value."""
    if chart.hatch is None:
        return np.zeros(z.shape, dtype=bool)
    return np.asarray(chart.hatch & ~np.ma.getmaskarray(z))


def lettering(z: Masked) -> dict[tuple[int, int], str]:
    """Each value as it stands in its cell, all with the same digits."""
    values = z.compressed()
    if not len(values):
        return {}
    digits = max(0, 1 - int(np.floor(np.log10(np.abs(values).max() or 1.0))))
    return {(int(r), int(c)): numerals.number(float(z[r, c]), digits) for r, c in np.argwhere(~np.ma.getmaskarray(z))}


def against(rgb: tuple[float, float, float]) -> str:
    """Dark or light lettering, whichever stands out more from a colour."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in rgb]
    luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    return _LIGHT if luminance < 0.18 else _DARK
