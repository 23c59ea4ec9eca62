"""`./pmgw bench growth`: cost of transients against their length, the density of outputs and the number of points."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.transient import Task, transients
from tests.bench.case import Timed, tasks, timed
from tests.bench.speed import report

if TYPE_CHECKING:
    from collections.abc import Sequence

MOST = 10_000
PROCESSES = 2
SHARE = 250


def ends(share: Sequence[Task]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Last states of some runs: what a study of many points keeps."""
    return np.stack([trace.last for trace in transients(share)])


def many(count: int, pool: ProcessPoolExecutor | None) -> Timed:
    """A number of runs of 100 s with 101 outputs, here or in a pool."""
    runs = tasks(count, 100.0, 101)
    shares = [runs[i : i + SHARE] for i in range(0, count, SHARE)]
    return timed(lambda: list(map(ends, shares) if pool is None else pool.map(ends, shares)))


def main() -> None:
    """Print the tables."""
    transients(tasks(1, 1.0, 11))
    report("length of one run", "steps", "time [ms]")
    for duration in (10.0, 100.0, 1000.0):
        found = timed(lambda: transients(tasks(1, duration, 1001)), 5)  # noqa: B023  (called at once)
        steps = transients(tasks(1, duration, 1001))[0].steps
        report(f"  {duration:g} s", f"{steps}", f"{1e3 * found.wall:.2f}")
    report("outputs of one run of 100 s", "", "time [ms]")
    for outputs in (101, 1001, 10_001, 100_001):
        found = timed(lambda: transients(tasks(1, 100.0, outputs)), 5)  # noqa: B023  (called at once)
        report(f"  {outputs}", "", f"{1e3 * found.wall:.2f}")
    report("runs of 100 s", "1 process [s]", f"{PROCESSES} [s]")
    with ProcessPoolExecutor(PROCESSES) as pool:
        list(pool.map(ends, [tasks(1, 1.0, 11)] * 4 * PROCESSES))
        for count in (48, 480, 4_800, MOST):
            alone, together = many(count, None), many(count, pool)
            report(f"  {count}", f"{alone.wall:.2f}", f"{together.wall:.2f}")


if __name__ == "__main__":
    main()
