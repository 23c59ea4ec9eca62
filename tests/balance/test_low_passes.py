"""Another low-pass: what half of it, and twice, say beside what is told."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter
from tests.balance import wheel

from pmg.pipeline.commands.terms import run_terms

if TYPE_CHECKING:
    from pathlib import Path

    from tests.balance.wheel import Turning

    from pmg.pipeline.commands.outcome import Outcome
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
    assert warning.startswith("It hangs on the low-pass of 20 Hz: at 10 Hz the same; at 40 Hz ")
    assert "Stribeck" in warning
    assert "below the first resonance" in warning
