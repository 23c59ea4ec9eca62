"""Counters of any width that wrap: the count without wraps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

RATE_NEIGHBOURS = 64
"""Samples on each side of a gap from which the rate across it is foretold."""
WIDEST = 64
"""Largest width of a counter [bits]."""


def unwrap(
    values: npt.NDArray[Any], at: npt.NDArray[np.int64] | None, bits: int, per_sample: float | None = None
) -> tuple[npt.NDArray[np.int64], int]:
    """Count without wraps, and over how many gaps it is a guess.

    Parameters
    ----------
    values : (n,) array of unsigned int
        Counter readings in ``0 <= value < 2**bits``.
    at : (n,) array of int or None
        Sample index of each, increasing; None where they follow each other without a gap.
    bits : int
        Width of the counter, 1 to 64.
    per_sample : float, optional
        Counts expected per sample. Without it, none between neighbours, and across a gap the mean of the
        rates around it.

    Returns
    -------
    count : (n,) array of int
        Begins with the first reading; each step is the one nearest to the expected step.
    guesses : int
        Gaps around which the rates differ by so much that another number of wraps fits as well.

    Notes
    -----
    A step is only known modulo the counter's range, so it is right while it lies within half the range of
    what is expected. That holds in both directions of rotation.
    """
    count = values.astype(np.int64)
    steps = count[1:] - count[:-1]
    spans = np.ones(0, dtype=np.int64) if at is None else at[1:] - at[:-1]
    gaps = np.flatnonzero(spans > 1)
    raw, spans = steps[gaps], spans[gaps]
    guesses = 0
    if per_sample is not None:
        _to_nearest(steps, np.rint([per_sample]).astype(np.int64), bits)
        steps[gaps] = _to_nearest(raw, np.rint(per_sample * spans).astype(np.int64), bits)
    else:
        _to_nearest(steps, np.zeros(1, dtype=np.int64), bits)
        for place, gap in enumerate(gaps.tolist()):
            before = steps[max(0, gap - RATE_NEIGHBOURS) : gap]
            after = steps[gap + 1 : gap + 1 + RATE_NEIGHBOURS]
            rates = [float(side.mean()) for side in (before, after) if len(side)]
            rate, here = float(np.mean(rates)) if rates else 0.0, slice(place, place + 1)
            steps[gap : gap + 1] = _to_nearest(raw[here], np.rint(rate * spans[here]).astype(np.int64), bits)
            spread = max(rates) - min(rates) if rates else float(1 << bits)
            guesses += bool(spread * float(spans[place]) >= float(1 << bits) / 4)
    np.cumsum(steps, out=count[1:])
    count[1:] += count[:1]
    return count, guesses


def _to_nearest(steps: npt.NDArray[np.int64], expected: npt.NDArray[np.int64], bits: int) -> npt.NDArray[np.int64]:
    """Make each step the congruent one nearest to the expected one: its low bits, with the highest as sign."""
    shift = WIDEST - bits
    steps -= expected
    steps <<= shift
    steps >>= shift
    steps += expected
    return steps
