"""Roots of many scalar equations at once, each inside its own bracket."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.signals import Array

_LONGEST = 200
ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
"""Rounding error of a number of size one."""


def rising_root(
    function: Callable[[Array], tuple[Array, Array]],
    low: Array,
    high: Array,
    start: Array | None = None,
    rounding: Array | float = 0.0,
) -> tuple[Array, Array]:
    """Point in each bracket where a function passes from below zero to above.

    Parameters
    ----------
    function : callable
        Gives values and slopes of all n equations at n abscissae.
    low, high : (n,) array
        Ends of the brackets: not above zero at `low`, not below at `high`.
    start : (n,) array
        First guesses inside the brackets; their middles by default.
    rounding : (n,) array
        Values that cannot be distinguished from zero.

    Returns
    -------
    roots, slopes : (n,) array
        The roots, to a few units in the last place of the larger end of the bracket or within rounding of the
        function, and the slopes there.

    Raises
    ------
    BenchError
        When an equation gives no finite value, or does not settle.

    Notes
    -----
    Newton's step where the slope is positive and the step stays inside the bracket, its middle elsewhere; and the
    middle whenever a step failed to halve the previous one. The bracket keeps its signs, so the root that is found is a
    rising one whatever lies between.
    """
    low, high = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    grain = ROUNDING * np.maximum(np.maximum(np.abs(low), np.abs(high)), np.finfo(np.float64).tiny)
    at, before = 0.5 * (low + high) if start is None else np.array(start, dtype=np.float64), high - low
    for _ in range(_LONGEST):
        value, slope = function(at)
        if not np.isfinite(value).all():
            i = int(np.flatnonzero(~np.isfinite(value))[0])
            raise BenchError(f"equation {i}", f"{value[i]} at {at[i]:.6g}", "a finite value", "Check the parameters.")
        low, high = np.where(value <= 0.0, at, low), np.where(value >= 0.0, at, high)
        close = (high - low <= grain) | (np.abs(value) <= rounding)
        if close.all():
            return at, slope
        newton = at - value / np.where(slope > 0.0, slope, np.inf)
        sound = (slope > 0.0) & (newton >= low) & (newton <= high) & (np.abs(newton - at) <= 0.5 * before)
        following = np.where(close, at, np.where(sound, newton, 0.5 * (low + high)))
        step = np.abs(following - at)
        if bool((close | (sound & (step <= grain))).all()):
            return following, slope
        at, before = following, step
    i = int(np.argmax(high - low))
    raise BenchError(f"equation {i}", f"between {low[i]:.6g} and {high[i]:.6g}", "one root", "Check the parameters.")
