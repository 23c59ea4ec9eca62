"""The head of a page whose campaign holds steady points and runs in motion: what both kinds of evidence say."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pmg.pipeline.commands.in_motion.mixed import MixedDiagnosis
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.joint.join import BY_BOTH, JointDiagnosis
from pmg.pipeline.report.action_sheet import ActionSheet, MachinePart, SheetAnswer
from pmg.pipeline.report.document import Headline

STEADY = ActionSheet((SheetAnswer("Verdict", ("No difference found.",)),), (MachinePart("motor", "sun"),))


def mixed(verdict: Verdict, *sets: dict[str, str], tests: tuple[dict[str, Any], ...] = ()) -> MixedDiagnosis:
    """A joint diagnosis that leaves some sets of causes."""
    rows = [
        {"id": name, "component": f"{shaft}_torque_transducer", "shaft": shaft}
        for one in sets
        for name, shaft in one.items()
    ]
    document = {
        "verdict": str(verdict),
        "phrase": "cause named" if verdict is Verdict.NAMED else "several causes fit",
        "statement": "Both kinds differ.",
        "mechanisms": rows,
        "locations": [],
        "next_tests": list(tests),
    }
    joint = JointDiagnosis(verdict, 0.01, sets, BY_BOTH, weights=(1.0 / len(sets),) * len(sets))
    return MixedDiagnosis(joint, document, Outcome({"moving": 3}, ()), alone=("cause named", "no difference found"))


def answers(found: MixedDiagnosis) -> dict[str, tuple[str, ...]]:
    """Answers of the sheet by question."""
    sheet = found.sheet(STEADY)
    assert sheet is not None
    return {each.question: each.sentences for each in sheet.answers}


def test_the_sheet_names_what_both_name_and_marks_its_part() -> None:
    found = mixed(Verdict.NAMED, {"torque_gain_error": "ring"})
    said = answers(found)
    assert said["Verdict"] == ("Cause named.",)
    assert said["Cause"] == ("Gain error of a torque transducer on the ring shaft.",)
    assert said["Evidence"] == (
        "Steady points and runs in motion together name gain error of a torque transducer on the ring shaft.",
    )
    assert said["Each alone"][:2] == ("Steady points: cause named.", "Runs in motion: no difference found.")
    assert "Next test" not in said
    sheet = found.sheet(STEADY)
    assert sheet is not None
    assert [(part.group, part.name) for part in sheet.parts if part.mark == "cause"] == [("ring", "torque transducer")]


def test_the_sheet_of_an_open_question_lists_the_sets_and_the_test() -> None:
    test = {"description": "Reverse the power flow", "minutes": 12.0}
    said = answers(mixed(Verdict.AMBIGUOUS, {"torque_gain_error": "sun"}, {"torque_gain_error": "ring"}, tests=(test,)))
    assert len(said["Possible causes"]) == 2
    assert said["Next test"] == ("Reverse the power flow (12 min).",)


def test_what_to_do_stands_as_the_kind_tells_it_that_leads_with_the_cause() -> None:
    """Without the command for a model of its own, and links to sections of its page, where the page is another one."""
    cause = {"torque_gain_error": "ring"}
    runs = ActionSheet((SheetAnswer("On the bench", ("Calibrate.",), "there"), SheetAnswer("In the model", ("It.",))))
    points = replace(STEADY, answers=(*STEADY.answers, SheetAnswer("On the bench", ("Look.",), "here")))
    for leads, told in ((({}, cause), ("Calibrate.", "")), ((cause, {}), ("Look.", "here")), (({}, {}), None)):
        sheet = replace(mixed(Verdict.NAMED, cause), motion_sheet=runs, leads=leads).sheet(points)
        assert sheet is not None
        found = {each.question: (each.sentences[0], each.grounds) for each in sheet.answers}
        assert found.get("On the bench") == told
        assert "In the model" not in found


def test_points_that_could_not_be_diagnosed_leave_the_words_alone() -> None:
    found = MixedDiagnosis(None, {"statement": "The runs differ.", "phrase": "cause named"}, Outcome({"moving": 1}, ()))
    assert found.sheet(STEADY) is None
    assert found.headline(Headline("No comparison.")).text.startswith("No comparison. Runs in motion: The runs differ.")
