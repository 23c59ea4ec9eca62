"""Cross-checks: every planted contradiction is named with size and limit, and a sound campaign has none."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from tests.grid.checked_campaign import (
    ENGAGED,
    FAULTS,
    HELD_WITH_DITHER,
    NEUTRAL,
    Fault,
    Runs,
    sound_campaign,
    write_campaign,
)
from tests.house import ROOT

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.grid.campaign import choose_campaign
from pmg.pipeline.grid.crosschecks.catalogue import CROSS_CHECKS, CheckedCampaign, cross_check
from pmg.pipeline.grid.crosschecks.contradiction import Action
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.store.manifest import Manifest
from pmg.pipeline.store.store import Store
from pmg.sim.bench import BenchParameters


def checked(folder: Path, runs: Runs, bench: BenchParameters, **actions: str) -> CheckedCampaign:
    write_campaign(folder, runs)
    store = Store(folder / "store")
    ingest(folder, store)
    return cross_check(choose_campaign(store, None)[1], bench, actions)


def rejected(campaign: CheckedCampaign) -> set[str]:
    return {m.file for m in campaign.manifests if any(not w.accepted for w in m.windows)}


def named(campaign: CheckedCampaign, check: str) -> list[str]:
    return [finding.where for finding in campaign.findings if finding.message.startswith(f"{check}:")]


def test_a_sound_campaign_contradicts_nothing(tmp_path: Path, bench: BenchParameters) -> None:
    found = checked(tmp_path, sound_campaign(), bench)
    assert found.findings == ()
    assert rejected(found) == set()


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.what)
def test_a_planted_contradiction_is_named_and_costs_no_other_file(
    fault: Fault, tmp_path: Path, bench: BenchParameters
) -> None:
    runs = sound_campaign()
    file = fault.plant(runs)
    found = checked(tmp_path, runs, bench)
    where = named(found, fault.check)
    assert any(place.startswith(file or "campaign") for place in where), found.findings
    action = next(check.action for check in CROSS_CHECKS if check.name == fault.check)
    assert rejected(found) == ({file} if action is Action.REJECT else set())
    severities = {finding.severity for finding in found.findings}
    assert severities == ({"error"} if action is Action.REJECT else {"warning"})


def test_every_check_has_a_fault_or_a_test_of_its_own() -> None:
    assert {check.name for check in CROSS_CHECKS} - {fault.check for fault in FAULTS} == {"two-encodings"}


def test_the_table_of_the_page_is_that_of_the_checks() -> None:
    page = (ROOT / "pipeline" / "grid" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z-]+)` \|.*\| `(\w+)` \|$", page, flags=re.MULTILINE)
    assert rows == [(check.name, str(check.action)) for check in CROSS_CHECKS]


def test_an_action_of_the_campaign_file_takes_the_place_of_the_default(tmp_path: Path, bench: BenchParameters) -> None:
    runs = sound_campaign()
    file = FAULTS[1].plant(runs)
    found = checked(tmp_path, runs, bench, load="keep")
    assert rejected(found) == set()
    assert named(found, "load")[0].startswith(file)
    assert {finding.severity for finding in found.findings} == {"warning"}


def test_a_doubt_widens_the_uncertainty_by_its_half_width(tmp_path: Path, bench: BenchParameters) -> None:
    runs = sound_campaign()
    file = next(fault for fault in FAULTS if fault.check == "repeats").plant(runs)
    found = checked(tmp_path, runs, bench)
    within = {m.file: m.windows[0].means.sun.within for m in found.manifests}
    assert within[file] == pytest.approx(0.2 / np.sqrt(3.0), rel=0.02)
    assert sum(u > 0.05 for u in within.values()) == 2
    untouched = {m.file: m.windows[0].means.ring.within for m in found.manifests}
    assert max(untouched.values()) < 0.01


def test_a_held_value_with_dither_is_found_in_its_file(tmp_path: Path, bench: BenchParameters) -> None:
    runs = sound_campaign()
    file = HELD_WITH_DITHER(runs)
    found = checked(tmp_path, runs, bench)
    (stuck,) = [m for m in found.manifests if any(f.code is Code.STUCK for f in m.findings)]
    assert stuck.file == file == NEUTRAL
    assert not stuck.windows[0].accepted


def test_two_loads_alone_are_held_against_their_set_points(tmp_path: Path, bench: BenchParameters) -> None:
    runs = {name: one for name, one in sound_campaign().items() if name in (ENGAGED, "15.mcap")}
    FAULTS[1].plant(runs)
    found = checked(tmp_path, runs, bench)
    assert len(named(found, "load")) == 1


def test_checks_see_old_stores(tmp_path: Path, bench: BenchParameters) -> None:
    """A store that holds no effect of spikes says nothing of them, and nothing else is lost."""
    runs = sound_campaign()
    write_campaign(tmp_path, runs)
    store = Store(tmp_path / "store")
    ingest(tmp_path, store)
    manifests = choose_campaign(store, None)[1]
    old = [_without_spikes(manifest) for manifest in manifests]
    assert cross_check(old, bench).findings == ()


def _without_spikes(manifest: Manifest) -> Manifest:
    from pmg.pipeline.store.manifest import manifest_of

    document = manifest.document()
    for window in document["windows"]:
        for side in ("sun", "ring"):
            window["means"][side].pop("spikes")
    return manifest_of(manifest.identifier, document)
