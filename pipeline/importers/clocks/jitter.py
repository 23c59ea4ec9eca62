"""Jitter of a clock read by the signals: even samples with scattered stamps, or samples taken at those times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

REACH = 4
"""Samples on either side over which the slope of a signal is taken."""

LONGEST_JITTER = 6.0
"""Samples of jitter beyond which a row does not take part in the decision: the slope there tells nothing."""

JUDGED = 1_000_000
"""Rows that decide between the readings, at most."""

BLOCK = 50
"""Rows of a block; what disturbs the signals may hang together within one."""

SURE_OF_READING = 3.0
"""Standard errors by which the decision between the readings must stand."""

FOURTH = (1.0, -4.0, 6.0, -4.0, 1.0)
"""Weights of the fourth difference, which leaves next to nothing of a smooth signal."""

MOST_NOISE = 0.25
"""Part of the power of a slope that may be noise where a signal takes part in the decision."""

NEAREST = 0.25
"""Distance of two samples below which their mean is taken before a spline is laid through them [samples]."""


AT_ONCE, BESIDE = 200_000, 64
"""Places that are interpolated at once, and samples beside them that the spline runs on; it forgets within a few."""


@dataclass(frozen=True)
class Reading:
    """The decision between two readings of jitter.

    Parameters
    ----------
    share : float
        Part of the jitter that the signals follow [1]: 0 for even samples, 1 for samples taken at the stamped times.
        It makes the high-frequency power of the signals least.
    error : float
        Standard error of it [1]; infinite where the signals tell nothing.
    """

    share: float
    error: float

    @property
    def taken(self) -> bool:
        """Whether the samples clearly were taken at those times."""
        return self.clear and 0.5 < self.share < 1.5

    @property
    def clear(self) -> bool:
        """Whether the signals decide; a share far from both readings is neither."""
        return -0.5 < self.share < 1.5 and abs(self.share - 0.5) > SURE_OF_READING * self.error


def reading_of(jitter: Array, broken: Mask, signals: Iterable[npt.NDArray[Any]]) -> Reading:
    """The reading of jitter under which the signals are smoothest.

    Parameters
    ----------
    jitter : (n,) array
        Time stamp of each row less its even place [samples].
    broken : (n - 1,) array of bool
        Steps in which samples are missing.
    signals : iterable of (n,) array
        Channels, in any units.

    Notes
    -----
    A sample taken :math:`e_k` late differs by :math:`\\dot y e_k` from the even one. The fourth difference of a signal
    is regressed on the slope times that of the jitter: the coefficient is the share at which the high-frequency power
    is least. The slope comes from samples outside the difference, so that noise does not pull the share. The error is
    that of sums over blocks, which stay right where noise is coloured or unequal. Holds for signals that are smooth
    over a few samples.
    """
    jitter, broken = jitter[:JUDGED], broken[: max(min(len(jitter), JUDGED) - 1, 0)]
    if len(jitter) < 2 * BLOCK:
        return Reading(0.0, np.inf)
    inner = slice(REACH, -REACH)
    near = maximum_filter1d(np.append(broken, False).astype(np.uint8), 2 * REACH + 1, mode="nearest")
    bent = np.convolve(jitter, FOURTH, "same")[inner]
    use = (near[inner] == 0) & (np.abs(bent) < LONGEST_JITTER * np.sqrt(np.square(FOURTH).sum()))
    power_of_differences = float(np.square(FOURTH).sum())
    if use.sum() < 2 * BLOCK:
        return Reading(0.0, np.inf)
    scores, weight, pairs = np.zeros(len(bent) // BLOCK + 1), 0.0, []
    for values in signals:
        values = np.asarray(values[:JUDGED], dtype=np.float64)
        slope = (values[2 * REACH :] - values[: -2 * REACH]) / (2.0 * REACH)
        moved, rough = slope * bent, np.convolve(values, FOURTH, "same")[inner]
        good = use & np.isfinite(moved) & np.isfinite(rough)
        moved, rough = np.where(good, moved, 0.0), np.where(good, rough, 0.0)
        power = float(moved @ moved)
        if not power > 0.0:
            continue
        own = float(moved @ rough) / power
        rest = float(np.mean((rough - own * moved) ** 2)) + 1e-12 * power / len(moved)
        noise = 2.0 * rest / power_of_differences / (2.0 * REACH) ** 2
        if noise > MOST_NOISE * float(np.mean(slope[good] ** 2)):
            continue
        pairs.append((moved / np.sqrt(rest), rough / np.sqrt(rest)))
        weight += power / rest
    if not pairs:
        return Reading(0.0, np.inf)
    share = sum(float(moved @ rough) for moved, rough in pairs) / weight
    blocks = np.arange(len(bent)) // BLOCK
    for moved, rough in pairs:
        scores += np.bincount(blocks, moved * (rough - share * moved), len(scores))
    return Reading(float(share), float(np.linalg.norm(scores) / weight))


def resampled(places: Array, values: npt.NDArray[Any], length: int) -> Array:
    """A signal on whole places (length,), by a cubic spline.

    Parameters
    ----------
    places : (n,) array
        Where it was sampled [samples]; samples closer than `NEAREST` are averaged first.
    values : (n,) array
        Finite, in any unit.
    length : int
        Number of places, from 0 on.
    """
    order = np.argsort(places, kind="stable")
    at, value = places[order], np.asarray(values, dtype=np.float64)[order]
    group = np.flatnonzero(np.diff(at, prepend=-np.inf) >= NEAREST)
    if len(group) < len(at):
        count = np.diff(np.append(group, len(at)))
        at, value = np.add.reduceat(at, group) / count, np.add.reduceat(value, group) / count
    if len(at) < 2:
        return np.full(length, value[0])
    whole = np.empty(length)
    for low in range(0, length, AT_ONCE):
        high = min(low + AT_ONCE, length)
        first, last = np.searchsorted(at, (low, high))
        part = slice(max(int(first) - BESIDE, 0), int(last) + BESIDE)
        whole[low:high] = CubicSpline(at[part], value[part])(np.clip(np.arange(low, high), at[0], at[-1]))
    return whole
