"""The campaign in motion that ships: its cause is found."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from tests.conftest import ROOT
from tests.slow import slow

from pmg.pipeline.commands.compare import run_all
from pmg.pipeline.settings.chosen import choose

if TYPE_CHECKING:
    from pathlib import Path

MOVING = ROOT / "raw" / "moving"


@slow
def test_its_cause_is_named_with_its_size(tmp_path: Path) -> None:
    run_all(choose(None, recordings=MOVING, store=tmp_path / "store", report=tmp_path / "report"), lambda *_: None)
    found: dict[str, Any] = json.loads((tmp_path / "report" / "diagnosis.json").read_bytes())
    (told,) = re.findall(r"pole angle by ([0-9.]+) mN m", (MOVING / "TRUTH.md").read_text(encoding="utf-8"))
    (mechanism,) = found["mechanisms"]
    (size,) = (each for each in mechanism["parameters"] if each["name"] == "in_all")
    assert (found["verdict"], mechanism["id"]) == ("named", "gear_hysteresis")
    assert abs(size["value"] - 1e-3 * float(told)) < 2.0 * size["standard_error"]
    assert found["held_out"]["rmse_after_Nm"] < 0.5 * found["held_out"]["rmse_before_Nm"]
