"""Another low-pass: what half of it, and twice, say beside what is told."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter
from tests.balance import wheel
from tests.slow import slow

from pmg.pipeline.chapters.explained.machine_sheet import machine_sheet
from pmg.pipeline.commands.machines.terms import run_terms
from pmg.pipeline.diagnosis.balance import borne_out, low_passes
from pmg.pipeline.diagnosis.balance.borne_out import HeldBack, of_no_size, sure_part
from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.document import headline, terms_document
from pmg.pipeline.diagnosis.balance.estimate import Estimate
from pmg.pipeline.diagnosis.balance.library.drive import DRIVE
from pmg.pipeline.diagnosis.balance.library.elastic import LIKE_PLAY, RESONANCE
from pmg.pipeline.diagnosis.balance.low_pass_told import low_pass_remarks, low_pass_sentence
from pmg.pipeline.diagnosis.balance.low_passes import LowPassTried, try_low_passes
from pmg.pipeline.diagnosis.balance.records.reading import KEPT, read_recordings
from pmg.pipeline.diagnosis.balance.records.smoothing import Smoother
from pmg.pipeline.diagnosis.balance.search_record import Searched, search_record
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.machine.channel import PrepareTable
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

    from tests.balance.wheel import Turning

    from pmg.pipeline.commands.outcome import Outcome
    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.estimate import FittedTerms
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.recording.remark import Remark
    from pmg.sim.signals import Array


def dry(m: Turning) -> Array:
    return wheel.plain(m) + 0.05 * np.sign(m.speed)


def ringing(m: Turning) -> Array:
    """Dry friction through a spring that rings at 30 Hz after each reversal, hardly damped."""
    rate, damping = 2.0 * np.pi * 30.0, 0.02
    forward, back = bilinear([rate**2], [1.0, 2.0 * damping * rate, rate**2], wheel.RATE)
    sense = np.sign(m.speed)
    late = sense[0] + lfilter(forward, back, sense - sense[0])
    return np.asarray(wheel.plain(m) + 0.05 * late)


def warned(done: Outcome) -> list[str]:
    told = (finding for finding in done.findings if finding.where == "low_pass_Hz")
    return [finding.message for finding in told if finding.severity != "info"]


def run(folder: Path, torque: object) -> Outcome:
    case = wheel.make_case(folder, torque, terms='["inertia", "viscous"]', seconds=45.0)  # type: ignore[arg-type]
    case.write_text(case.read_text().replace("low_pass_Hz = 40\nkeep_every = 8", "low_pass_Hz = 20\nkeep_every = 10"))
    return run_terms(case, folder / "out")


@slow
def test_a_cause_that_every_low_pass_names_is_told_so(tmp_path: Path) -> None:
    done = run(tmp_path, dry)
    assert not warned(done)
    tried = json.loads((tmp_path / "out" / "terms.json").read_text())["low_passes"]
    assert [(each["low_pass_Hz"], each["keep_every"], each["best"]) for each in tried] == [
        (10.0, 20, ["coulomb"]),
        (40.0, 5, ["coulomb"]),
    ]
    for each in tried:
        (size,) = each["parameters"]
        assert size["value"] == pytest.approx(0.05, abs=4.0 * size["standard_error"] + 0.001)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "With a low-pass of 10 Hz or 40 Hz the search says the same." in page
    assert "Other low-passes" in page


@slow
def test_ringing_that_twice_the_low_pass_lets_in_changes_nothing_of_what_is_named(tmp_path: Path) -> None:
    done = run(tmp_path, ringing)
    assert not warned(done)
    found = json.loads((tmp_path / "out" / "terms.json").read_text())
    assert [cause["id"] for cause in found["causes"]] == ["coulomb"]
    assert [(each["low_pass_Hz"], each["best"]) for each in found["low_passes"]] == [
        (10.0, ["coulomb"]),
        (40.0, ["coulomb"]),
    ]


def test_what_another_low_pass_says_is_told_and_warned_of_where_it_contradicts() -> None:
    """A resonance that twice the low-pass lets in is told; other terms at half of it are a warning, or what to do."""
    friction, resonance, delay = (
        SimpleNamespace(identifier=name, candidate=SimpleNamespace(identifier=name, title=name.capitalize()))
        for name in ("coulomb", RESONANCE, "delay")
    )

    def told(verdict: Verdict, *tried: LowPassTried, hangs: bool = False) -> tuple[str, tuple[Remark, ...]]:
        named = [SimpleNamespace(added="coulomb")] if verdict.names or hangs else []
        found: Any = SimpleNamespace(
            verdict=verdict,
            mismatch=SimpleNamespace(found=verdict is not Verdict.CONSISTENT, false_alarm_rate=0.05),
            low_passes=tried,
            steps=[SimpleNamespace(added=""), *named],
            contests=(),
            impossible=(),
            held_back=HeldBack.LOW_PASS if hangs else None,
            case=SimpleNamespace(prepare=SimpleNamespace(low_pass_hz=20.0)),
        )
        return low_pass_sentence(found), low_pass_remarks(found)

    def at(low_pass: float, *fits: SimpleNamespace, p_value: float = 0.002, explained: bool = True) -> LowPassTried:
        return LowPassTried(low_pass, 10, p_value, cast("tuple[TermFit, ...]", fits), explained)

    sentence, remarks = told(Verdict.NAMED, at(10.0, friction), at(40.0, friction, resonance))
    assert sentence == "Another low-pass: at 10 Hz the search says the same; at 40 Hz more comes in: two_masses."
    assert not remarks
    sentence, remarks = told(Verdict.NAMED, at(10.0, p_value=0.06), at(40.0, resonance, explained=False))
    assert "at 10 Hz no mismatch is seen; at 40 Hz noise or a resonance may have come in: two_masses." in sentence
    assert not remarks
    sentence, remarks = told(Verdict.NAMED, at(10.0, p_value=0.03))
    assert sentence == "Another low-pass: at 10 Hz less is seen: no term."
    assert not remarks
    sentence, remarks = told(Verdict.NAMED, at(10.0, delay, explained=False), at(40.0, friction))
    assert sentence.startswith("It hangs on the low-pass of 20 Hz: at 10 Hz the search names delay, which does not")
    assert "at 40 Hz the search says the same" in remarks[0].message
    sentence, remarks = told(Verdict.NOT_IN_LIBRARY, at(10.0, friction), at(40.0, resonance, explained=False))
    assert sentence == "Another low-pass: at 10 Hz Coulomb may explain it; at 40 Hz the cause stays open as well."
    (remark,) = remarks
    assert remark.message.startswith("At 10 Hz Coulomb may explain it; that is not proved. Run again with low_pass_Hz")
    sentence, remarks = told(Verdict.NOT_IN_LIBRARY, replace(at(10.0, friction), impossible=True))
    assert sentence == "With a low-pass of 10 Hz the cause stays open as well."
    assert not remarks
    sentence, remarks = told(Verdict.CONSISTENT, at(10.0, p_value=0.4), at(40.0, friction))
    assert sentence == "Another low-pass: at 10 Hz the search says the same; at 40 Hz a mismatch is seen."
    assert not remarks
    assert told(Verdict.CONSISTENT) == ("", ())
    others = at(10.0, friction, resonance), at(40.0, friction, resonance)
    sentence, remarks = told(Verdict.NOT_IN_LIBRARY, *others, hangs=True)
    assert sentence.startswith("It hangs on the low-pass of 20 Hz: at 10 Hz more comes in: two_masses; at 40 Hz")
    assert len(remarks) == 1


@pytest.mark.parametrize(("size", "named"), [pytest.param(0.05, True, marks=slow), (-0.05, False)])
def test_a_cause_that_makes_the_withheld_error_larger_is_not_named(tmp_path: Path, size: float, named: bool) -> None:
    """Dry friction, and a withheld recording in which it pushes: of another machine, or with a sign lost."""
    path, rng = wheel.make_case(tmp_path, dry), np.random.default_rng(8)
    other = wheel.turning(rng, 20.0)
    wheel.record(tmp_path / "withheld.csv", other, wheel.plain(other) + size * np.sign(other.speed), rng)
    case = read_case(path)
    found = diagnose_terms(case, *read_recordings(case), np.random.default_rng(1))
    assert found.verdict is (Verdict.NAMED if named else Verdict.NOT_IN_LIBRARY)
    assert found.held_back is (None if named else HeldBack.WORSE_WITHHELD)
    head = (
        "Named: Coulomb" if named else "Nothing is named: Coulomb friction would explain it, but the error on the with"
    )
    assert headline(found).startswith(head)
    sheet = machine_sheet(found, goes_on=False)
    (cause,) = (each for each in sheet.answers if each.question in ("Cause", "Its size"))
    marks = {part.name: part.mark for part in sheet.parts}
    assert marks == {"drive": "", "friction and load": "cause" if named else "possible", "position": ""}
    assert ("Not named: Coulomb friction" in cause.sentences[0]) is not named


def test_what_play_in_a_coupling_would_do_as_well_is_not_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With Coulomb friction in the place of a delay and a mass on a spring; no part of it is tried by itself."""
    assert {term.identifier for term in DRIVE} >= LIKE_PLAY == {"delay", RESONANCE}
    monkeypatch.setattr(borne_out, "LIKE_PLAY", frozenset({"coulomb"}))
    case = read_case(wheel.make_case(tmp_path, dry))
    found = diagnose_terms(case, *read_recordings(case), np.random.default_rng(1))
    assert found.verdict is Verdict.NOT_IN_LIBRARY
    assert found.held_back is HeldBack.LIKE_PLAY
    assert terms_document(found)["held_back"] == "like play"
    assert "Coulomb friction would explain it, but play in a coupling looks the same. Hold the load" in headline(found)


