"""Cross-checks: every planted contradiction is named with size and limit, and a sound campaign has none."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType
from tests.grid.checked_campaign import (
    ENGAGED,
    FAULTS,
    HELD_WITH_DITHER,
    NEUTRAL,
    Fault,
    Runs,
    run,
    sound_campaign,
    write_campaign,
)
from tests.house import ROOT
from tests.recording.writer import CALIBRATION, Bench, blocks, tracks, write

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.grid.campaign import choose_campaign
from pmg.pipeline.grid.crosschecks.catalogue import CROSS_CHECKS, CheckedCampaign, cross_check
from pmg.pipeline.grid.crosschecks.contradiction import Action
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.store.manifest import Manifest
from pmg.pipeline.store.store import Store
from pmg.sim.bench import BenchParameters

SOUND = sound_campaign()
Check = Callable[..., CheckedCampaign]


def sound() -> Runs:
    """The runs of a sound campaign, in which a fault may be planted."""
    return dict(SOUND)


@pytest.fixture(scope="module")
def ingested(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of the sound campaign, and their store."""
    folder = write_campaign(tmp_path_factory.mktemp("sound"), SOUND)
    ingest(folder, Store(folder / "store"))
    return folder


@pytest.fixture
def checked(ingested: Path, tmp_path: Path, bench: BenchParameters) -> Check:
    """The cross-checks on runs, of which those unlike the sound ones are written and ingested anew."""

    def check(runs: Runs, **actions: str) -> CheckedCampaign:
        known = SOUND if SOUND.keys() <= runs.keys() else {}
        if known:
            shutil.copytree(ingested, tmp_path, dirs_exist_ok=True)
        changed = {name: one for name, one in runs.items() if one is not known.get(name)}
        write_campaign(tmp_path, changed)
        store = Store(tmp_path / "store")
        for manifest in (path for name in changed for path in store.path.glob(f"sources/{Path(name).stem}-*.json")):
            manifest.unlink()  # of the sound file, which lies elsewhere and is not superseded
        ingest(tmp_path, store)
        return cross_check(choose_campaign(store, None)[1], bench, actions)

    return check


def rejected(campaign: CheckedCampaign) -> set[str]:
    return {m.file for m in campaign.manifests if any(not w.accepted for w in m.windows)}


def named(campaign: CheckedCampaign, check: str) -> list[str]:
    return [finding.where for finding in campaign.findings if finding.message.startswith(f"{check}:")]


def test_a_sound_campaign_contradicts_nothing(checked: Check) -> None:
    found = checked(sound())
    assert found.findings == ()
    assert rejected(found) == set()


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.what)
def test_a_planted_contradiction_is_named_and_costs_no_other_file(fault: Fault, checked: Check) -> None:
    runs = sound()
    file = fault.plant(runs)
    found = checked(runs)
    where = named(found, fault.check)
    assert any(place.startswith(file or "campaign") for place in where), found.findings
    action = Action.REJECT if fault.void else next(c.action for c in CROSS_CHECKS if c.name == fault.check)
    assert rejected(found) == ({file} if action is Action.REJECT else set())
    severities = {finding.severity for finding in found.findings}
    assert severities == ({"error"} if action is Action.REJECT else {"warning"})


def test_every_check_has_a_fault_or_a_test_of_its_own() -> None:
    assert {check.name for check in CROSS_CHECKS} - {fault.check for fault in FAULTS} == {"two-encodings", "versions"}


