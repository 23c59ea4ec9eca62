"""The bench's scoring of other methods: right for contestants whose worth is known beforehand."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.bench import contestants
from tests.bench.bout import Answer, Reply
from tests.bench.contestants import BestOfCatalogue
from tests.bench.rivals import chosen, read_proof, run
from tests.bench.rivalscore import CALIBRATED, Row, calibrated_threshold, cell, proof_row, rows_of, score, table
from tests.bench.steady_bout import Bout, enter
from tests.trials.strata_by_name import find_stratum

from pmg.pipeline.trials.score.case_list import SEED, Lot, draw_lots
from pmg.pipeline.trials.score.figures import Figured
from pmg.pipeline.trials.score.score import DiagnosisScore
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from pathlib import Path

STRATA = (
    "clean",
    "clean random",
    "torque_zero_offset sun 4",
    "torque_zero_offset ring 2",
    "windage ring 0.25",
    "outside_periodic_time sun 2",
    "lubricant_viscosity ring + torque_gain_error sun 2",
)
LARGE = "torque_zero_offset sun 8"


@pytest.fixture(scope="module")
def truths() -> list[dict[str, Any]]:
    """Two clean campaigns, three with one effect, one from outside the library, one with two effects."""
    return [Lot(i, find_stratum(name), SEED).draw().truth for i, name in enumerate(STRATA)]


@pytest.fixture(scope="module")
def bout() -> Bout:
    """A campaign with a large offset of the sun's transducer."""
    found = enter(Lot(0, find_stratum(LARGE), SEED))
    assert found is not None
    return found


@dataclass
class Fake:
    """Says the same of every campaign, and counts them."""

    alarm: bool
    said: tuple[str, str] | None = None
    level: float = 1.0
    name: str = "fake"
    asked: list[bool] = field(default_factory=list)

    def __call__(self, bout: Bout | None, *, withheld: bool) -> Answer:
        """Always the same."""
        self.asked.append(withheld)
        reply = Reply(self.alarm, self.said if self.alarm else None, 1.25 if self.alarm else None)
        return Answer(self.level, {"own rule": reply}, ((self.level, reply),), 0.5, {})


def rows(fake: Fake, truths: list[dict[str, Any]], clean: int = 0) -> tuple[Row, ...]:
    """Its lines of the table."""
    answers = [fake(None, withheld=False) for _ in truths]
    return rows_of(fake.name, truths, answers, answers[:1] * clean)


def value(row: Row, identifier: str) -> float | None:
    """A figure of a line."""
    return next(figure.value for figure in row.figures if figure.id == identifier)


def test_one_that_always_alarms_is_always_falsely_alarmed(truths: list[dict[str, Any]]) -> None:
    (row,) = rows(Fake(alarm=True), truths)
    assert value(row, "false_alarm") == 1.0
    assert all(rate.value == 1.0 for *_, rate in row.bins)
    assert value(row, "named_right_above") == 0.0
    assert value(row, "confident_library") == value(row, "confident_outside") == 0.0
    assert value(row, "held_out") == 1.25


def test_one_that_never_alarms_sees_nothing_and_is_never_wrong(truths: list[dict[str, Any]]) -> None:
    (row,) = rows(Fake(alarm=False), truths)
    assert value(row, "false_alarm") == 0.0
    assert all(rate.value == 0.0 for *_, rate in row.bins)
    assert value(row, "confident_library") == value(row, "confident_outside") == 0.0
    assert value(row, "held_out") is None
    assert [s.outcome for s in row.scores[2:]] == [DiagnosisScore.MISSED] * 5


def test_one_that_always_names_the_same_is_right_only_there(truths: list[dict[str, Any]]) -> None:
    (row,) = rows(Fake(alarm=True, said=("torque_zero_offset", "sun")), truths)
    assert [s.outcome for s in row.scores] == [
        DiagnosisScore.FALSE_ALARM,
        DiagnosisScore.FALSE_ALARM,
        DiagnosisScore.RIGHT,
        DiagnosisScore.WRONG_SHAFT,
        DiagnosisScore.WRONG,
        DiagnosisScore.WRONG,
        DiagnosisScore.WRONG,
    ]
    assert value(row, "named_right_above") == 0.5
    assert value(row, "right_id") == 1.0
    assert value(row, "confident_library") == 0.5
    assert value(row, "confident_outside") == 1.0


