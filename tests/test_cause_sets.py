"""Sets of causes in words."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.wording.cause_sets import numbered

CAUSES = st.lists(st.sampled_from(["a gain", "a drift", "a gap", "a lag"]), min_size=1, max_size=3, unique=True)


def test_what_all_sets_have_in_common_is_said_once() -> None:
    assert numbered([("a gain", "a drift"), ("a drift", "a lag")]) == (
        "A drift in any case; besides it, one of these.",
        "1. A gain.",
        "2. A lag.",
    )
    assert numbered([("a gap", "a gain", "a drift"), ("a drift", "a lag", "a gap")])[0] == (
        "A gap together with a drift in any case; besides them, one of these."
    )
    assert numbered([("a gain", "a drift"), ("a drift", "a lag")], others=True)[0] == "1. A gain together with a drift."
    assert numbered([("a gain", "a drift"), ("a gap",)]) == ("1. A gain together with a drift.", "2. A gap.")


def test_a_set_that_is_part_of_another_keeps_its_words() -> None:
    assert numbered([("a gain",), ("a gain", "a drift")]) == ("1. A gain.", "2. A gain together with a drift.")


@given(st.lists(CAUSES, min_size=1, max_size=4))
def test_every_set_can_be_read_back(sets: list[list[str]]) -> None:
    said = [sentence.lower() for sentence in numbered(sets)]
    common = said.pop(0) if not said[0].startswith("1.") else ""
    assert len(said) == len(sets)
    for sentence, causes in zip(said, sets, strict=True):
        assert all(cause in sentence or cause in common for cause in causes)
