"""reports/own-machine.md: its commands run in their order and print what is quoted."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from tests.walk import assert_as_told, blocks_of

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("nptdms")


def test_the_way_of_a_machine_of_ones_own_is_as_told(tmp_path: Path) -> None:
    assert len(blocks_of("own-machine.md")) == 4
    assert_as_told("own-machine.md", tmp_path)
    found = json.loads((tmp_path / "reports" / "own-machine" / "report" / "terms.json").read_text())
    assert [cause["id"] for cause in found["causes"]] == ["load_friction"]
    page = (tmp_path / "reports" / "own-machine" / "report" / "report.html").read_text(encoding="utf-8")
    assert "<dt>Verdict</dt>\n<dd>Cause named: friction that grows with the transmitted torque" in page
    assert "<dt>If ignored</dt>" in page
    assert found["models"][-1]["relative_error_withheld"] < 0.4 * found["models"][0]["relative_error_withheld"]
