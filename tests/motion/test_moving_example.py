"""reports/motion.md: its commands run in their order and print what is quoted, and the cause of raw/moving is found."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from tests.conftest import ROOT
from tests.slow import slow
from tests.walk import assert_as_told, blocks_of

if TYPE_CHECKING:
    from pathlib import Path


@slow
def test_its_cause_is_named_with_its_size_on_the_way_that_is_told(tmp_path: Path) -> None:
    assert len(blocks_of("motion.md")) == 4
    assert_as_told("motion.md", tmp_path)
    found: dict[str, Any] = json.loads((tmp_path / "reports" / "motion" / "report" / "diagnosis.json").read_bytes())
    truth = (ROOT / "raw" / "moving" / "TRUTH.md").read_text(encoding="utf-8")
    (size_told,) = re.findall(r"pole angle by ([0-9.]+) mN m", truth)
    (mechanism,) = found["mechanisms"]
    (size,) = (each for each in mechanism["parameters"] if each["name"] == "in_all")
    assert (found["verdict"], mechanism["id"]) == ("named", "gear_hysteresis")
    assert abs(size["value"] - 1e-3 * float(size_told)) < 2.0 * size["standard_error"]
    assert found["held_out"]["rmse_after_Nm"] < 0.5 * found["held_out"]["rmse_before_Nm"]