@pytest.mark.parametrize(
    ("term", "sizes", "unknown"),
    [
        ("direction_dependent_coulomb", [(56.0, 54.0)], ["half_difference"]),
        ("direction_dependent_coulomb", [(56.0, 14.0)], []),
        ("position_ripple", [(0.1, 0.2), (2.0, 0.2)], []),
        ("drag_of_power", [(1.0, 3.0)], []),  # at 1 rad/s, far from where it was seen: that goes with its power
    ],
)
def test_a_size_is_known_where_no_few_samples_carry_it(
    term: str, sizes: list[tuple[float, float]], unknown: list[str]
) -> None:
    candidate = next(each for each in DRIVE if each.identifier == term)
    quantities = zip(candidate.parameters, sizes, strict=False)
    estimates = tuple(Estimate(term, q.name, q.unit, value, error, value, error) for q, (value, error) in quantities)
    other = Estimate("inertia", "M", "kg", 1.0, 9.0, 1.0, 9.0)
    fit = SimpleNamespace(identifier=term, candidate=candidate)
    found = SimpleNamespace(fits=(fit,), estimates=(other, *estimates))
    assert [e.name for e in of_no_size(cast("FittedTerms", found))] == unknown


def test_a_cause_whose_size_is_not_known_is_not_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Estimate, "interval", property(lambda e: (e.value - 1.0, e.value + 1.0)))
    case = read_case(wheel.make_case(tmp_path, dry))
    found = diagnose_terms(case, *read_recordings(case), np.random.default_rng(1))
    assert found.held_back is HeldBack.SIZE_UNKNOWN
    assert "a few samples carry it: the size of Coulomb friction is not known, Fc = 0.0" in headline(found)


