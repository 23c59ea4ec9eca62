"""Every sample that a damaged file lost is followed to the points that it cost, by machine."""

from __future__ import annotations

from typing import Any

import pytest

from pmg.pipeline.recording.findings import Finding
from pmg.pipeline.windows.steadiness import CHECKS, gaps

from .chain import HARMS, Harm, follow

COST = ("A", "B", "BCD", "CD", "BC", "DE", "CDE", "CDE", "ABCDE", "C", "DE", "C", "B", "C", "C")
"""Points that each damage costs: those with a sample of it, or with a step."""
BY_NAME = {harm.name: harm for harm in HARMS}


@pytest.mark.parametrize(
    ("harm", "cost"), [*zip(HARMS, COST, strict=True)], ids=lambda each: getattr(each, "name", each)
)
def test_the_chain_from_bytes_to_points_has_no_gap(harm: Harm, cost: str) -> None:
    """Lost samples in a finding, points with the reason in window, grid and analysis, the others as they were."""
    chain = follow(harm)
    assert chain.broken == ()
    assert chain.lost or harm.spoilt != (0, 0)
    assert "".join(chain.touched) == cost


def test_a_link_that_is_taken_out_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the points not reached, of the window's check, of the samples in the findings, of what analyse tells."""
    harm = BY_NAME["cut between chunks"]
    monkeypatch.setattr("pmg.pipeline.grid.completeness.unreached_findings", lambda _: ())
    assert follow(harm).broken == ("point D is gone, and nothing says so", "point E is gone, and nothing says so")
    monkeypatch.undo()
    harm = BY_NAME["values that are no numbers"]
    monkeypatch.setattr("pmg.pipeline.windows.windows.CHECKS", tuple(check for check in CHECKS if check is not gaps))
    assert any("window C is accepted with 100 samples" in link for link in follow(harm).broken)
    monkeypatch.undo()
    plain = Finding.to_dict

    def without_samples(finding: Finding) -> dict[str, Any]:
        return {key: value for key, value in plain(finding).items() if key != "sample_range"}

    monkeypatch.setattr(Finding, "to_dict", without_samples)
    assert follow(harm).broken == ("samples 2300 to 2400 are lost and in no finding",)
