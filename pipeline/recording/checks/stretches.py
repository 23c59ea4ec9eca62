"""Stretches of samples that share a fault, each reported as a finding with its range."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, Unpack

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

    from pmg.pipeline.recording.codes import Code
    from pmg.pipeline.recording.findings import Extent
    from pmg.sim.signals import Mask

PIECE = 1 << 15
"""Samples that are worked on at once."""

LISTED_STRETCHES = 8
"""Stretches of one fault in one channel that are reported one by one; the others are reported together."""


NAMED_FAULTS = 8
"""Faults of one kind that are named one by one."""


class Say(Protocol):
    """`Findings.error`, `Findings.warning` or `Findings.info`."""

    def __call__(self, code: Code, where: str, message: str, do: str, **extent: Unpack[Extent]) -> None:
        """Add a finding."""


def pieces(length: int) -> Iterator[slice]:
    """Parts of so many samples one after another: what is made of each on the way then takes little memory."""
    for start in range(0, length, PIECE):
        yield slice(start, min(start + PIECE, length))


def stretches(mask: Mask) -> npt.NDArray[np.int64]:
    """First place and place after the last of each run of true, (k, 2)."""
    turns = np.flatnonzero(mask[1:] != mask[:-1]) + 1
    before, after = (0,) * bool(len(mask) and mask[0]), (len(mask),) * bool(len(mask) and mask[-1])
    return np.concatenate((before, turns, after)).astype(np.int64).reshape(-1, 2)


def joined(found: npt.NDArray[np.int64], apart: int) -> npt.NDArray[np.int64]:
    """Stretches, (k, 2), with those less than so many samples apart made one."""
    if len(found) < 2:
        return found
    new = np.concatenate(([True], found[1:, 0] - found[:-1, 1] >= apart))
    last = np.append(np.flatnonzero(new)[1:] - 1, len(found) - 1)
    return np.column_stack((found[new, 0], found[last, 1]))


def tell_stretches(
    say: Say,
    code: Code,
    topic: str,
    found: npt.NDArray[np.int64],
    words: tuple[str, str, str],
    *,
    kept: str = "",
    lost: str = "",
) -> None:
    """Tell each stretch with its range; from `LISTED_STRETCHES` on, the rest in one finding.

    Parameters
    ----------
    say : callable
        Receives the findings.
    code : Code
        What is wrong.
    topic : str
        Channel.
    found : (k, 2) array of int
        Sample indices, the end left out.
    words : (str, str, str)
        What the samples are or do, what was expected, what to do.
    kept, lost : str
        What is used all the same, and what is not; ``{n}`` stands for the number of samples.
    """
    what, expected, do = words
    listed = found if len(found) <= LISTED_STRETCHES else found[: LISTED_STRETCHES - 1]
    for start, stop in listed.tolist():
        n = stop - start
        message = f"{n} samples from {start} on {what}; expected {expected}"
        extent = {"kept": kept.format(n=n), "lost": lost.format(n=n)}
        say(code, topic, message, do, sample_range=(start, stop), **extent)  # type: ignore[arg-type]
    rest = found[len(listed) :]
    if len(rest):
        n = int((rest[:, 1] - rest[:, 0]).sum())
        start, stop = int(rest[0, 0]), int(rest[-1, 1])
        message = f"{n} samples in {len(rest)} more places from {start} on {what}; expected {expected}"
        say(code, topic, message, do, sample_range=(start, stop), kept=kept.format(n=n), lost=lost.format(n=n))
