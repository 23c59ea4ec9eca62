"""Covariates of a mismatch in words: the same in the statement, on the first screen and in the tables."""

from __future__ import annotations

_WORDS = {
    "order": "the order of the points",
    "run_history": "what was run before",
    "previous_point": "the point before",
    "speed_sun": "sun speed",
    "speed_ring": "ring speed",
    "speed_difference": "difference of the speeds",
    "direction": "direction of rotation",
}
"""Words of those whose name is not enough."""


def covariate_words(names: tuple[str, ...]) -> list[str]:
    """Words for the covariates that a torque depends on."""
    return [_WORDS.get(name, name.replace("_", " ")) for name in names]
