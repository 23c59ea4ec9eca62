"""The next runs of a campaign in motion as a sheet: references as they are set, and what each run tells."""

from __future__ import annotations

import csv
import io
import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.diagnosis.test_next_runs import _evidence

from pmg.pipeline.commands.at_bench import next_sheet
from pmg.pipeline.commands.at_bench.motion_sheet import MotionSheet, SheetRun, motion_page, motion_sheet, references_csv
from pmg.pipeline.diagnosis.balance.fitting import TermFit
from pmg.pipeline.diagnosis.engine.explanation import Explanation
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.design.next_runs import NextRun, merged
from pmg.pipeline.diagnosis.motion.design.proposed_run import CHANGE_S, ProposedRun, Reference, Swing, with_runs
from pmg.pipeline.diagnosis.motion.design.torque_apart import torque_apart
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from pathlib import Path

TERMS = {term.key: term for term in library()}
UP = ProposedRun("up", Manoeuvre.RAMP, 30.0, Reference("sun", "speed", (0.0, 10.0, 30.0), (0.0, 900.0 * RPM, 0.0)))
LOADED = ProposedRun(
    "swept",
    Manoeuvre.SWEEP,
    20.0,
    Reference("sun", "speed", (0.0, 20.0), (300.0 * RPM, 300.0 * RPM)),
    Reference("ring", "torque", (0.0, 20.0), (1.5, 1.5), (Swing(0.5, 1.0, 25.0, 5.0, 20.0),)),
)
ZERO = ProposedRun("zero", Manoeuvre.ZERO, 6.0)
BACK = ProposedRun("back", Manoeuvre.RAMP, 30.0, Reference("sun", "speed", (0.0, 15.0, 30.0), (0.0, -900.0 * RPM, 0.0)))


def _sheet(*runs: ProposedRun) -> MotionSheet:
    rows = tuple(SheetRun(float(k), run, 1, {"sun": 4.3e-3}) for k, run in enumerate(runs))
    return MotionSheet("<spring>", (("A test", "Tells one from another."),), rows)


def test_the_csv_has_what_each_drive_is_asked_for() -> None:
    rows = list(csv.DictReader(io.StringIO(references_csv(_sheet(UP, LOADED, ZERO)))))
    first, second, third = ([row for row in rows if row["run"] == str(k)] for k in (1, 2, 3))
    assert [len(each) for each in (first, second, third)] == [3000, 2000, 600]
    assert float(first[1000]["sun_speed_rpm"]) == pytest.approx(900.0)
    assert {(row["ring_speed_rpm"], row["ring_torque_Nm"], row["sun_torque_Nm"]) for row in first} == {("0", "", "")}
    assert {row["configuration"] for row in second} == {"engaged"}
    swung = np.array([float(row["ring_torque_Nm"]) for row in second])
    assert {row["ring_speed_rpm"] for row in second} == {""}
    assert swung[:500] == pytest.approx(1.5)
    assert swung[500:].max() == pytest.approx(2.0, abs=0.02)
    assert {row["sun_speed_rpm"] for row in third} == {"0"}


def test_the_page_lists_the_runs_and_holds_no_script() -> None:
    page = motion_page(_sheet(UP, LOADED, ZERO))
    assert page.count('class="box"') == 3
    assert "sun speed [rpm] 0, to 900 in 10 s" in page
    assert "sun 4.3" in page
    assert "both shafts at rest" in page
    assert "&lt;spring&gt;" in page
    assert "<script" not in page
    assert f"3 runs, {(56.0 + 3.0 * CHANGE_S) / 60.0:.0f} min" in page


def test_causes_lie_apart_by_what_they_do_in_the_run() -> None:
    found = _evidence((0, 1, 2, 5))
    term = TERMS["torque_gain_error/sun/"]
    one, thrice = (TermFit(term, 100.0, 1.0, np.zeros(0), (), np.array([part]), math.nan) for part in (0.01, 0.03))
    (apart,) = torque_apart(found, BACK, (one,), [()])
    whole, first = with_runs(found.baseline, (BACK,))
    torque = np.concatenate([stretch.shaft.torque for stretch in whole.stretches[first:] if stretch.side == "sun"])
    assert apart["sun"] == pytest.approx(0.01 * math.sqrt(np.mean(torque**2)), rel=0.05)
    assert apart.get("ring", 0.0) == 0.0
    both = torque_apart(found, BACK, (thrice,), [(one,), ()])
    shown = TermFit(TERMS["torque_crosstalk/ring/"], 1.0, 1.0, np.zeros(0), (), np.array([0.02]), math.nan)
    (held,) = torque_apart(found, BACK, (shown,), [()])
    assert held["ring"] > 0.0 == held["sun"], "the shaft that is held shows the torque of the other one"
    assert [each["sun"] for each in both] == pytest.approx([2.0 * apart["sun"], 3.0 * apart["sun"]])


