"""Evidence: whitened rows, what they may follow, and synthetic noise to judge them by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Mask


@dataclass(frozen=True)
class Evidence:
    """m whitened rows of a campaign or a record, their noise of unit standard deviation.

    Parameters
    ----------
    y : (m,) array
        Measured less predicted.
    baseline : (m, k) array
        Columns that the baseline may absorb.
    families : list of (m, c) array
        Columns of each kind of structure that is looked for.
    groups : tuple of (m,) array of bool
        Rows whose scatter is estimated together, as those of one transducer; every row is in one of them.
    null : (m, draws) array
        Synthetic noise: what the rows would be without any mismatch.
    contrasts : tuple of (m, r) array
        Orthonormal differences between repeated rows, group by group; none where nothing was repeated.
    narrow : int
        How many of the last families are looked at one by one, the scatter judged with them in it.
    single_rows : bool
        Whether a row may stand out by itself.
    positive : frozenset of int
        Places of families of one column whose size cannot be negative.
    excluded : (m, c) array, optional
        Columns excluded from the estimate of the scatter: rows may hold more than noise there without any mismatch.
    """

    y: Array
    baseline: Array
    families: list[Array]
    groups: tuple[Mask, ...]
    null: Array
    contrasts: tuple[Array, ...] = ()
    narrow: int = 0
    single_rows: bool = False
    positive: frozenset[int] = frozenset()
    excluded: Array | None = None
