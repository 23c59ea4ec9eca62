"""Hash and CRC of a file from its beginning, worked out during the reading."""

from __future__ import annotations

import hashlib
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from deflate import crc32

if TYPE_CHECKING:
    from concurrent.futures import Future

ASIDE = 1 << 16
"""Stretches from this length on are worked out during the reading [bytes]; a shorter one costs less than its handing
over."""


class Trail:
    """SHA-256 and CRC-32 of what it is given, in the order in which it is given.

    Notes
    -----
    One other thread works through long stretches, one after another, while the caller goes on; both sums let go of
    the interpreter. Who asks for a result waits for it, so it never depends on which thread was faster.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._crc = 0
        self._pool: ThreadPoolExecutor | None = None
        self._last: Future[None] | None = None
        self._fault: BaseException | None = None

    def add(self, data: bytes | memoryview) -> Future[None] | None:
        """Go on with these bytes, which may change once what is given back is done; None when they may at once."""
        if len(data) < ASIDE and (self._last is None or self._last.done()):
            self._wait()
            self._go_on(data)
            return None
        if self._pool is None:
            self._pool = ThreadPoolExecutor(1, "pmg-trail")
        self._last = self._pool.submit(self._go_on, data)
        return self._last

    def _go_on(self, data: bytes | memoryview) -> None:
        """Sum these bytes, unless what came before them failed: the sums would be of a file with a hole."""
        if self._fault is not None:
            raise self._fault
        try:
            self._sum(data)
        except BaseException as fault:
            self._fault = fault
            raise

    def _sum(self, data: bytes | memoryview) -> None:
        self._hash.update(data)
        self._crc = crc32(data, self._crc)

    def _wait(self) -> None:
        """Until nothing is left to do; what went wrong in the other thread is raised here."""
        if self._last is not None:
            self._last.result()
            self._last = None

    def crc(self) -> int:
        """CRC-32 of everything given."""
        self._wait()
        return self._crc

    def digest(self) -> str:
        """SHA-256 of everything given."""
        self._wait()
        self.close()
        return self._hash.hexdigest()

    def close(self) -> None:
        """End the other thread; it begins again with what is given next."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None
