"""Both ways to a diagnosis: which campaigns go both, how agreement is scored, stored and reported."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from scipy import stats
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.trials.score import stage
from pmg.pipeline.trials.score.agreement import agree, both_ways
from pmg.pipeline.trials.score.case_list import draw_lots
from pmg.pipeline.trials.score.chapter import proof_page
from pmg.pipeline.trials.score.run_case import SCHEMA, CaseTask
from pmg.pipeline.trials.score.stage import QUICK, TrialOptions, run_prove
from pmg.pipeline.trials.score.summary import score_lines, scores_document, summarise
from pmg.sim.errors import StoreError

RUNNER = CliRunner()
TOLD = {"seed": 1, "track": "steady", "strata": ["clean"], "laws": "usual", "route": "grid", "code": "0" * 64}
POINTS = {f"torque_{shaft}{end}": [0.1, 0.2] for shaft in ("sun", "ring") for end in ("_Nm", "_without_Nm")}


def truth(reached: float = 2.0, *, clean: bool = False) -> dict[str, Any]:
    """A truth by hand: one concealed gain, or nothing."""
    effect = {
        "id": "windage",
        "shaft": "sun",
        "reached_sigma": reached,
        "knobs": {},
        "laws": "usual",
        "in_library": True,
    }
    return {
        "kind": "clean" if clean else "one",
        "stratum": "by hand",
        "campaign": "campaign-00",
        "expected": ["named"],
        "effects": [] if clean else [effect],
        "points": POINTS,
    }


def result(verdict: str, p_value: float, *ids: str, held_out: float | None = None) -> dict[str, Any]:
    """A result by hand."""
    after = None if held_out is None else {"rmse_after_Nm": held_out * 1e-3, "noise_floor_Nm": 1e-3}
    document = {
        "verdict": verdict,
        "p_value": p_value,
        "mechanisms": [{"id": name, "shaft": "sun", "parameters": []} for name in ids],
        "rivals": [],
        "held_out": after,
        "next_tests": [],
    }
    return {"diagnosis": document, "seconds": 1.0, "extended": None}


NAMED = result("named", 0.001, "windage", held_out=1.1)
OTHER = result("ambiguous", 0.04, "windage", "hysteresis", held_out=1.4)
QUIET, NEAR = result("consistent", 0.3), result("consistent", 0.051)
NOT_MADE: dict[str, Any] = {"diagnosis": None, "seconds": 1.0, "extended": None}


@pytest.mark.parametrize("asked", [0, 1, 3, 7, 1000])
def test_the_first_concealed_go_both_ways_and_a_third_as_many_clean(asked: int) -> None:
    lots = draw_lots(60, 4)
    chosen = both_ways(lots, asked)
    clean = [lot for lot in lots if lot.stratum.kind == "clean"]
    other = [lot for lot in lots if lot.stratum.kind != "clean"]
    assert {lot.number for lot in chosen} == {lot.number for lot in clean[: asked // 3] + other[:asked]}
    assert list(chosen) == sorted(chosen, key=lambda lot: lot.number)


def test_agreement_is_counted_over_the_campaigns_that_can_tell() -> None:
    truths = {0: truth(), 1: truth(0.25), 2: truth(clean=True), 3: truth(), 4: truth(8.0)}
    grid = {0: NAMED, 1: OTHER, 2: QUIET, 3: NAMED, 4: NAMED}
    found = agree(truths, grid, {0: NAMED, 1: NEAR, 2: NEAR, 3: OTHER, 4: NOT_MADE})
    assert found is not None
    figures = {figure.id: figure for figure in found.figures}
    counted = {name: (figure.hits, figure.of) for name, figure in figures.items() if figure.hits is not None}
    assert counted == {
        "same_verdict": (2, 5),
        "same_verdict_clear": (2, 4),
        "same_leading": (1, 4),  # of two that say nothing nothing is counted
        "same_side": (3, 4),  # 0.04 beside 0.051 is another side; one was not made
    }
    low, high = figures["same_verdict"].interval or (0.0, 0.0)
    assert low == pytest.approx(stats.beta.ppf(0.025, 2, 4))
    assert high == pytest.approx(stats.beta.ppf(0.975, 3, 3))
    assert [pair.held_out for pair in found.pairs] == [0.0, None, None, pytest.approx(0.3), None]
    assert figures["held_out_difference"].value == pytest.approx(0.15)
    assert [pair.number for pair in found.pairs if not pair.same_verdict] == [1, 3, 4]
    json.dumps(found.document, allow_nan=False)


def test_the_same_results_agree_in_everything_and_the_order_of_the_ways_changes_only_a_sign() -> None:
    truths, results = {0: truth(), 1: truth(clean=True)}, {0: OTHER, 1: QUIET}
    same = agree(truths, results, results)
    assert same is not None
    assert all(figure.hits == figure.of for figure in same.figures if figure.hits is not None)
    assert same.pairs[0].held_out == 0.0
    there, back = agree(truths, {0: NAMED}, {0: OTHER}), agree(truths, {0: OTHER}, {0: NAMED})
    assert there is not None
    assert back is not None
    assert there.pairs[0].held_out == -(back.pairs[0].held_out or 0.0)
    assert [f.hits for f in there.figures] == [f.hits for f in back.figures]
    assert agree(truths, results, {}) is None


def test_agreement_is_in_document_lines_and_page() -> None:
    truths, results = {0: truth(), 1: truth(clean=True)}, {0: NAMED, 1: QUIET}
    alone, both = summarise(truths, results), summarise(truths, results, {0: OTHER})
    assert scores_document(alone, TOLD)["agreement"] is None
    document = scores_document(both, TOLD)["agreement"]
    assert document["campaigns"] == 1
    assert document["cases"][0]["recordings"]["verdict"] == "ambiguous"
    assert any(line.startswith("same verdict both ways: 0 ") for line in score_lines(both))
    assert not any("both ways" in line for line in score_lines(alone))
    ids = {item.id for item in proof_page(both, TOLD).sections[0].items if hasattr(item, "id")}
    assert "agreement" in ids
    assert scores_document(both, TOLD)["outcomes"] == scores_document(alone, TOLD)["outcomes"], (
        "the way asked for rules"
    )


# --- kept, resumed, sealed ---------------------------------------------------------------------------


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, str, bool]]:
    """Which campaigns go which way, with diagnoses that say nothing in place of real ones."""
    gone: list[tuple[int, str, bool]] = []

    def quick(task: CaseTask) -> dict[str, Any]:
        gone.append((task.lot.number, task.route, task.further))
        kept = {"schema": SCHEMA, "sha256": task.sha256, "route": task.route, "code": task.code}
        return kept | (QUIET if task.lot.stratum.kind == "clean" else NAMED)

    monkeypatch.setattr(stage, "run_case", quick)
    monkeypatch.setattr(stage, "_code_digest", lambda: "0" * 64)
    return gone


def test_second_ways_are_kept_beside_and_resumed(tmp_path: Path, made: list[tuple[int, str, bool]]) -> None:
    first = run_prove(tmp_path, TrialOptions(campaigns=8, seed=4, workers=1))
    assert [entry[1:] for entry in made] == [("grid", True)] * 8
    assert first.data["scores"]["agreement"] is None
    made.clear()
    again = run_prove(tmp_path, TrialOptions(campaigns=8, seed=4, recordings=3, workers=1))
    wanted = [lot.number for lot in both_ways(draw_lots(8, 4), 3)]
    assert len(wanted) == 4
    assert made == [(number, "recordings", False) for number in wanted]
    assert again.data["scores"]["agreement"]["campaigns"] == 4
    lost = tmp_path / "cases" / f"{wanted[1]:04d}-recordings.json"
    sealed = json.loads((tmp_path / "sealed.json").read_text())["sha256"]
    kept = json.loads(lost.read_text())
    assert kept["sha256"] == sealed[wanted[1]]
    lost.write_text(json.dumps(kept | {"sha256": "0" * 64}))
    made.clear()
    assert run_prove(tmp_path, TrialOptions(campaigns=8, seed=4, recordings=3, workers=1)).data["made"] == 1
    assert made == [(wanted[1], "recordings", False)], "a result of another truth is made anew"
    path = tmp_path / "truths" / f"{wanted[1]:04d}.json"
    path.write_text(path.read_text().replace('"kind"', '"Kind"'))
    with pytest.raises(StoreError, match="sealed beforehand"):
        run_prove(tmp_path, TrialOptions(campaigns=8, seed=4, recordings=3, workers=1))


def test_a_quick_trial_is_small_unless_told_otherwise(tmp_path: Path, made: list[tuple[int, str, bool]]) -> None:
    found = run_prove(tmp_path / "quick", TrialOptions(quick=True, workers=1))
    assert len(found.data["scores"]["cases"]) == QUICK[0]
    assert sum(route == "recordings" for _, route, _ in made) == QUICK[1]
    made.clear()
    run_prove(tmp_path / "told", TrialOptions(quick=True, campaigns=5, recordings=0, workers=1))
    assert [route for _, route, _ in made] == ["grid"] * 5
    made.clear()
    run_prove(tmp_path / "files", TrialOptions(quick=True, route="recordings", workers=1))
    assert made == [(number, "recordings", True) for number in range(QUICK[0])], "one way, with its further tests"
    made.clear()
    run_prove(tmp_path / "one", TrialOptions(quick=True, case=3, workers=1))
    assert made == [(3, "grid", True)]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--recordings", "-1"), "--recordings: -1; expected 0 or more"),
        (("--recordings", "2", "--route", "recordings"), "2 with --route recordings; expected --route grid"),
        (("--recordings", "2", "--case", "1"), "2 with --case 1; expected one of the two"),
    ],
)
def test_ways_that_contradict_are_refused(arguments: tuple[str, ...], words: str, tmp_path: Path) -> None:
    found = RUNNER.invoke(app, ["prove", "--out", str(tmp_path / "out"), *arguments])
    assert found.exit_code == 2
    assert words in found.stderr
    assert not (tmp_path / "out").exists()
