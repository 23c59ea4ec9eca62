"""One map over many items: in this process, in others of this machine, or on a cluster."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from multiprocessing.connection import wait
from threading import Thread
from typing import TYPE_CHECKING, TypeVar

from pmg.pipeline.files.notes import Noting, notes_taken
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from concurrent.futures import Executor

Item = TypeVar("Item")
Result = TypeVar("Result")

ADDRESS = re.compile(r"(?:(?:tcp|tls|ucx|wss?)://)?(?:\[[^\]\s]+\]|[^\s/:]+):\d+")
"""Form of a scheduler's address."""

MOST_PROCESSES = 61
"""Processes that Windows lets one wait for."""

PATIENCE = 30.0
"""Time within which a cluster has to answer and to show a worker [s]."""


@dataclass
class _Workers:
    """Processes that stay until their block ends; `pool` is made when it is first needed."""

    count: int
    until: ExitStack
    pool: Executor | None = None

    def started(self) -> Executor:
        """The processes."""
        if self.pool is None:
            self.pool = self.until.enter_context(_processes(self.count))
        return self.pool


_KEPT: ContextVar[_Workers | None] = ContextVar("workers", default=None)


@contextmanager
def keeping_workers(count: int | None = None, loading: str = "") -> Iterator[None]:
    """Within the block, one set of processes does the work of `map_over`, `map_in_order` and `begin`.

    They are started when first needed, or at once where they have a module to load, and end with the block. To start
    one takes longer than many a piece of work.

    Parameters
    ----------
    count : int, optional
        How many; as many as there are cores by default; with 1 all is done in this process.
    loading : str, optional
        A module that each of them loads while the caller goes on.

    Raises
    ------
    StoreError
        A worker process was killed.
    """
    if _KEPT.get() is not None:
        yield
        return
    with ExitStack() as until:
        workers = _Workers(count or os.cpu_count() or 1, until)
        before = _KEPT.set(workers)
        try:
            if loading and workers.count > 1:
                for _ in range(workers.count):
                    workers.started().submit(_load, loading)
            yield
        finally:
            _KEPT.reset(before)


def _load(module: str) -> None:
    """Import a module, which does not come back from a process."""
    import_module(module)


def begin(work: Callable[[Item], Result], item: Item) -> Callable[[], Result]:
    """Begin work in a process that `keeping_workers` keeps; what this gives waits for its result.

    Where none is running the work is done here, when its result is asked for.
    """
    kept = _KEPT.get()
    if kept is None or kept.pool is None:
        return partial(work, item)
    notes = notes_taken()
    if notes is None:
        return kept.pool.submit(work, item).result
    future = kept.pool.submit(Noting(work), item)

    def noted() -> Result:
        result, others = future.result()
        notes.add(others)
        return result

    return noted


def map_in_order(work: Callable[[Item], Result], items: Sequence[Item], worth: int) -> Iterator[tuple[Item, Result]]:
    """Results in the order of the items, each with its item.

    Parameters
    ----------
    work, items
        As for `map_over`.
    worth : int
        So many items are worth the start of the processes that `keeping_workers` keeps; running ones serve fewer.

    Raises
    ------
    StoreError
        A worker process was killed.
    """
    kept = _KEPT.get()
    if kept is not None and kept.count > 1 and len(items) >= worth:
        kept.started()
    for item, result in [(item, begin(work, item)) for item in items]:
        yield item, result()


def map_over(
    work: Callable[[Item], Result], items: Sequence[Item], workers: int, scheduler: str | None = None
) -> Iterator[tuple[Item, Result]]:
    """Results as they are ready, each with its item.

    Parameters
    ----------
    work : callable
        A module-level function; with more than one worker it and the items are sent to other processes.
    items : sequence
        What to work on.
    workers : int
        Processes; 1 works in this one.
    scheduler : str, optional
        Address of a dask scheduler whose workers do the work instead, such as ``tcp://host:8786``.

    Raises
    ------
    StoreError
        A worker process was killed, or the cluster cannot be had.
    """
    if not items:
        return
    if scheduler is not None:
        with _cluster(scheduler) as executor:
            yield from _spread(executor, work, items)
    elif workers <= 1 or len(items) <= 1:
        for item in items:
            yield item, work(item)
    elif (kept := _KEPT.get()) is not None:
        yield from _spread(kept.started(), work, items)
    else:
        with _processes(min(workers, len(items))) as executor:
            yield from _spread(executor, work, items)


