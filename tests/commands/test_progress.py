"""Steps are announced as they begin, under their own names."""

from __future__ import annotations

import pytest

from pmg.pipeline.files.progress import Steps, named


def test_a_step_says_how_many_are_done_before_it() -> None:
    seen: list[tuple[int, int, str]] = []
    steps = Steps(lambda *step: seen.append(step), "decode", "fit", "prove")
    steps.begin("decode")
    steps.begin("prove")  # what is not needed is passed over
    assert seen == [(0, 3, "decode"), (2, 3, "prove")]


def test_a_step_of_another_stage_is_refused() -> None:
    with pytest.raises(ValueError, match="tuple"):
        Steps(None, "decode").begin("fit")


def test_nobody_who_asks_is_told_nothing() -> None:
    Steps(None, "decode").begin("decode")
    assert named(None, "ingest") is None


def test_a_step_carries_the_name_of_its_stage() -> None:
    seen: list[tuple[int, int, str]] = []
    told = named(lambda *step: seen.append(step), "compare")
    assert told is not None
    Steps(told, "report").begin("report")
    assert seen == [(0, 1, "compare: report")]
