"""How the error on withheld rows is said to change."""

from __future__ import annotations

import pytest

from pmg.pipeline.diagnosis.engine.held_out import HeldOut, change_words


@pytest.mark.parametrize(
    ("before", "after", "interval", "said"),
    [
        (3.71e-3, 1.07e-3, (2e-3, 3e-3), "drops from 3.71 to 1.07 mN m"),
        (1.07e-3, 3.71e-3, (-3e-3, -2e-3), "rises from 1.07 to 3.71 mN m"),
        (1.50e-3, 1.45e-3, (-1e-4, 2e-4), "does not clearly drop: from 1.50 to 1.45 mN m"),
        (1.451e-3, 1.449e-3, (-1e-4, 2e-4), "does not drop (1.45 mN m)"),
        (1.451e-3, 1.449e-3, (1e-6, 3e-6), "hardly drops (1.45 mN m)"),
    ],
)
def test_a_change_is_said_as_its_interval_and_its_digits_allow(
    before: float, after: float, interval: tuple[float, float], said: str
) -> None:
    assert change_words(HeldOut("none", before, after, 1e-3, interval), 2) == said