def _spread(executor: Executor, work: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[tuple[Item, Result]]:
    """Results of an executor as they are ready, each with its item; what is left is called off when one fails.

    Parameters
    ----------
    executor : Executor
        Any executor of `concurrent.futures`.
    work, items
        As for `map_over`.
    """
    notes = notes_taken()
    if notes is not None:
        for item, (result, others) in _results(executor, Noting(work), items):
            notes.add(others)
            yield item, result
    else:
        yield from _results(executor, work, items)


def _results(
    executor: Executor, work: Callable[[Item], Result], items: Sequence[Item]
) -> Iterator[tuple[Item, Result]]:
    futures: dict[Future[Result], Item] = {executor.submit(work, item): item for item in items}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BaseException:
        for future in futures:
            future.cancel()
        raise


@contextmanager
def _processes(workers: int) -> Iterator[Executor]:
    """Processes of this machine, which end with the one that started them, even when that is killed.

    Parameters
    ----------
    workers : int
        How many. They are spawned, not forked: polars holds threads that do not survive a fork.

    Raises
    ------
    StoreError
        One of them was killed.
    """
    context = multiprocessing.get_context("spawn")
    count = min(workers, MOST_PROCESSES)
    with ProcessPoolExecutor(count, mp_context=context, initializer=_follow_parent) as pool:
        try:
            yield pool
        except BrokenProcessPool as error:
            raise StoreError(
                "worker process",
                "it ended before its work was done",
                "workers that live",
                "Run it again, it resumes; close other programs if memory is short.",
            ) from error
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    """Workers of a dask cluster. Work of a worker that is lost is done by another one.

    Parameters
    ----------
    address : str
        Where the scheduler listens, such as ``tcp://host:8786``. The workers need pmg, and the same folders under the
        same paths.

    Raises
    ------
    StoreError
        dask is not installed, nothing answers, there is no worker, or the connection or too many workers were lost.
    """
    where = f"--scheduler {address}"
    if not ADDRESS.fullmatch(address):
        came, expected = "no address of a scheduler", "that of a dask scheduler, such as tcp://host:8786"
        raise StoreError(where, came, expected, "'dask scheduler' prints it when it starts.")
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        came, expected = f"{error.name or 'distributed'} is not installed", "the package distributed of dask"
        raise StoreError(where, came, expected, "Install it: pip install 'pmg-bench[dask]'.") from error
    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError, ImportError, AssertionError) as error:  # the last where its own thread starts too late
        came, expected = f"no scheduler answers ({error})", "a dask scheduler, such as tcp://host:8786"
        raise StoreError(where, came, expected, "Check the address; start one with 'dask scheduler'.") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError as error:
            came, expected = f"no worker within {PATIENCE:g} s", "at least one worker"
            raise StoreError(where, came, expected, "Start one with 'dask worker ADDRESS'.") from error
        try:
            yield client.get_executor(pure=False)
        except KilledWorker as error:
            came = f"several workers were lost over one file ({error})"
            do = "Give the workers more memory; run it again, it resumes."
            raise StoreError(where, came, "workers that live", do) from error
        except CancelledError as error:
            came, do = "the connection was lost before the work was done", "Run it again, it resumes."
            raise StoreError(where, came, "a scheduler that stays", do) from error
        except ModuleNotFoundError as error:
            came, expected = f"a worker says: {error}", "workers with pmg installed"
            raise StoreError(where, came, expected, "Start them from an environment that holds pmg.") from error


def _follow_parent() -> None:
    """Leave an interrupt from the keyboard to the parent, keep to one thread, and end when the parent is gone."""
    os.environ["POLARS_MAX_THREADS"] = "1"  # read when polars is loaded; there is a process for every core
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()


def _end_after(sentinel: int) -> None:
    """End this process when another one has; what it was writing is left aside, as by any kill."""
    wait([sentinel])
    os._exit(1)
