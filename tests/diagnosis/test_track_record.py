"""The track record of answers: the figures of the trial, as its page has them."""

from __future__ import annotations

import re

import pytest
from tests.house import ROOT

from pmg.pipeline.diagnosis.grid.track_record import IN_MOTION, OF_MACHINES, RECORD, TrackRecord


def test_the_record_is_that_of_the_trial_on_its_page() -> None:
    page = (ROOT / "pipeline" / "trials" / "README.md").read_text(encoding="utf-8")
    told = re.search(r"what is told holds the truth \| \**(\d+) of (\d+) ", page)
    assert told is not None
    held, of = (sum(getattr(record, name) for record in RECORD.values()) for name in ("held", "of"))
    assert (held, of) == (int(told[1]), int(told[2]))


def test_the_record_in_motion_is_that_of_its_trial() -> None:
    page = (ROOT / "pipeline" / "trials" / "motion" / "README.md").read_text(encoding="utf-8")
    told = re.search(r"holds the truth in (\d+) of (\d+) campaigns in motion", page)
    assert told is not None
    held, of = (sum(getattr(record, name) for record in IN_MOTION.values()) for name in ("held", "of"))
    assert (held, of) == (int(told[1]), int(told[2]))


def test_the_record_of_other_machines_is_that_of_their_trial() -> None:
    page = (ROOT / "pipeline" / "trials" / "machines" / "README.md").read_text(encoding="utf-8")
    told = re.search(r"holds the truth in (\d+) of (\d+) campaigns of other machines", page)
    assert told is not None
    held, of = (sum(getattr(record, name) for record in OF_MACHINES.values()) for name in ("held", "of"))
    assert (held, of) == (int(told[1]), int(told[2]))
    for answer, words in (
        ("named", "a cause named"),
        ("ambiguous", "one of several sets"),
        ("not_in_library", "none known or the closest"),
    ):
        row = re.search(rf"{words} in (\d+) of (\d+)", page)
        assert row is not None, answer
        assert (OF_MACHINES[answer].held, OF_MACHINES[answer].of) == (int(row[1]), int(row[2]))


def test_the_words_give_rate_and_interval() -> None:
    record = TrackRecord("a cause named", "The cause named was right", 19, 20)
    assert record.sentence == "The cause named was right in 19 of 20 simulated cases."
    assert record.interval == pytest.approx((0.751, 0.999), abs=1e-3)
    assert record.words.startswith("a cause named: held the truth in 95% of 20 concealed synthetic campaigns")
