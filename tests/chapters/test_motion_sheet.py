"""What the sheet of a campaign in motion says: what an error costs, in which runs it acts."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pmg.pipeline.chapters.in_motion import action_sheet
from pmg.pipeline.chapters.in_motion.action_sheet import _confirming, _costs, _runs
from pmg.sim.signals import Array

DRAG: Any = SimpleNamespace(
    candidate=SimpleNamespace(of_transducer=False, constants=(), component="sun_bearings", identifier="drag")
)


@dataclass(frozen=True)
class StretchOfRun:
    """What the sheet asks of a stretch."""

    name: str
    coupled: bool
    torque: Array
    side: str = "sun"
    at_rest: bool = False

    def __len__(self) -> int:
        return len(self.torque)

    def of_rows(self, fine: Array) -> Array:
        """Every sample is a row."""
        return fine

    @property
    def run(self) -> Any:  # noqa: ANN401 - stands for a run
        """The run, by its name."""
        return SimpleNamespace(run=SimpleNamespace(name=self.name))


def costs(*parts: tuple[bool, Array, Array, Array]) -> str:
    """Sentence of stretches, each by whether it is engaged, its torque and speed, and the error of its torque."""
    traces: Any = tuple(
        SimpleNamespace(stretch=StretchOfRun(str(i), coupled, torque), state=SimpleNamespace(speed=speed))
        for i, (coupled, torque, speed, _) in enumerate(parts)
    )
    (said,) = _costs((DRAG,), (tuple(effect for *_, effect in parts),), traces)
    return said


def test_watts_and_share_are_both_rms_and_the_peak_stands_by_itself() -> None:
    torque, speed, effect = np.array([1.0, 3.0]), np.array([10.0, 20.0]), np.array([0.1, 0.2])
    neutral = False, np.zeros(2), np.array([100.0, 100.0]), np.array([0.1, 0.12])
    rms, carried = np.sqrt((1.0 + 16.0) / 2.0), np.sqrt((100.0 + 3600.0) / 2.0)
    said = costs((True, torque, speed, effect), neutral)
    assert f"{rms:.2g} W rms on the sun shaft under load, {rms / carried:.1%} of the rms power carried there" in said
    assert said.endswith("the largest error at any one time is 12 W.")
    without_load = costs(neutral)
    assert f"is wrong by {np.sqrt((100.0 + 144.0) / 2.0):.2g} W rms on the sun shaft; the largest" in without_load


def test_a_named_cause_is_confirmed_in_the_run_that_shows_most_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    off = {"first": {"sun": 0.01, "ring": 0.02}, "second": {"sun": 0.0314, "ring": 0.03}}
    monkeypatch.setattr(action_sheet, "torque_apart", lambda _, run, *__: [off[run]])
    monkeypatch.setattr(action_sheet, "named_fits", lambda _: ())
    test = SimpleNamespace(title="Load steps, engaged", minutes=2.0, runs=("first", "second"))
    diagnosis: Any = SimpleNamespace(evidence=None, confirming=test)
    assert _confirming(diagnosis) == (
        "To confirm: load steps, engaged (2 min), compared with `model.toml`; without the cause its sun torque would "
        "be off by 31.4 mN m rms. Its sheet: `pmg next --store STORE --out DIR`."
    )
    assert _confirming(SimpleNamespace(confirming=None)).startswith("Not needed; to confirm the cause, record")  # type: ignore[arg-type]


def test_the_runs_in_which_an_effect_acts_are_counted_where_they_are_not_all() -> None:
    none, some = np.zeros(2), np.ones(2)
    stretches: Any = (
        *(StretchOfRun(name, coupled=name[0] == "E", torque=none) for name in ("N1", "N2", "E1", "E2")),
        StretchOfRun("N1", coupled=False, torque=none, side="ring"),
        StretchOfRun("Z", coupled=False, torque=none, at_rest=True),
    )

    def said(*acting: int) -> str:
        return _runs(stretches, tuple(some if i in acting else none for i in range(len(stretches))), "sun")

    assert said(0, 1, 2, 3) == "all runs"
    assert said(0, 1) == "all neutral runs"
    assert said(2, 3, 4) == "all engaged runs"
    assert said(3) == "1 of 2 engaged runs"
    assert said(0, 3) == "2 of 4 runs"
    assert said(5) == "the recordings at rest"
    assert said() == said(4) == "no run"
