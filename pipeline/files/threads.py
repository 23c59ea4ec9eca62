"""One thread for linear algebra, whatever the environment says.

The matrices are small: several threads wait for each other by spinning, longer than the work takes. The analysis of the
published grids takes 0.2 s of processor time with one thread and 3 s with two, their diagnosis 2 s and 10 s. And what
one thread computes hangs on no number of processors.
"""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables that say how many threads libraries of linear algebra start."""


def keep_to_one_thread() -> None:
    """Keep this process and those that it starts to one thread; it works before libraries of numbers are loaded."""
    os.environ.update(dict.fromkeys(THREADS, "1"))


@contextmanager
def one_thread() -> Iterator[None]:
    """One thread while the block, or the function that this decorates, runs; then as many as before."""
    import scipy.linalg  # noqa: F401 - it brings a library of its own besides numpy's; both must be there to be limited
    from threadpoolctl import threadpool_limits

    before = dict(os.environ)
    keep_to_one_thread()  # for processes that are started within
    try:
        with threadpool_limits(limits=1, user_api="blas"):
            yield
    finally:
        for name in THREADS:
            os.environ.pop(name)
            os.environ.update({name: before[name]} if name in before else {})
