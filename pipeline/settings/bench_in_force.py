"""The bench in force: of the machine that a store was made with, of one that the call names, else of the thesis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.magnetic import bench_of, remarks_on_bench
from pmg.pipeline.machine.shipped import machine_path
from pmg.pipeline.store.machine_copy import COPY_OF_MACHINE, holds_sources, keep_machine, kept_machine
from pmg.pipeline.store.store import MARK, Store
from pmg.sim.bench import load_bench
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.recording.remark import Remark
    from pmg.sim.bench import BenchParameters


def bench_of_store(store: Path) -> BenchParameters:
    """The bench of the machine that a store was made with; that of the thesis where it names none.

    Raises
    ------
    PmgError
        The copy of the machine file in the store is gone, changed or not sound.
    """
    kept = kept_machine(store)
    return load_bench() if kept is None else bench_of(read_machine(kept))


def bench_in_force(store: Path | None, machine: str | None) -> BenchParameters:
    """The bench of a call.

    Parameters
    ----------
    store : Path, optional
        The store it works on.
    machine : str, optional
        Machine file that it names, or the name of one that ships.

    Raises
    ------
    PmgError
        The machine has no magnetic gear, or the store was made with another one.
    """
    if machine is None:
        return load_bench() if store is None else bench_of_store(store)
    bench = bench_of(read_machine(machine_path(machine)))
    if store is not None and (store / MARK).is_file() and bench_of_store(store) != bench:
        kept = kept_machine(store)
        made = "the thesis bench" if kept is None else f"{read_machine(kept).title}, {COPY_OF_MACHINE} in it"
        do = "Leave --machine out, or ingest into another store: what is in this one was judged by its machine."
        raise StoreError(f"{store}: --machine {machine}", "another machine", f"that of the store: {made}", do)
    return bench


def settle_bench(store: Path, machine: str | None) -> BenchParameters:
    """The bench of a call that fills a store, which remembers the machine from then on.

    Raises
    ------
    PmgError
        As of `bench_in_force`.
    """
    settled = kept_machine(store) is not None or holds_sources(store)
    if machine is None or settled:
        return bench_in_force(store, machine)
    described = read_machine(machine_path(machine))
    bench = bench_of(described)
    keep_machine(Store(store), described.file.text)
    return bench


def machine_title(store: Path) -> str | None:
    """Title of the machine that a store was made with; None of the thesis bench."""
    kept = kept_machine(store)
    return None if kept is None else read_machine(kept).title


def remarks_on_machine(machine: str | None) -> tuple[Remark, ...]:
    """What the machine that a call names takes from the thesis, and what does not agree in its file."""
    return () if machine is None else remarks_on_bench(read_machine(machine_path(machine)))


def machine_remarks(store: Path) -> tuple[Remark, ...]:
    """What the machine of a store takes from the thesis, and what does not agree in its file."""
    kept = kept_machine(store)
    return () if kept is None else remarks_on_bench(read_machine(kept))
