"""Another low-pass: what half of it, and twice, say beside what is told."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter
from tests.balance import wheel

from pmg.pipeline.commands.machines.terms import run_terms
from pmg.pipeline.diagnosis.balance.library.elastic import RESONANCE
from pmg.pipeline.diagnosis.balance.low_pass_told import low_pass_remarks, low_pass_sentence
from pmg.pipeline.diagnosis.balance.low_passes import LowPassTried
from pmg.pipeline.diagnosis.engine.verdict import Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from tests.balance.wheel import Turning

    from pmg.pipeline.commands.outcome import Outcome
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
    return [finding.message for finding in done.findings if finding.where == "low_pass_Hz"]


def run(folder: Path, torque: object) -> Outcome:
    case = wheel.make_case(folder, torque, terms='["inertia", "viscous"]', seconds=45.0)  # type: ignore[arg-type]
    case.write_text(case.read_text().replace("low_pass_Hz = 40\nkeep_every = 8", "low_pass_Hz = 20\nkeep_every = 10"))
    return run_terms(case, folder / "out")


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


def test_a_cause_that_hangs_on_the_low_pass_is_warned_of(tmp_path: Path) -> None:
    """At twice the low-pass the ringing comes in, and another friction seems to be there."""
    done = run(tmp_path, ringing)
    (warning,) = warned(done)
    assert warning.startswith("It hangs on the low-pass of 20 Hz: at 10 Hz the search says the same; at 40 Hz ")
    assert "Stribeck" in warning
    assert "below the first resonance" in warning


def test_what_another_low_pass_says_is_told_and_warned_of_where_it_contradicts() -> None:
    """A resonance that twice the low-pass lets in is told; other terms at half of it are a warning, or what to do."""
    friction, resonance, delay = (
        SimpleNamespace(identifier=name, candidate=SimpleNamespace(identifier=name, title=name.capitalize()))
        for name in ("coulomb", RESONANCE, "delay")
    )

    def told(verdict: Verdict, *tried: LowPassTried) -> tuple[str, tuple[Remark, ...]]:
        named = [SimpleNamespace(added="coulomb")] if verdict.names else []
        found: Any = SimpleNamespace(
            verdict=verdict,
            mismatch=SimpleNamespace(found=verdict is not Verdict.CONSISTENT, false_alarm_rate=0.05),
            low_passes=tried,
            steps=[SimpleNamespace(added=""), *named],
            contests=(),
            impossible=(),
            case=SimpleNamespace(prepare=SimpleNamespace(low_pass_hz=20.0)),
        )
        return low_pass_sentence(found), low_pass_remarks(found)

    def at(low_pass: float, *fits: SimpleNamespace, p_value: float = 0.002, explained: bool = True) -> LowPassTried:
        return LowPassTried(low_pass, 10, p_value, cast("tuple[TermFit, ...]", fits), explained)

    sentence, remarks = told(Verdict.NAMED, at(10.0, friction), at(40.0, friction, resonance))
    assert sentence == "Another low-pass: at 10 Hz the search says the same; at 40 Hz more comes in: two_masses."
    assert not remarks
    sentence, remarks = told(Verdict.NAMED, at(10.0, p_value=0.03), at(40.0, resonance, explained=False))
    assert "at 10 Hz no mismatch is seen; at 40 Hz a resonance comes in" in sentence
    assert not remarks
    sentence, remarks = told(Verdict.NAMED, at(10.0, delay, explained=False), at(40.0, friction))
    assert sentence.startswith("It hangs on the low-pass of 20 Hz: at 10 Hz the search names delay, which does not")
    assert "at 40 Hz the search says the same" in remarks[0].message
    sentence, remarks = told(Verdict.NOT_IN_LIBRARY, at(10.0, friction), at(40.0, resonance, explained=False))
    assert sentence == "Another low-pass: at 10 Hz Coulomb explains it; at 40 Hz the search says the same."
    assert (
        remarks[0].message == "At 10 Hz Coulomb explains it: set low_pass_Hz = 10 and keep_every = 10, and run again."
    )
    sentence, remarks = told(Verdict.CONSISTENT, at(10.0, p_value=0.4), at(40.0, friction))
    assert sentence == "Another low-pass: at 10 Hz the search says the same; at 40 Hz a mismatch is seen."
    assert not remarks
    assert told(Verdict.CONSISTENT) == ("", ())