def test_withheld_errors_of_clean_campaigns_do_not_count(truths: list[dict[str, Any]]) -> None:
    (row,) = rows(Fake(alarm=True), truths)
    assert [s.held_out for s in row.scores] == [None, None, 1.25, 1.25, 1.25, 1.25, 1.25]


def test_a_campaign_without_a_baseline_is_not_made(truths: list[dict[str, Any]]) -> None:
    assert score(truths[2], None).outcome is DiagnosisScore.NOT_MADE


def test_calibration_silences_one_that_alarms_as_strongly_without_any_effect(truths: list[dict[str, Any]]) -> None:
    own, calibrated = rows(Fake(alarm=True), truths, clean=40)
    assert (own.setting, calibrated.setting) == ("own rule", CALIBRATED)
    assert value(own, "false_alarm") == 1.0
    assert value(calibrated, "false_alarm") == 0.0


def test_too_few_clean_campaigns_calibrate_nothing(truths: list[dict[str, Any]]) -> None:
    assert calibrated_threshold([0.0] * 18) == math.inf
    assert [row.setting for row in rows(Fake(alarm=True), truths, clean=18)] == ["own rule"]


@given(st.lists(st.floats(-1e6, 1e6), min_size=19, max_size=120, unique=True))
def test_a_calibrated_threshold_is_passed_at_its_rate_by_one_campaign_more(levels: list[float]) -> None:
    """Each campaign in turn as the further one, calibrated by the rest: exact for any law, here by counting."""
    passed = sum(level > calibrated_threshold(levels[:i] + levels[i + 1 :], 0.06) for i, level in enumerate(levels))
    assert 0 < passed <= 0.06 * len(levels)


def test_a_calibrated_setting_asks_for_more() -> None:
    """What is said is what is left above the threshold, not what a lower one lets through."""
    few, many = Reply(True, ("windage", "sun"), 1.1), Reply(True, ("cogging", "ring"), 1.3)
    answer = Answer(0.5, {}, ((0.1, many), (0.3, few), (0.5, few), (0.7, Reply(alarm=False))), 0.0, {})
    assert answer.above(0.05).said == ("cogging", "ring")
    assert answer.above(0.2).said == ("windage", "sun")
    assert not answer.above(0.5).alarm


def test_the_table_shows_every_row_and_says_where_none_tells(truths: list[dict[str, Any]]) -> None:
    lines = table([*rows(Fake(alarm=True), truths), *rows(Fake(alarm=False, name="mute"), truths)]).splitlines()
    assert len(lines) == 4
    assert len({line.count("|") for line in lines}) == 1
    assert "100 % (16 to 100)" in lines[2]
    assert lines[2].count("| –") == 4
    assert "none told" in lines[3]
    assert "–" not in lines[3]


def test_a_size_that_the_campaigns_do_not_determine_is_not_told_as_a_number() -> None:
    assert cell(Figured("size_95", "", "sigma", 3e7, None, 40)) == "not determined"
    assert cell(Figured("size_95", "", "sigma", 0.5, (0.25, 1.0), 40)) == "0.50 (0.25 to 1.00)"


def test_what_the_baseline_takes_up_is_not_seen(bout: Bout) -> None:
    every = np.ones(len(bout.fold), dtype=bool)
    columns = bout.stage.columns / bout.scale[:, None]
    found = columns @ np.linspace(-1.0, 2.0, columns.shape[1])
    assert np.abs(bout.beside(found, every)).max() < 1e-6 * np.abs(found).max()
    np.testing.assert_allclose(bout.beside(bout.residual + found, every), bout.residual_without(every), atol=1e-5)