@pytest.mark.parametrize(
    ("others", "named"),
    [
        ((("delay",), ("delay", "coulomb")), False),
        pytest.param((("coulomb", "backlash"), ("delay", "coulomb")), True, marks=slow),
        ((("coulomb", "backlash"), (RESONANCE, "delay")), True),
        pytest.param((("backlash",), (RESONANCE, "delay")), False, marks=slow),
        pytest.param((("coulomb",), ("delay",)), True, marks=slow),
        pytest.param((("delay",),), True, marks=slow),
        ((("delay",), None), True),
    ],
)
def test_what_neither_half_the_low_pass_nor_twice_names_is_not_named(
    tmp_path: Path, others: tuple[tuple[str, ...] | None, ...], named: bool
) -> None:
    """Coulomb friction that is found; others find what is given, None where they see no mismatch."""
    case = read_case(wheel.make_case(tmp_path, dry, terms='["inertia", "viscous"]'))
    fits = {
        name: SimpleNamespace(identifier=name, candidate=SimpleNamespace(title=name))
        for name in ("coulomb", "delay", "backlash", RESONANCE)
    }
    tried = tuple(
        LowPassTried(20.0 + 60.0 * k, 10, 0.5 if each is None else 0.002, tuple(fits[name] for name in each or ()))  # type: ignore[misc]
        for k, each in enumerate(others)
    )
    found = diagnose_terms(case, *read_recordings(case), np.random.default_rng(1), tried)
    assert found.verdict is (Verdict.NAMED if named else Verdict.NOT_IN_LIBRARY)
    assert found.held_back is (None if named else HeldBack.LOW_PASS)
    assert headline(found).startswith("Named: Coulomb" if named else "Nothing is named: Coulomb friction would explain")


@pytest.mark.parametrize(
    ("friction", "others", "named"),
    [
        pytest.param(0.012, "delay", True, marks=slow),
        pytest.param(0.012, "", False, marks=slow),
        pytest.param(0.03, "delay", False, marks=slow),
    ],
)
def test_what_all_low_passes_name_is_named_where_it_is_most_of_the_mismatch(
    tmp_path: Path, friction: float, others: str, named: bool
) -> None:
    """A ripple with Coulomb friction beside it that no other low-pass names; both name the ripple, or one does.

    Without Stribeck's friction, which would be a rival of the one beside.
    """

    def torque(m: Turning) -> Array:
        return wheel.plain(m) + 0.03 * np.sin(m.angle) + friction * np.sign(m.speed)

    case = read_case(wheel.make_case(tmp_path, torque, channels=f"{wheel.VELOCITY}\n{wheel.ANGLE}\n{wheel.TORQUE}"))
    case = replace(case, library=tuple(term for term in case.library if term.identifier != "stribeck"))
    fits = {
        name: SimpleNamespace(identifier=name, candidate=SimpleNamespace(identifier=name, title=name))
        for name in ("position_ripple", "delay")
    }
    sets = (("position_ripple",), ("position_ripple", others) if others else ("delay",))
    tried = tuple(
        LowPassTried(at, 10, 0.002, tuple(fits[name] for name in each))  # type: ignore[misc]
        for at, each in zip((20.0, 80.0), sets, strict=True)
    )
    found = diagnose_terms(case, *read_recordings(case), np.random.default_rng(1), tried)
    assert found.verdict is (Verdict.NAMED if named else Verdict.NOT_IN_LIBRARY)
    assert [fit.identifier for fit in found.left_out] == ["coulomb"] * named
    if named:
        assert [step.added for step in found.steps[1:]] == ["position_ripple"]
        assert "In the main: " in headline(found)
        assert "Not named: Coulomb friction, which not every quarter" in headline(found)
        assert terms_document(found)["left_out"] == ["coulomb"]


