"""Whole ingests, processes and all, beside the readers of the same recordings: a table of `./pmgw bench throughput`."""

from __future__ import annotations

import os
import shutil
import sys
from dataclasses import fields
from importlib.util import find_spec
from typing import TYPE_CHECKING

import polars as pl

from tests.bench.kill import EXAMPLE
from tests.bench.size import CHANNELS, RATE_HZ, SECONDS, Cost, carried_out, write_campaign

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from pathlib import Path

    Contest = Callable[[str, Path], Mapping[str, float]]

REPEATS = 3
"""Times that each ingest is run; the least counts."""
SEED = 20260503
EXAMPLE_CHANNELS = 4
TIMES = ("processor", "wall")


def whole(one: Path, samples: int, contestants: Sequence[str], contest: Contest) -> None:
    """Print the table of whole ingests: one long recording, recordings of 10 s, and the short ones of the example.

    Parameters
    ----------
    one : Path
        Folder of one long recording; the others, and the stores, are written beside it.
    samples : int
        Its samples, on all channels together.
    contestants : sequence of str
        Readers of recordings.
    contest : callable
        Times of one of them, or of ``pyarrow``, on one file [s].
    """
    out, cores, folder = sys.stdout.write, os.cpu_count() or 1, one.parent
    write_campaign(folder / "ten", max(1, round(samples / (SECONDS * CHANNELS * RATE_HZ))), SEED)
    out(f"\nWhole ingests with 1 and {cores} workers, processes and all, and again with nothing left to do. Seconds, ")
    out(f"then 1e6 samples/s beside the readers. The least of {REPEATS} times.\n\n")
    heads = ("time", "1 [s]", f"{cores} [s]", "again [s]", "ingest 1", f"ingest {cores}", "1 less again")
    out(f"{'recordings':22}" + "".join(f"{head:>13}" for head in (*heads, *contestants, "pyarrow")) + "\n")
    for name, place in (("one", one), ("of 10 s", folder / "ten"), ("short, example", EXAMPLE)):
        stores = {workers: folder / f"store-{place.name}-{workers}" for workers in (1, cores)}
        alone, spread = (_ingested(place, store, workers) for workers, store in stores.items())
        again = _least(_ingest(place, stores[1], 1) for _ in range(REPEATS))
        files, tables = sorted(place.glob("*.mcap")), sorted((stores[1] / "runs").glob("*.parquet"))
        count, readers = samples, {}
        if place == EXAMPLE:
            count = EXAMPLE_CHANNELS * sum(pl.read_parquet(table).height for table in tables)
        else:
            readers = {each: [contest(each, file) for file in files] for each in contestants}
            if find_spec("pyarrow"):
                readers["pyarrow"] = [contest("pyarrow", table) for table in tables]
        for kind in TIMES:
            seconds = [getattr(cost, kind) for cost in (alone, spread, again)]
            spent = [*seconds[:2], seconds[0] - seconds[2], *(sum(each[kind] for each in r) for r in readers.values())]
            label = f"{name} ({len(files)})" if kind == TIMES[0] else ""
            cells = (*seconds, *(count / each / 1e6 for each in spent))
            out(f"{label:22}{kind:>13}" + "".join(f"{value:13.2f}" for value in cells) + "\n")
            sys.stdout.flush()


def _ingest(recordings: Path, store: Path, workers: int) -> Cost:
    """Cost of the command."""
    return carried_out(["ingest", str(recordings), "--store", str(store), "--workers", str(workers)])


def _ingested(recordings: Path, store: Path, workers: int) -> Cost:
    """Least cost of an ingest into a store that is made for it."""
    costs = []
    for _ in range(REPEATS):
        shutil.rmtree(store, ignore_errors=True)
        costs.append(_ingest(recordings, store, workers))
    return _least(costs)


def _least(costs: Iterable[Cost]) -> Cost:
    """Least times and memory of one command run several times."""
    held = list(costs)
    assert all(cost.code in (0, 3) for cost in held), held
    return Cost(*(min(getattr(cost, each.name) for cost in held) for each in fields(Cost)))