def _diagnosis(*next_runs: NextRun) -> Any:  # noqa: ANN401 - stands for a diagnosis
    stretch = SimpleNamespace(run=SimpleNamespace(run=SimpleNamespace(gear=2)))
    return SimpleNamespace(
        campaign="c",
        verdict=Verdict.CONFOUNDED,
        weak=False,
        naming=None,
        next_runs=next_runs,
        confirming=None,
        unseen=(SimpleNamespace(term=TERMS["rotor_inertia/sun/"]),),
        before=SimpleNamespace(stretches=(stretch,)),
    )


def test_a_run_that_shows_several_is_made_once_and_comes_from_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = [NextRun("Ramp", "Ramp: sun", 0.75, (name,), (UP,), 0.9) for name in ("rotor_inertia", "channel_delay")]
    sheet = motion_sheet(_diagnosis(*runs))
    assert len(sheet.runs) == 1
    assert sheet.tests[0][1].startswith("Shows what the campaign cannot see: a mass that the drawing does not have")
    monkeypatch.setattr(next_sheet, "asked_in_motion", lambda *_: "c")
    monkeypatch.setattr(next_sheet, "Store", lambda path: path)
    monkeypatch.setattr(next_sheet, "moving_runs", lambda *_: ())
    given = []

    def diagnosed(store: Path, campaign: str, runs_: object, model: Path | None) -> tuple[Any, None, None]:
        given.append((store, campaign, model))
        return _diagnosis(*runs), None, None

    monkeypatch.setattr(next_sheet, "diagnose_runs", diagnosed)
    done = next_sheet.run_next(tmp_path, tmp_path / "out", "c", tmp_path / "model.toml")
    assert given == [(tmp_path, "c", tmp_path / "model.toml")]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"next.html", "next.csv"}
    assert done.data["runs"] == 1
    monkeypatch.setattr(next_sheet, "diagnose_runs", lambda *_: (_diagnosis(), None, None))
    assert next_sheet.run_next(tmp_path, tmp_path / "none").data["files"] == []
    assert not (tmp_path / "none").exists()


def test_a_named_cause_has_the_sheet_of_the_run_that_confirms_it() -> None:
    found = _evidence((0, 1, 2, 5))
    gain = TermFit(TERMS["torque_gain_error/sun/"], 1.0, 1.0, np.zeros(0), (), np.array([0.02]), math.nan)
    test = NextRun("Ramp back", "Ramp back: sun", 0.75, ("torque_gain_error",), (BACK,), 0.99, ((),))
    diagnosis = _diagnosis()
    diagnosis.confirming, diagnosis.evidence, diagnosis.verdict = test, found, Verdict.NAMED
    diagnosis.naming = SimpleNamespace(best=Explanation((gain,), found.problem), rivals=(), shafts={})
    sheet = motion_sheet(diagnosis)
    assert sheet.tests == (("Ramp back", "Confirms gain of the transducer on the sun shaft. Power 99%."),)
    assert sheet.runs[0].apart["sun"] > 0.0
    page = motion_page(sheet)
    assert "The cause makes" in page
    assert "--store NEW --report REPORT --model model.toml" in page
    assert "same campaign" not in page


def test_a_run_that_tells_several_rivals_keeps_them_all() -> None:
    term = TERMS["rotor_inertia/sun/"]
    rivals = [(TermFit(term, 1.0, 1.0, np.zeros(0), (), np.array([size]), math.nan),) for size in (1.0, 2.0)]
    (whole,) = merged(NextRun("Ramp", "Ramp: sun", 0.75, ("a",), (UP,), 0.9, (rival,)) for rival in rivals)
    assert whole.rivals == tuple(rivals)