@pytest.mark.parametrize(("point", "name"), [("P03", "new.mcap"), (None, "new.mcap"), (None, f"corrected/{NEUTRAL}")])
def test_a_corrected_recording_next_to_the_first_one_is_named_with_it(
    point: str | None, name: str, checked: Check, tmp_path: Path
) -> None:
    """Neither counts as a repeat of the other, and nothing is chosen by chance."""
    runs = sound()
    (tmp_path / "corrected").mkdir()
    calibration = CALIBRATION.replace("10003.2", "10007.2")
    runs[NEUTRAL] = replace(runs[NEUTRAL], run=dict(runs[NEUTRAL].run) | {"point": point})
    runs[name] = replace(runs[NEUTRAL], calibration=calibration)
    found = checked(runs)
    assert rejected(found) == {NEUTRAL, name}
    assert {place.split(":")[0] for place in named(found, "versions")} == {NEUTRAL, name}
    assert {finding.severity for finding in found.findings} == {"error"}
    assert f"{NEUTRAL} holds the same run" in " ".join(finding.message for finding in found.findings)
    assert [finding.size for finding in found.findings] == pytest.approx([4e-3, 4e-3], rel=0.01)


def test_the_same_numbers_in_other_bytes_are_a_copy_and_no_other_version(checked: Check) -> None:
    runs = sound()
    runs["new.mcap"] = replace(runs[NEUTRAL], compression=CompressionType.LZ4)
    found = checked(runs)
    assert found.findings == ()
    assert len(rejected(found)) == 1


def test_one_start_for_points_that_nobody_named_tells_nothing(checked: Check) -> None:
    """Where it is that of other points too, as of a recorder that writes the day alone."""
    runs = sound()
    start = {"started_at": "2025-04-23T00:00:00Z", "point": None}
    runs = {name: replace(one, run=dict(one.run) | start, host=(0, 0)) for name, one in runs.items()}
    assert named(checked(runs), "versions") == []


