"""reports/own-machine.md: its commands run in their order and print what is quoted."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from tests.conftest import ROOT
from tests.test_tutorial import blocks, missing

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("nptdms")


def test_the_way_of_a_machine_of_ones_own_is_as_told(tmp_path: Path) -> None:
    told = blocks((ROOT / "reports" / "own-machine.md").read_text(encoding="utf-8"))
    assert len(told) == 4
    (tmp_path / "raw").symlink_to(ROOT / "raw")
    (tmp_path / "pmgw").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m pmg.pipeline "$@"\n')
    (tmp_path / "pmgw").chmod(0o755)
    done = subprocess.run(
        ["sh", "-e"],
        input="".join(f"{block.script}\necho '@@ end of block {i}'\n" for i, block in enumerate(told)),
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": f"{ROOT / '.typing'}{os.pathsep}{ROOT}", "OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    printed = re.split(r"^@@ end of block \d+\n", done.stdout, flags=re.MULTILINE)
    assert len(printed) == len(told) + 1, done.stdout
    for block, lines in zip(told, printed, strict=False):
        lacks = missing(block.quoted, lines)
        assert lacks is None, f"not printed: {lacks}\n--- printed:\n{lines}"
    found = json.loads((tmp_path / "reports" / "own-machine" / "report" / "terms.json").read_text())
    assert [cause["id"] for cause in found["causes"]] == ["load_friction"]
    page = (tmp_path / "reports" / "own-machine" / "report" / "report.html").read_text(encoding="utf-8")
    assert "<dt>Verdict</dt>\n<dd>Cause named: friction that grows with the transmitted torque" in page
    assert "<dt>If ignored</dt>" in page
    assert found["models"][-1]["relative_error_withheld"] < 0.4 * found["models"][0]["relative_error_withheld"]
