"""`./pmgw bench cluster`: the ingest on a dask cluster of separate processes, one of them killed midway."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
import time
from pathlib import Path

from distributed import Client, LocalCluster

from tests.bench.kill import EXAMPLE, LONGEST_S, command, contents, finish, finished


def process_numbers(client: Client) -> dict[str, int]:
    """The process of each worker, by its address."""
    return {str(address): int(number) for address, number in client.run(os.getpid).items()}


def main() -> int:
    """Print what happened; the exit code says whether the store is the one that a single process makes."""
    parser = argparse.ArgumentParser(prog="pmgw bench cluster", description=__doc__)
    parser.add_argument("recordings", nargs="?", type=Path, default=EXAMPLE)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--kill-after", type=int, default=100, help="finished files before a worker is killed")
    given = parser.parse_args()
    out = sys.stdout.write
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder, "clustered")
        start = time.monotonic()
        finish(command(given.recordings, Path(folder, "whole"), "--workers", "1"))
        out(f"one process, no cluster: {time.monotonic() - start:.1f} s\n")
        whole = contents(Path(folder, "whole"))
        cluster = LocalCluster(
            n_workers=given.workers, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        )
        with cluster, Client(cluster) as client:
            before = process_numbers(client)
            victim = next(iter(before.values()))
            out(f"cluster: {len(before)} workers, processes {sorted(before.values())}; this one is {os.getpid()}\n")
            start = time.monotonic()
            process = command(given.recordings, store, "--scheduler", cluster.scheduler_address)
            while len(finished(store)) < given.kill_after and process.poll() is None:
                assert time.monotonic() - start < LONGEST_S, "no file was finished"
                time.sleep(0.005)
            os.kill(victim, signal.SIGKILL)
            at_kill = finished(store)
            told = finish(process)
            took = time.monotonic() - start
            after = set(process_numbers(client).values())
        later = finished(store)
        again = sum(later.get(name) != mark for name, mark in at_kill.items())
        same = contents(store) == whole
        out(f"worker {victim} killed with -9 after {len(at_kill)} of {len(later)} files; ")
        out(f"{'still there' if victim in after else 'gone'} at the end\n")
        out(f"ingested {told['ingested']}, already there {told['skipped']}, not usable {told['failed']}; ")
        out(f"{took:.1f} s; finished at the kill and done again: {again}\n")
        out(f"store the same as by one process, byte for byte: {same}\n")
    return 0 if same and not again and victim not in after else 1


if __name__ == "__main__":
    raise SystemExit(main())
