"""Whether both campaigns used the same transducers, as the user may state it."""

from __future__ import annotations

from enum import StrEnum


class Transducers(StrEnum):
    """The same ones, different ones, or what the calibrations say."""

    AUTO = "auto"
    SAME = "same"
    DIFFERENT = "different"
