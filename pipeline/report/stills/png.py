"""PNG files of drawings: plain dots, which are mostly one colour, pack best and quickest without a filter."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

METRE = 39.3700787
"""Inches per metre."""


def png_file(dots: NDArray[np.uint8], resolution: int) -> bytes:
    """A PNG file; the same dots give the same bytes.

    Parameters
    ----------
    dots : (rows, columns, 3) array of uint8
        Red, green and blue.
    resolution : int
        Dots per inch, told in the file.

    References
    ----------
    W3C, Portable Network Graphics (PNG) Specification, third edition, sections 5, 9 and 11.
    """
    rows, columns, _ = dots.shape
    unfiltered = np.zeros((rows, 1 + 3 * columns), np.uint8)
    unfiltered[:, 1:] = dots.reshape(rows, 3 * columns)
    per_metre = round(resolution * METRE)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in (
            (b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)),
            (b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1)),
            (b"IDAT", zlib.compress(unfiltered.tobytes(), 6)),
            (b"IEND", b""),
        )
    )
