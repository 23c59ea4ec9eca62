"""Coverage of the 95 % interval of a window's mean: ripple of the shaft and noise of many colours."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.recording.means import MEMORY_METHOD
from pmg.pipeline.trials.score.rates import count
from pmg.pipeline.windows.reduce import _reduce_shaft
from pmg.pipeline.windows.revolutions import batch_means
from pmg.sim.signals import REVOLUTION, RPM
from tests.bench.colours import COLOURS, SPAN, Colour, first_order

if TYPE_CHECKING:
    from collections.abc import Callable

SEED = 20261124
RATE, SLOW_RATE, SECONDS = 10_000.0, 1000.0, 5.0
"""Samples a second for noise of first order and for the other colours [Hz]; length of a window [s]."""
TORQUE, NOISE = 1.0, 0.01
RIPPLE = ((1, 0.05), (2, 0.02), (5, 0.01))
"""Orders of the shaft and their amplitudes, as part of the torque."""
SLOWEST, FASTEST = 90.0, 1872.0
"""Speeds that the bench's grids run through [rpm]; each run draws its own."""
COUNTS = 5120
MEMORIES = (0.0, 0.02, 0.1, 0.5)
"""Correlation times [s]."""
LEVEL = 0.95
NORMAL = float(stats.norm.ppf(0.5 + LEVEL / 2.0))


@dataclass(frozen=True)
class Tally:
    """Runs of one noise: whether each interval held the truth, whether the window was flagged.

    Parameters
    ----------
    held, batches, naive : (n,) array of bool
        The truth in the interval of `_reduce_shaft`, of batches alone about the mean of all samples, and of
        s over root n.
    flagged, remembered : (n,) array of bool
        Window flagged; uncertainty taken from the memory of the noise.
    memory, u, half, error : (n,) array
        Correlation time that was found [s], standard uncertainty, half-width of the interval and error of the mean
        [N m].
    """

    held: np.ndarray
    batches: np.ndarray
    naive: np.ndarray
    flagged: np.ndarray
    remembered: np.ndarray
    memory: np.ndarray
    u: np.ndarray
    half: np.ndarray
    error: np.ndarray

    def wide(self) -> float:
        """Mean half-width over that of the interval that who knew the noise would state."""
        return float(self.half.mean() / (NORMAL * np.sqrt(np.mean(self.error**2))))


def window(memory: float | Colour, rng: np.random.Generator, rate: float = RATE) -> tuple[np.ndarray, np.ndarray]:
    """Torque [N m] and angle [rad] of one window: truth, ripple of random phase, noise; by default of first order."""
    n = round(SECONDS * rate)
    speed = rng.uniform(SLOWEST, FASTEST) * RPM
    true = rng.uniform(0.0, REVOLUTION) + speed * np.arange(n) / rate
    counts = REVOLUTION / COUNTS
    noise = (memory.draw if isinstance(memory, Colour) else first_order(memory))(rng, n, rate)
    ripple = sum(part * np.sin(order * true + rng.uniform(0.0, REVOLUTION)) for order, part in RIPPLE)
    return TORQUE * (1.0 + ripple) + NOISE * noise, np.asarray(np.floor(true / counts) * counts, dtype=np.float64)


def tally(memory: float | Colour, runs: int, rate: float = RATE, seed: int = SEED) -> Tally:
    """Windows of one noise, or correlation time [s] of first order, each from its own seed; progress on stderr."""
    rows = []
    own = [*memory.name.encode()] if isinstance(memory, Colour) else [round(1e6 * memory)]
    told = memory.name if isinstance(memory, Colour) else f"correlation time {memory * 1e3:g} ms"
    for run in range(runs):
        torque, angle = window(memory, np.random.default_rng([seed, *own, run]), rate)
        found, plain = _reduce_shaft(torque, angle, rate), batch_means(torque, angle)
        mean, n = float(torque.mean()), len(torque)
        u_batch = math.sqrt(float(plain.means.var(ddof=1)) * plain.length / n)
        reach = [float(stats.t.ppf(0.5 + LEVEL / 2.0, dof)) for dof in (found.dof, len(plain.means) - 1)]
        rows.append(
            (
                abs(found.torque - TORQUE) <= reach[0] * found.within,
                abs(mean - TORQUE) <= reach[1] * u_batch,
                abs(mean - TORQUE) <= 1.96 * found.std / math.sqrt(n),
                found.correlated,
                found.method == MEMORY_METHOD,
                found.correlation_time,
                found.within,
                reach[0] * found.within,
                found.torque - TORQUE,
            )
        )
        if sys.stderr.isatty() or run % 500 == 499:
            end = "\r" if sys.stderr.isatty() else "\n"
            sys.stderr.write(f"{told}: {run + 1} of {runs} windows{end}")
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return Tally(*columns)


