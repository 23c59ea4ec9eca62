"""Errors on rows that took no part in a fit, and how much of their fall is chance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.fit.span import lengths

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

RESAMPLES = 2000
"""Bootstrap resamples of the blocks."""

WITHHELD_SHARE = 0.9
"""Part of the withheld mismatch, in squares beyond the noise, that a candidate must predict to be named."""

SHOWN = 0.25
"""Part of the fall of squares on the rows of the fit that withheld rows must show, where the mismatch is lost in their
noise, for a cause to be borne out."""

BY_CHANCE = 2.0
"""Standard errors of the noise by which what is left may exceed the share that a candidate must predict."""


LEAST_SIZE = 1e-8
"""Size of a direction of the columns, over the largest, below which it counts as none."""


@dataclass(frozen=True)
class HeldOut:
    """Errors on rows that took no part in the fit, in their own unit (N m, or N).

    Parameters
    ----------
    split : str
        What was withheld, in words.
    rmse_before, rmse_after : float
        Of the baseline, and of the baseline with the located structure or the named candidates.
    noise_floor : float
        Noise of the same rows.
    gain_interval : tuple of float
        95 % interval of `rmse_before` - `rmse_after`, from resampled blocks.
    placebo_gain : float or None
        The same difference for a placebo: what was found, shuffled over the rows; it should gain nothing.
    expected_before, expected_after : float or None
        Error that noise alone would give: noise of the rows and, with it, of the fits that predict them.
    count : int
        Rows that were looked at.
    for_one : float
        Rows that tell a mean of squares as well as one whose noise is its own.
    kept : float
        Part of the choices made without a part of the rows that agree with the choice on all of them.
    in_every_part : frozenset of str
        Ids that are chosen whichever part is withheld.
    elsewhere : tuple of tuple of candidates
        Where too few agree: the sets that were chosen instead, most frequent first.
    fall : float
        Fall of the sum of squares of the rows that were looked at, each in its noise.
    of_a_kind : bool
        Whether rows of the same kind stayed among those of the fit: too easy a proof for what leaves more than noise.
    """

    split: str
    rmse_before: float
    rmse_after: float
    noise_floor: float
    gain_interval: tuple[float, float]
    placebo_gain: float | None = None
    expected_before: float | None = None
    expected_after: float | None = None
    count: int = 0
    for_one: float = 1.0
    kept: float = 1.0
    in_every_part: frozenset[str] = frozenset()
    elsewhere: tuple[tuple[Any, ...], ...] = ()
    fall: float = 0.0
    of_a_kind: bool = False

    def document(self, unit: str) -> dict[str, Any]:
        """Split, errors before and after, noise and interval as JSON."""
        return {
            "split": self.split,
            f"rmse_before_{unit}": self.rmse_before,
            f"rmse_after_{unit}": self.rmse_after,
            f"noise_floor_{unit}": self.noise_floor,
            f"gain_interval_{unit}": list(self.gain_interval),
        }

    @property
    def predicts(self) -> bool:
        r"""Whether what was named predicts most of the mismatch of withheld rows.

        Notes
        -----
        Mean squares beyond what noise alone gives, that of the predicting fits included, are compared. What is left
        after may exceed its share by `BY_CHANCE` standard errors of a mean square of noise,
        :math:`s^2\sqrt{2k/n}` where `k` rows count for one.
        """
        before, after = self._beyond_noise
        assert self.expected_after is not None
        chance = self._chance(self.expected_after)
        return self.rmse_after < self.rmse_before and after <= (1.0 - WITHHELD_SHARE) * before + chance

    @property
    def tells(self) -> bool:
        """Whether withheld rows show the mismatch at all: what they have beyond the noise is more than chance."""
        before, _ = self._beyond_noise
        assert self.expected_before is not None
        return before > self._chance(self.expected_before)

    def shows(self, gain: float) -> bool:
        """Whether withheld rows show at least a part of the gain on the rows of the fit, or the mismatch plainly.

        Where it was not chosen each time, some of the rest does not show it, and cannot be held against it.
        """
        return self.fall >= SHOWN * gain or (self.tells and self.kept == 1.0)

    def _chance(self, expected: float) -> float:
        """`BY_CHANCE` standard errors of the mean square of noise."""
        return BY_CHANCE * expected**2 * math.sqrt(2.0 * self.for_one / self.count)

    @property
    def left(self) -> float:
        """Part of the mismatch of withheld rows, in squares beyond the noise, that is not predicted."""
        before, after = self._beyond_noise
        return after / before if before > 0.0 else math.inf

    @property
    def _beyond_noise(self) -> tuple[float, float]:
        """Mean squares before and after, less what noise alone gives."""
        assert self.expected_before is not None
        assert self.expected_after is not None
        return self.rmse_before**2 - self.expected_before**2, self.rmse_after**2 - self.expected_after**2


def change_words(held: HeldOut, digits: int) -> str:
    """How an error of torques on withheld rows changes, in mN m, to go on after 'the error'."""
    before, after = (f"{1e3 * rmse:.{digits}f}" for rmse in (held.rmse_before, held.rmse_after))
    low, high = held.gain_interval
    if before == after:
        return f"{'hardly drops' if low > 0.0 else 'does not drop'} ({before} mN m)"
    change = "drops" if low > 0.0 else "rises" if high < 0.0 else "does not clearly drop:"
    return f"{change} from {before} to {after} mN m"


def compared(
    split: str,
    errors: tuple[Array, Array],
    noise: Array,
    rows: tuple[npt.NDArray[np.int64], Mask],
    rng: np.random.Generator,
) -> HeldOut:
    """Two errors of each withheld row (m,) compared over what is looked at; `rows` are blocks, and whether they are."""
    block, touched = rows
    squares = errors[0] ** 2, errors[1] ** 2
    before, after, floor = (math.sqrt(float(of_rows[touched].mean())) for of_rows in (*squares, noise**2))
    gain = gain_interval(*squares, touched_blocks(block, touched), rng)
    fall = float(np.sum((squares[0] - squares[1])[touched] / noise[touched] ** 2))
    return HeldOut(split, before, after, floor, gain, count=int(touched.sum()), fall=fall)


def touched_blocks(block: npt.NDArray[np.int64], touched: Mask) -> list[npt.NDArray[np.intp]]:
    """Rows of each block that are looked at; blocks without any are left out."""
    return [np.flatnonzero((block == k) & touched) for k in np.unique(block[touched])]


def gain_interval(
    before: Array, after: Array, blocks: list[npt.NDArray[np.intp]], rng: np.random.Generator
) -> tuple[float, float]:
    """95 % interval of the fall of the error from squared errors, blocks resampled with replacement."""
    drawn = rng.integers(len(blocks), size=(RESAMPLES, len(blocks)))
    sums = np.array([[len(rows), before[rows].sum(), after[rows].sum()] for rows in blocks])
    count, *squares = sums[drawn].sum(axis=1).T
    gains = np.sqrt(squares[0] / count) - np.sqrt(squares[1] / count)
    low, high = np.quantile(gains, [0.025, 0.975])
    return float(low), float(high)


def solve(design: Array, y: Array, length: Array | None = None) -> Array:
    """Least squares, columns first divided by `length` or their own; what rows do not determine stays at zero."""
    unit = lengths(design) if length is None else length
    return np.asarray(np.linalg.lstsq(design / unit, y, rcond=LEAST_SIZE)[0] / unit)


def unpredicted(y: Array, columns: Array, scale: Array, train: Mask, spread: Array | None = None) -> Array:
    """Rows (m,) less what the training rows, weighted by their scale, determine of some columns (m, k).

    `spread` is as in `training_rows`.
    """
    design = training_rows(columns, scale, train, spread)
    seen = np.zeros(len(design))
    seen[: int(train.sum())] = y[train] / scale[train]
    return np.asarray(y - columns @ solve(design, seen, lengths(columns / scale[:, None])))


def training_rows(columns: Array, scale: Array, train: Mask, spread: Array | None = None) -> Array:
    """Weighted training rows of some columns, and below them one for each coefficient that is known beforehand.

    `spread` (k,) is the standard deviation of each coefficient about zero before anything is seen; infinite where not
    known.
    """
    rows = columns[train] / scale[train, None]
    if spread is None:
        return np.asarray(rows)
    return np.vstack([rows, np.diag(1.0 / spread)[np.isfinite(spread)]])


def withheld_left(
    y: Array, columns: Array | Sequence[Array], scale: Array, fold: npt.NDArray[np.int64], folds: int
) -> Array:
    """Rows less what the other folds determine of some columns, or of those of each fold; as they are in no fold."""
    left = y.copy()
    for k in range(folds):
        own = columns if isinstance(columns, np.ndarray) else columns[k]
        left[fold == k] = unpredicted(y, own, scale, fold != k)[fold == k]
    return left
