"""Limits of what one file may ask for: a floor, whatever its size, and so much for each of its bytes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FileLimit:
    """Limit by the size of a file: the larger of the first two, up to the last.

    Parameters
    ----------
    floor : int
        However small the file is.
    per_byte : int
        For each byte of it.
    ceiling : int or None
        However large it is.
    """

    floor: int
    per_byte: int
    ceiling: int | None = None

    def of(self, size: int) -> int:
        """Most of a file of that size [bytes]."""
        most = max(self.floor, self.per_byte * size)
        return most if self.ceiling is None else min(most, self.ceiling)


EXPANDED = FileLimit(64 << 20, 100)
"""Bytes that the chunks of a file hold together: measured signals are packed to a half or a tenth, those of a bench at
rest to a hundredth at most."""
WASTED = FileLimit(4 << 30, 400)
"""Bytes that are expanded of chunks that turn out damaged: a damaged head may claim much."""
MESSAGES = FileLimit(500_000, 4)
"""Messages that are taken: recorded ones take a byte and more."""
MISSING = FileLimit(5_000_000, 4, 50_000_000)
"""Samples that the gaps of a channel leave out together: each takes the memory of one that is there."""