def share(hits: np.ndarray) -> str:
    """Part of the runs and its 95 % interval by Clopper and Pearson; a dash where there were none."""
    if not len(hits):
        return "-"
    low, high = count(hits).interval or (0.0, 1.0)
    return f"{hits.mean():.1%} ({low:.1%} to {high:.1%})"


def windowed_coverage(runs: int) -> dict[str, Tally]:
    """Print the tables over correlation times and over other noises; the windows behind them by noise."""
    found = {memory: tally(memory, runs) for memory in MEMORIES}
    out = sys.stdout.write
    out(f"95 % intervals of the mean of a {SECONDS:g} s window at {RATE:g} samples/s, {runs} windows a column\n")
    parts = ", ".join(f"{part:.0%} at order {order}" for order, part in RIPPLE)
    out(f"torque {TORQUE:g} N m, ripple {parts}, noise {NOISE:.0%} of first order, {SLOWEST:g} to {FASTEST:g} rpm\n\n")
    out(f"{'correlation time':<34}" + "".join(f"{memory * 1e3:>22g} ms" for memory in MEMORIES) + "\n")
    lines: dict[str, Callable[[Tally], str]] = {
        "truth inside, all windows": lambda t: share(t.held),
        "flagged": lambda t: share(t.flagged),
        "truth inside, flagged left out": lambda t: share(t.held[~t.flagged]),
        "truth inside, flagged only": lambda t: share(t.held[t.flagged]),
        "u from the memory of the noise": lambda t: f"{t.remembered.mean():.1%}",
        "median correlation time found": lambda t: f"{np.median(t.memory) * 1e3:.3g} ms",
        "median u / rms error": lambda t: f"{np.median(t.u) / np.sqrt(np.mean(t.error**2)):.2f}",
        "mean half-width / ideal": lambda t: f"{t.wide():.2f}",
        "for comparison:": lambda _: "",
        "  batches, flagged left out": lambda t: share(t.batches[~t.flagged]),
        "  batches, mean of all samples": lambda t: share(t.batches),
        "  s / root n": lambda t: share(t.naive),
    }
    for name, told in lines.items():
        out(f"{name:<34}" + "".join(f"{told(t):>25}" for t in found.values()) + "\n")
    return {f"first order, {memory * 1e3:g} ms": t for memory, t in found.items()} | other_colours(runs)


def other_colours(runs: int) -> dict[str, Tally]:
    """Print the table over noises that are not of first order, or outlive most of the window."""
    found: dict[str, Tally] = {}
    out = sys.stdout.write
    out(f"\nother noises, {SLOW_RATE:g} samples/s; truth: mean over {SPAN} windows of 1/f^a, start of a walk\n\n")
    heads = ("truth inside", "flagged", "inside, flagged", "inside, not flagged", "half-width/ideal", "batches alone")
    out(f"{'noise':<38}" + "".join(f"{head:>25}" for head in heads) + "\n")
    for colour in COLOURS:
        t = found[colour.name] = tally(colour, runs, SLOW_RATE)
        cells = (
            share(t.held),
            share(t.flagged),
            share(t.held[t.flagged]),
            share(t.held[~t.flagged]),
            f"{t.wide():.2f}",
            share(t.batches),
        )
        out(f"{colour.name:<38}" + "".join(f"{cell:>25}" for cell in cells) + "\n")
    return found