def test_a_correction_never_sees_the_readings_that_judge_it(bout: Bout) -> None:
    """One that repeats what it was trained on, and knows nothing else, corrects no withheld reading."""

    def parrot(train: np.ndarray[Any, np.dtype[np.bool_]]) -> np.ndarray[Any, np.dtype[np.float64]]:
        return np.where(train, bout.residual_without(train), 0.0)

    def nothing(train: np.ndarray[Any, np.dtype[np.bool_]]) -> np.ndarray[Any, np.dtype[np.float64]]:
        return np.zeros(len(train))

    everywhere = np.ones(len(bout.fold))
    assert bout.held_out(everywhere, parrot) == bout.held_out(everywhere, nothing)
    assert bout.held_out(0.0 * everywhere, nothing) is None


def test_the_best_of_the_catalogue_finds_a_large_offset(bout: Bout) -> None:
    answer = BestOfCatalogue()(bout, withheld=False)
    assert answer.settings["BIC"] == Reply(True, ("torque_zero_offset", "sun"), None)
    assert answer.above(0.0).alarm
    assert not answer.above(answer.level).alarm


def test_an_effect_that_cannot_be_withheld_is_still_an_answer(bout: Bout, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contestants, "withhold", lambda *_: None)
    answer = BestOfCatalogue()(bout, withheld=True)
    assert answer.settings["BIC"] == Reply(True, ("torque_zero_offset", "sun"), None)


def test_an_interrupted_run_goes_on_where_it_was(tmp_path: Path) -> None:
    """Answers that are there are not asked for again; a damaged one is."""
    lots, calibration = chosen(4, SEED, 1, 1), draw_lots(1, SEED + 1, ("clean",))
    first, again = Fake(alarm=True), Fake(alarm=True)
    text = run(lots, calibration, [first], tmp_path)
    assert first.asked == [False, True, False]
    assert run(lots, calibration, [again], tmp_path) == text
    assert again.asked == []
    kept = sorted((tmp_path / "cases").iterdir())
    kept[0].write_text(kept[0].read_text(encoding="utf-8")[:40], encoding="utf-8")
    assert run(lots, calibration, [again], tmp_path) == text
    assert len(again.asked) == 1
    assert (tmp_path / "rivals.md").read_text(encoding="utf-8") == text
    assert json.loads((tmp_path / "rivals.json").read_text(encoding="utf-8"))["cases"] == [lot.number for lot in lots]


def test_the_campaigns_are_those_of_the_proof() -> None:
    lots = draw_lots(40, SEED)
    assert chosen(40, SEED, None, None) == lots
    few = chosen(40, SEED, 3, 5)
    assert set(few) <= set(lots)
    assert [lot.stratum.kind == "clean" for lot in few].count(True) == 3
    assert len(few) == 8


def test_our_own_line_counts_the_same_campaigns_only() -> None:
    case = {"kind": "one", "concealed": ["windage"], "said": [], "p_value": 0.5, "recognised": None, "laws": "usual"}
    seen = {"reached_sigma": 2.0, "verdict": "named", "outcome": "named right", "held_out_ratio": 1.02}
    missed = {"reached_sigma": 1.0, "verdict": "consistent", "outcome": "missed", "held_out_ratio": None}
    cases = [{"case": i, "stratum": "s", **case, **what} for i, what in enumerate((seen, missed, missed))]
    row = proof_row({"cases": cases, "time_s": {"median": 3.0}}, [0, 2])
    assert value(row, "named_right_above") == 0.5
    assert value(row, "held_out") == 1.02
    assert len(row.scores) == 2


def test_scores_of_another_trial_are_refused(tmp_path: Path) -> None:
    lots = draw_lots(2, SEED)
    file = tmp_path / "scores.json"
    cases = [{"case": lot.number, "stratum": lot.stratum.name} for lot in lots]
    right = {"schema": "pmg.proof/1", "seed": SEED, "laws": "usual", "cases": cases}
    file.write_text(json.dumps(right), encoding="utf-8")
    assert read_proof(file, lots) == right
    for wrong in ({**right, "seed": 1}, {**right, "laws": "all"}, {**right, "cases": cases[:1]}, {"schema": "other"}):
        file.write_text(json.dumps(wrong), encoding="utf-8")
        with pytest.raises(BenchError, match=r"scores\.json"):
            read_proof(file, lots)
    with pytest.raises(BenchError):
        read_proof(tmp_path / "none.json", lots)