def test_a_part_is_what_every_part_of_the_record_and_every_low_pass_that_is_asked_names(tmp_path: Path) -> None:
    def torque(m: Turning) -> Array:
        return wheel.plain(m) + 0.03 * np.sin(m.angle) + 0.03 * np.sign(m.speed)

    case = read_case(wheel.make_case(tmp_path, torque, channels=f"{wheel.VELOCITY}\n{wheel.ANGLE}\n{wheel.TORQUE}"))
    found = search_record(case, read_recordings(case)[0], np.random.default_rng(1))
    assert {fit.identifier for fit in found.named} == {"coulomb", "position_ripple"}
    both = frozenset({"coulomb", "position_ripple"})
    assert found.found is not None
    alone = replace(found, found=replace(found.found, rivals=()))

    def named(by_parts: frozenset[str], *tried: tuple[float, str, float], of: Searched = alone) -> set[str] | None:
        sets = ((at, tuple(SimpleNamespace(identifier=name) for name in names.split()), p) for at, names, p in tried)
        others = tuple(LowPassTried(at, 10, p, cast("tuple[TermFit, ...]", fits)) for at, fits, p in sets)
        part = sure_part(of, by_parts, case, others)
        return None if part is None else {fit.identifier for fit in part.named}

    assert named(both) is None, "all of it"
    assert named(frozenset({"coulomb", "delay"})) == {"coulomb"}
    assert named(frozenset({"delay"})) is None, "nothing of it"
    assert [rival.ids for rival in found.found.rivals] == [{"stribeck", "position_ripple"}]
    assert named(both, of=found) == {"position_ripple"}, "a rival has another friction"
    half, twice = (20.0, "position_ripple", 0.01), (80.0, f"{RESONANCE} delay", 0.01)
    assert named(both, half, twice) == {"position_ripple"}, "a resonance hides what is lower"
    assert named(both, (20.0, "delay", 0.01), twice) is None
    assert named(both, (20.0, "delay", 0.06), (80.0, "coulomb delay", 0.01)) == {"coulomb"}, "half sees no mismatch"


@pytest.mark.parametrize(
    ("low_pass", "keep", "drop", "tried"),
    [
        (200.0, 1, None, [(100.0, 2, None)]),
        (40.0, 5, 300, [(20.0, 10, 600), (80.0, 3, 300)]),
        (2.0, 100, None, [(4.0, 50, None)]),
    ],
)
def test_the_force_keeps_no_more_than_the_motion_at_another_low_pass(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    low_pass: float,
    keep: int,
    drop: int | None,
    tried: list[tuple[float, int, int | None]],
) -> None:
    """The thinned force holds all up to 0.4 of its rate: at half the low-pass it must be thinned by as much more."""
    case, seen = read_case(wheel.make_case(tmp_path, dry)), []
    given = {"rate_Hz": 500.0, "low_pass_Hz": low_pass, "keep_every": keep, "drop": drop}

    def look(other: Case) -> None:
        seen.append((other.prepare.low_pass_hz, other.prepare.keep_every, other.prepare.drop))
        raise RecordingError("record", "too short", "a longer one", "Record longer.")

    monkeypatch.setattr(low_passes, "read_recordings", look)
    assert not try_low_passes(replace(case, prepare=PrepareTable.model_validate(given)), np.random.default_rng(1))
    assert seen == tried
    assert all(hertz >= 0.99 * KEPT * 500.0 / kept for hertz, kept, _ in seen)


def test_a_low_pass_far_below_the_rate_stays_finite() -> None:
    given = PrepareTable.model_validate({"rate_Hz": 500.0, "low_pass_Hz": 0.5, "order": 8})
    smooth = Smoother(given, 1.0 / 500.0).smooth(np.sin(np.arange(20000.0) / 2e3))
    assert np.abs(smooth[5000:15000] - np.sin(np.arange(5000.0, 15000.0) / 2e3)).max() < 0.01
