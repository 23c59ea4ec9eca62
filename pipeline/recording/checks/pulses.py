"""Index pulses: whether every turn gave one, and whether the encoder kept its count."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.checks.slips import find_slips
from pmg.pipeline.recording.checks.stretches import NAMED_FAULTS
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.layouts.wire import IndexPulse

    Counts = npt.NDArray[np.int64]
    Floats = npt.NDArray[np.float64]

TOLERANCE = 2
"""Counts by which two index pulses may disagree, besides those of one sample in which the latch may fall."""
NEIGHBOURS = 2
"""Samples on each side of a pulse from which the speed there is taken."""
LARGEST_SURPLUS = 0.25
"""A pulse that comes within this part of a turn after another, without a reversal, is one too many."""


def check_pulses(
    topic: str,
    side: str,
    count: Counts,
    at: Counts,
    bits: int,
    counts_per_rev: int,
    pulses: Sequence[IndexPulse],
    findings: Findings,
) -> list[tuple[int, int]]:
    """Where the encoder lost or caught counts, as sample ranges; pulses that are missing or too many are reported.

    Parameters
    ----------
    topic, side : str
        Encoder channel, and the shaft.
    count : (n,) array of int
        Count without wraps.
    at : (n,) array of int
        Sample index of each.
    bits, counts_per_rev : int
        Width of the counter, and its counts in one turn.
    pulses : sequence of IndexPulse
        Counts latched at the index.
    findings : Findings
        Receives what is wrong.

    Notes
    -----
    The latch belongs to the sample in which the pulse fell, so the place within the turn is known to the counts of
    one sample. A pulse elsewhere than the ones before it, after which the next ones stay there, is a slip
    (`find_slips`); a single pulse elsewhere is one too many. Between pulses that are kept, each whole turn
    beyond the first is a pulse missing. A slip by whole turns cannot be distinguished from missing pulses.
    """
    inside = sorted((p for p in pulses if len(at) and at[0] <= p.sample <= at[-1]), key=lambda p: p.sample)
    if len(inside) < 2:
        return []
    sample = np.array([p.sample for p in inside], dtype=np.int64)
    place = np.clip(np.searchsorted(at, sample), 0, len(at) - 1)
    shift = 64 - bits
    latched = count[place] + (((np.array([p.count for p in inside], dtype=np.int64) - count[place]) << shift) >> shift)
    low, high = np.maximum(place - NEIGHBOURS, 0), np.minimum(place + NEIGHBOURS, len(at) - 1)
    steps = np.diff(count) / np.diff(at)
    speed = np.array([np.median(steps[a:b]) if b > a else 0.0 for a, b in zip(low, high, strict=True)])
    surplus = _surplus(latched, speed, counts_per_rev)
    if surplus.any():
        _tell(
            findings,
            Code.INDEX_SURPLUS,
            f"/daq/encoder_{side}/index",
            [
                (s, s + 1, f"the pulse at sample {s} comes at another place of the turn, or twice")
                for s in sample[surplus]
            ],
            ("expected one pulse at one place of each turn", f"Check the {side} encoder's index line for noise."),
            "the other pulses",
        )
    kept = ~surplus
    sample, latched, speed = sample[kept], latched[kept], speed[kept]
    if len(sample) < 2:
        return []
    moved = np.diff(latched)
    off = _residue(moved, counts_per_rev)
    slipped = np.abs(off) > _slack(speed[1:], speed[:-1])
    turns = np.abs(np.rint((moved - off) / counts_per_rev)).astype(np.int64)
    _tell_missing(side, sample, turns, slipped, (at, count, latched, speed), counts_per_rev, findings)
    place_in_turn = np.concatenate(([0.0], np.cumsum(off)))
    slips = find_slips(place_in_turn, speed)
    ranges = [(int(sample[before]), int(sample[after]) + 1) for before, after, _ in slips]
    lines = [
        (*ends, f"between samples {ends[0]} and {ends[1] - 1} the count slips by {size:+.0f}")
        for ends, (_, _, size) in zip(ranges, slips, strict=True)
    ]
    do = f"The {side} encoder lost or caught counts: check its cable, shield and coupling."
    words = ("expected the same place in each revolution. Windows over it are rejected", do)
    _tell(findings, Code.ENCODER_SLIPPED, topic, lines, words, "the speed outside of it")
    return ranges


def _slack(one: Any, other: Any) -> Any:  # noqa: ANN401 (numbers or arrays of them)
    """Counts by which the places of two pulses may differ at those speeds [counts per sample].

    Turning one way, both latches lie behind the index by up to the counts of one sample; after a reversal they lie on
    both sides of it.
    """
    a, b = np.abs(one), np.abs(other)
    return TOLERANCE + np.where(one * other >= 0.0, np.maximum(a, b), a + b)


def _surplus(latched: Counts, speed: Floats, counts_per_rev: int) -> npt.NDArray[np.bool_]:
    """Pulses that stand alone within a turn whose both ends have theirs, or repeat the one before."""
    n = len(latched)
    surplus = np.zeros(n, dtype=np.bool_)
    kept = 0
    for k in range(1, n):
        limit = _slack(speed[k], speed[kept])
        elsewhere = abs(_one(latched[k] - latched[kept], counts_per_rev)) > limit
        if elsewhere and k + 1 < n:
            back = _slack(speed[k + 1], speed[kept])
            around = int(latched[k + 1] - latched[kept])
            surplus[k] = abs(_one(around, counts_per_rev)) <= back and abs(around) < 1.5 * counts_per_rev
        elif not elsewhere and abs(int(latched[k] - latched[kept])) <= limit and kept:
            before = int(latched[kept] - latched[kept - 1])
            after = int(latched[k + 1] - latched[k]) if k + 1 < n else before
            surplus[k] = before * after > 0 and abs(before) > LARGEST_SURPLUS * counts_per_rev
        if not surplus[k]:
            kept = k
    return surplus


def _one(moved: int, counts_per_rev: int) -> int:
    half = counts_per_rev // 2
    return (int(moved) + half) % counts_per_rev - half


def _residue(moved: Counts, counts_per_rev: int) -> Counts:
    """Remainder of a distance beyond whole turns, to the nearer side."""
    half = counts_per_rev // 2
    return np.asarray((moved + half) % counts_per_rev - half)


def _tell_missing(
    side: str,
    sample: Counts,
    turns: Counts,
    slipped: npt.NDArray[np.bool_],
    track: tuple[Counts, Counts, Counts, Floats],
    counts_per_rev: int,
    findings: Findings,
) -> None:
    """Turns without a pulse: between pulses, before the first and after the last."""
    at, count, latched, speed = track
    lines = [
        (int(sample[k]), int(sample[k + 1]) + 1, f"{int(turns[k]) - 1} pulses are missing after sample {sample[k]}")
        for k in np.flatnonzero((turns > 1) & ~slipped)
    ]
    ends = (
        (int(at[0]), int(sample[0]) + 1, count[at <= sample[0]] - latched[0], speed[0]),
        (int(sample[-1]), int(at[-1]) + 1, count[at >= sample[-1]] - latched[-1], speed[-1]),
    )
    for start, stop, away, near in ends:
        turned = int((np.max(np.abs(away), initial=0) - _slack(near, near)) // counts_per_rev)
        if turned > 0:
            lines.append((start, stop, f"{turned} pulses are missing from sample {start} on"))
    words = ("expected one in each turn", f"Check the {side} encoder's index line.")
    _tell(findings, Code.INDEX_MISSING, f"/daq/encoder_{side}/index", sorted(lines), words, "the count")


def _tell(
    findings: Findings,
    code: Code,
    where: str,
    faults: list[tuple[int, int, str]],
    words: tuple[str, str],
    kept: str,
) -> None:
    expected, do = words
    for start, stop, what in faults[:NAMED_FAULTS]:
        findings.warning(code, where, f"{what}; {expected}", do, sample_range=(int(start), int(stop)), kept=kept)
    rest = faults[NAMED_FAULTS:]
    if rest:
        what = f"the same in {len(rest)} more places, the first: {rest[0][2]}"
        ends = int(rest[0][0]), int(rest[-1][1])
        findings.warning(code, where, f"{what}; {expected}", do, sample_range=ends, kept=kept)
