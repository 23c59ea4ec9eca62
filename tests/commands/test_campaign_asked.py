"""Which campaign a command is about, where a store holds several."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest

from pmg.pipeline.commands import campaign_asked
from pmg.pipeline.commands.campaign_asked import asked_in_motion
from pmg.pipeline.store.store import MARK
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

HELD = ("grid", "other", "runs")


@pytest.fixture(autouse=True)
def store(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A store of three campaigns, one in motion; the analysis is of the first."""
    held = [SimpleNamespace(ingested=True, campaign=name) for name in HELD]

    def in_motion(manifests: Iterable[SimpleNamespace]) -> bool:
        return {manifest.campaign for manifest in manifests} == {"runs"}

    (tmp_path / MARK).touch()
    monkeypatch.setattr(campaign_asked, "Store", lambda _: SimpleNamespace(manifests=lambda: held))
    monkeypatch.setattr(campaign_asked, "campaigns", lambda _: list(HELD))
    monkeypatch.setattr(campaign_asked, "only_in_motion", in_motion)
    monkeypatch.setattr(campaign_asked, "analysed_campaign", lambda _: "grid")
    return tmp_path


def test_without_a_name_it_is_the_analysed_one(store: Path) -> None:
    assert asked_in_motion(store, None) is None
    assert asked_in_motion(store, "grid") is None


def test_runs_in_motion_are_found_by_their_name(store: Path) -> None:
    assert asked_in_motion(store, "runs") == "runs"


def test_one_that_is_not_analysed_is_asked_for_in_vain(store: Path) -> None:
    with pytest.raises(StoreError, match=r"analysis of campaign 'grid'.*--campaign other"):
        asked_in_motion(store, "other")


def test_one_that_is_not_there_is_told_with_the_nearest(store: Path) -> None:
    with pytest.raises(StoreError, match=r"no campaign 'gird'.*Did you mean 'grid'"):
        asked_in_motion(store, "gird")


def test_without_an_analysis_a_name_is_still_held_against_the_store(
    store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaign_asked, "analysed_campaign", lambda _: None)
    assert asked_in_motion(store, "grid") is None  # it is to be analysed first, as reading the analysis says
    with pytest.raises(StoreError, match="no campaign 'typo'"):
        asked_in_motion(store, "typo")


def test_of_published_grids_the_analysed_campaign_is_known(store: Path) -> None:
    (store / MARK).unlink()
    with pytest.raises(StoreError, match=r"no campaign 'gri'.*Did you mean 'grid'"):
        asked_in_motion(store, "gri")