def test_the_table_of_the_page_is_that_of_the_checks() -> None:
    page = (ROOT / "pipeline" / "grid" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z-]+)` \|.*\| `(\w+)` \|$", page, flags=re.MULTILINE)
    assert rows == [(check.name, str(check.action)) for check in CROSS_CHECKS]


def test_an_action_of_the_campaign_file_takes_the_place_of_the_default(checked: Check) -> None:
    runs = sound()
    file = FAULTS[1].plant(runs)
    found = checked(runs, load="keep")
    assert rejected(found) == set()
    assert named(found, "load")[0].startswith(file)
    assert {finding.severity for finding in found.findings} == {"warning"}


def test_a_doubt_widens_the_uncertainty_by_its_half_width(checked: Check) -> None:
    runs = sound()
    file = next(fault for fault in FAULTS if fault.check == "repeats").plant(runs)
    found = checked(runs)
    within = {m.file: m.windows[0].means.sun.within for m in found.manifests}
    assert within[file] == pytest.approx(0.2 / np.sqrt(3.0), rel=0.02)
    assert sum(u > 0.05 for u in within.values()) == 2
    untouched = {m.file: m.windows[0].means.ring.within for m in found.manifests}
    assert max(untouched.values()) < 0.01


def test_a_held_value_with_dither_is_found_in_its_file(checked: Check) -> None:
    runs = sound()
    file = HELD_WITH_DITHER(runs)
    found = checked(runs)
    (stuck,) = [m for m in found.manifests if any(f.code is Code.STUCK for f in m.findings)]
    assert stuck.file == file == NEUTRAL
    assert not stuck.windows[0].accepted


def test_torques_of_shafts_at_rest_tell_no_ratio(checked: Check) -> None:
    """A test of static loads, engaged with both shafts held, is no contradiction and no crash."""
    runs: Runs = {}
    for number in range(8):
        torque = {"sun": 0.1 * number, "ring": 0.26 * number}
        runs[f"{number:02d}.mcap"] = run(number, 0.0, 0.0, torque, configuration="engaged")
    assert checked(runs).findings == ()


def test_loads_that_are_all_at_half_are_told_and_none_is_rejected(checked: Check) -> None:
    runs = sound()
    for name, one in runs.items():
        if "ring_torque_set_Nm" in one.run:
            twice = f"{2.0 * float(one.run['ring_torque_set_Nm'] or 0.0)}"
            runs[name] = replace(one, run=dict(one.run) | {"ring_torque_set_Nm": twice})
    found = checked(runs)
    assert named(found, "load") == ["campaign"]
    assert rejected(found) == set()


def test_set_points_of_the_other_sign_convention_are_told_once(checked: Check) -> None:
    runs = sound()
    for name, one in runs.items():
        if "ring_torque_set_Nm" in one.run and one.run["drive"] == "ring":
            size = (one.run["ring_torque_set_Nm"] or "").lstrip("-")
            runs[name] = replace(one, run=dict(one.run) | {"ring_torque_set_Nm": size})
    found = checked(runs)
    assert named(found, "load") == ["campaign"]
    assert rejected(found) == set()


def test_one_of_three_repeats_is_doubted_and_widened(checked: Check) -> None:
    runs = sound()
    for number in (40, 41):
        again = runs["02.mcap"]
        runs[f"{number}.mcap"] = run(number, 300.0, 120.0, again.torque)
    off = {"sun": runs["40.mcap"].torque["sun"] + 0.2, "ring": runs["40.mcap"].torque["ring"]}
    runs["40.mcap"] = replace(runs["40.mcap"], torque=off)
    found = checked(runs)
    assert [place.split(":")[0] for place in named(found, "repeats")] == ["40.mcap"]
    within = {m.file: m.windows[0].means.sun.within for m in found.manifests}
    assert [file for file, u in within.items() if u > 0.05] == ["40.mcap"]


def test_a_calibration_made_anew_is_told_and_kept(checked: Check) -> None:
    runs = sound()
    for name in list(runs)[-5:]:
        runs[name] = replace(runs[name], calibration=CALIBRATION.replace("10003.2", "10033.2", 1))
    found = checked(runs)
    assert named(found, "calibration") == ["campaign"]
    assert rejected(found) == set()


def test_another_transducer_is_named_and_nothing_is_rejected(checked: Check) -> None:
    runs = sound()
    for name in (NEUTRAL, ENGAGED):
        runs[name] = replace(runs[name], calibration=CALIBRATION.replace("T-sun", "X").replace("10003.2", "10013.2", 1))
    found = checked(runs)
    (finding,) = [each for each in found.findings if each.message.startswith("calibration:")]
    assert finding.where == "campaign"
    assert (
        "2 recordings (03.mcap, ...) name another transducer of the sun, X, than the 36 others (T-sun)"
        in finding.message
    )
    assert rejected(found) == set()


def test_recordings_without_any_serial_number_are_held_against_each_other(checked: Check) -> None:
    nameless = re.sub(r"(?m)^serial = .*\n", "", CALIBRATION)
    runs = {name: replace(one, calibration=nameless) for name, one in sound().items()}
    runs[NEUTRAL] = replace(runs[NEUTRAL], calibration=nameless.replace("10003.2", "10023.2", 1))
    found = checked(runs)
    assert named(found, "calibration") == [NEUTRAL]
    assert rejected(found) == {NEUTRAL}


def test_a_zero_offset_with_unequal_directions_is_no_doubt_about_single_points(
    checked: Check, bench: BenchParameters
) -> None:
    runs = {name: one for name, one in sound().items() if name not in [f"{n}.mcap" for n in range(27, 38)]}
    for name, one in runs.items():
        runs[name] = replace(one, torque={"sun": one.torque["sun"] + 0.1, "ring": one.torque["ring"]})
    reverse = runs["20.mcap"]
    speed, torque = ({side: -value for side, value in part.items()} for part in (reverse.speed, reverse.torque))
    sets = {key: f"{-float(reverse.run[key] or 0.0):g}" for key in ("sun_speed_set_rpm", "ring_speed_set_rpm")}
    sets["ring_torque_set_Nm"] = f"{-float(reverse.run['ring_torque_set_Nm'] or 0.0)}"
    runs["20.mcap"] = replace(
        reverse, speed=speed, torque={"sun": torque["sun"] + 0.2, "ring": torque["ring"]}, run=dict(reverse.run) | sets
    )
    assert named(checked(runs), "torque-balance") == []


@pytest.mark.parametrize("flaw", ["restart", "twice", "held back"])
def test_blocks_that_tell_no_rate_contradict_none(flaw: str, checked: Check) -> None:
    runs = sound()
    one = runs[NEUTRAL]
    began = one.host[0]
    if flaw == "held back":
        runs[NEUTRAL] = replace(one, host=(began, 0))
    else:
        raw = {}
        for topic, (metadata, values) in tracks(one).items():
            own = blocks(one, topic, metadata["dtype"], values)
            raw[topic] = own + (own if flaw == "twice" else own[:4])
        runs[NEUTRAL] = replace(one, raw=raw)
    assert named(checked(runs), "sample-rate") == []


def test_a_shaft_that_rests_before_it_runs_is_not_held(tmp_path: Path) -> None:
    """Noise at rest is a part of that in motion, and no dither."""
    rng = np.random.default_rng(4)
    n = 5000
    line = 0.1 * np.sin(2.0 * np.pi * 120.0 / 500.0 * np.arange(n)) * (np.arange(n) > n // 2)
    for step in (0.0, 2e-4):
        torque = line + rng.normal(0.0, 0.012, n)
        torque = np.round(torque / step) * step if step else torque
        hertz = 10_003.2 + 1000.0 * torque
        spoil = {"/daq/torque_sun/frequency": lambda _, hertz=hertz: hertz}
        write(tmp_path / "a.mcap", Bench(seconds=n / 500.0, spoil=spoil))
        assert Code.STUCK not in {f.code for f in read_recording(tmp_path / "a.mcap").findings}


def test_two_loads_alone_are_held_against_their_set_points(checked: Check) -> None:
    runs = {name: one for name, one in sound().items() if name in (ENGAGED, "15.mcap")}
    FAULTS[1].plant(runs)
    found = checked(runs)
    assert len(named(found, "load")) == 1


def test_checks_see_old_stores(tmp_path: Path, bench: BenchParameters) -> None:
    """A store that holds no effect of spikes says nothing of them, and nothing else is lost."""
    runs = sound()
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


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (9.5493, "which look as if rad/s were read as rpm"),
        (1.0 / 6.0, "which look as if deg/s were read as rpm"),
        (1.3, None),
    ],
)
def test_set_speeds_in_another_unit_are_told_though_every_window_is_off(
    factor: float, words: str | None, checked: Check
) -> None:
    def asked(one: Bench) -> dict[str, str | None]:
        told = {key: one.run[key] for key in ("sun_speed_set_rpm", "ring_speed_set_rpm")}
        return dict(one.run) | {key: f"{float(value or 'nan') / factor:.6f}" for key, value in told.items()}

    runs = {name: replace(one, run=asked(one)) for name, one in sound().items()}
    found = [finding.message for finding in checked(runs).findings if finding.where == "campaign"]
    assert [str(words) in message for message in found] == ([True] if words else [])


@pytest.mark.parametrize(
    ("factor", "read", "asked"),
    [
        (0.10197, "as if kgf m were read as N m", "as if N m were read as kgf m"),
        (1e-3, "as if kN m were read as N m", "as if mN m were read as N m"),
    ],
)
def test_loads_in_another_unit_are_told_with_it(factor: float, read: str, asked: str, checked: Check) -> None:
    runs = sound()
    for name, one in runs.items():
        runs[name] = replace(one, torque={side: factor * torque for side, torque in one.torque.items()})
    told = [finding.message for finding in checked(runs).findings if finding.check == "load" and finding.settle]
    assert len(told) == 1
    assert f"{read}, or the set-points {asked}" in told[0]
