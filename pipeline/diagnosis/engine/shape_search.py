"""The shape of a law that explains most: between those at which its columns are known, and from several of them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.signals import Array

PARTS, TRIED = 1024, 12
"""Parts of two steps of the grid between which the best shape is taken, and shapes tried on the way to it at most."""

UNEVEN = 4
"""Distance to the known shape on one side, over that on the other, up to which a parabola joins all three."""

NEAR = 128
"""Parts up to which the neighbours of the best must have come near for no other to be tried."""

WORTH = 0.05
"""Gain [noise variances] that another shape must promise to be tried."""

BETWEEN, HILLS, FEWEST_TABLED = 8, 2, 4
"""Shapes from one that is tabled to the next at which columns are read off a spline, hills that are climbed at most,
and tabled shapes from which on there is a spline."""


def best_shape(
    gain_of: Callable[[float], float],
    shapes: Array,
    gains: Array,
    start: float,
    *,
    even: bool = False,
) -> tuple[float, float]:
    """The shape about a start that explains most, between its neighbours on the grid, and its gain.

    Parameters
    ----------
    gain_of : callable
        Gain at a shape.
    shapes, gains : (g,) array
        Grid of shapes, and the gain at each.
    start : float
        A shape inside the grid.
    even : bool
        Whether the grid is even in 1/shape; otherwise in its logarithm.

    Notes
    -----
    Vertices of parabolas through the best three.
    """
    turn: Callable[[float], float] = (lambda x: 1.0 / x) if even else math.exp
    back: Callable[[float], float] = (lambda s: 1.0 / s) if even else math.log
    nearest = int(np.argmin([abs(back(float(shape)) - back(start)) for shape in shapes]))
    ends = max(nearest - 1, 0), min(nearest + 1, len(shapes) - 1)
    first, last = (back(float(shapes[k])) for k in ends)
    if first == last:
        return float(shapes[nearest]), float(gains[nearest])

    def shape_at(part: int) -> float:
        return turn(first + (last - first) * part / PARTS)

    def part_of(shape: float) -> int:
        return round(PARTS * (back(shape) - first) / (last - first))

    middle = part_of(float(shapes[nearest]))
    if ends[0] < nearest < ends[1]:
        middle = min(max(middle, 1), PARTS - 1)
    known = {middle: float(gains[nearest])}
    known |= {part: float(gains[end]) for part, end in zip((0, PARTS), ends, strict=True) if part != middle}
    if len(known) < 3:  # the start is at an end of the grid
        known[PARTS // 2] = gain_of(shape_at(PARTS // 2))
    tried = part_of(start)
    for _ in range(TRIED):
        if tried in known:
            tried = _next_part(known)
        if tried in known:
            break
        known[tried] = gain_of(shape_at(tried))
    now = max(known, key=lambda part: known[part])
    return float(shapes[nearest]) if now == middle else shape_at(now), known[now]


def _next_part(known: dict[int, float]) -> int:
    """Where the parabola through the best known value and its neighbours is highest; a known one where it is enough."""
    parts, now = sorted(known), max(known, key=lambda part: known[part])
    at = parts.index(now)
    low, high = parts[max(at - 1, 0)], parts[min(at + 1, len(parts) - 1)]
    if now in (low, high):  # an end is best so far: halve what is next to it
        return (low + high) // 2
    left, right = now - low, high - now
    if left > UNEVEN * right:  # a parabola over such a gap is far from the gains
        return now - 2 * right
    if right > UNEVEN * left:
        return now + 2 * left
    fall_left, fall_right = known[now] - known[low], known[now] - known[high]
    bend = right * fall_left + left * fall_right
    if bend <= 0.0:  # three of one height
        return now
    away = 0.5 * (right**2 * fall_left - left**2 * fall_right) / bend
    higher = away**2 * bend / (left * right * (left + right))
    if higher > WORTH and abs(away) >= 0.5:
        return min(max(round(now + away), low + 1), high - 1)
    if max(left, right) <= NEAR:
        return now
    return now + right // 4 if right > left else now - left // 4


def hills(columns: Array, left: Array, shapes: Array) -> list[tuple[float, float]]:
    """Shapes at which a law of known size explains more than about them, the highest first, each with its gain.

    Parameters
    ----------
    columns : (m, g) array
        Of the law at each tabled shape.
    left : (m,) array
        What is to be explained.
    shapes : (g,) array
        Grid, even in the logarithm.

    Notes
    -----
    A delay that is too long explains less than none. Where the effect is far above the noise, the peak of the gain at
    the true delay is narrower than a step of the grid; a second peak is where the constants explain most of it.
    Columns change smoothly from one tabled shape to the next, so that a cubic spline interpolates them.
    """
    if len(shapes) < FEWEST_TABLED:
        return []
    fine, weights = _spline(tuple(shapes.tolist()))
    gains = 2.0 * weights @ (columns.T @ left) - np.einsum("fg,gh,fh->f", weights, columns.T @ columns, weights)
    around = np.pad(gains, 1, constant_values=-np.inf)
    tops = np.flatnonzero((gains >= around[:-2]) & (gains > around[2:]))
    highest = tops[np.argsort(-gains[tops])][:HILLS]
    return [(float(fine[k]), float(gains[k])) for k in highest]


@lru_cache(maxsize=16)
def _spline(shapes: tuple[float, ...]) -> tuple[Array, Array]:
    """Shapes (f,) between those tabled, and what each tabled column weighs there (f, g)."""
    places = np.arange(len(shapes), dtype=np.float64)
    fine = np.linspace(0.0, places[-1], BETWEEN * (len(shapes) - 1) + 1)
    at = np.exp(np.interp(fine, places, np.log(shapes)))
    return at, np.asarray(CubicSpline(places, np.eye(len(shapes)))(fine))
