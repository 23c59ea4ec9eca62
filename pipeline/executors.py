"""One map over many items, in this process or in others."""

from __future__ import annotations

import multiprocessing
import signal
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING, TypeVar

from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

Item = TypeVar("Item")
Result = TypeVar("Result")


def map_over(work: Callable[[Item], Result], items: Sequence[Item], workers: int) -> Iterator[tuple[Item, Result]]:
    """Results as they are ready, each with its item.

    Parameters
    ----------
    work : callable
        A module-level function; with more than one worker it and the items are sent to other processes.
    items : sequence
        What to work on.
    workers : int
        Processes; 1 works in this one. New processes are spawned, not forked: polars holds threads that do not
        survive a fork.

    Raises
    ------
    StoreError
        A worker process was killed.
    """
    if workers <= 1 or len(items) <= 1:
        for item in items:
            yield item, work(item)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(items)), mp_context=context, initializer=_leave_interrupts) as pool:
        futures: dict[Future[Result], Item] = {pool.submit(work, item): item for item in items}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool as error:
            raise StoreError(
                "worker process",
                "it ended before its work was done",
                "workers that live",
                "Run it again, it resumes; with --workers 1 if memory is short.",
            ) from error
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def _leave_interrupts() -> None:
    """An interrupt from the keyboard is the parent's to answer."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
