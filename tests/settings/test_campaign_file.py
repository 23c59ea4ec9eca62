"""The campaign file: what it may hold, how a fault is told, and what wins where several places set one thing."""

from __future__ import annotations

import json
import math
import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.files.toml import lines_of
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.settings.campaign_file import read_campaign
from pmg.pipeline.settings.chosen import choose
from pmg.pipeline.settings.settings import settings
from pmg.pipeline.settings.template import template
from pmg.pipeline.settings.tolerance import tolerance
from pmg.pipeline.windows.limits import LIMITS, Steadiness
from pmg.pipeline.windows.limits_file import chosen_limits
from pmg.pipeline.wording.quantities import DIMENSIONS, RATIO, TORQUE_OF_SHAFT, quantity
from pmg.sim.errors import BenchError, PmgError
from pmg.sim.signals import RPM

RUNNER = CliRunner()

WHOLE = """\
[recordings]
path = "runs"
campaign = "spring"
[store]
path = "kept"
[windows]
shortest = "1500 ms"
speed_change = "0.75 rpm"   # in the unit of the bench
torque_drift = "2 %"
[analysis]
terms_sun = [0, 1, 2.5]
k_corr = 0.8
robust = true
[compare]
note = '''
two
lines'''
tolerance = { torque_sun = "10 mN m or 2 %", efficiency = "1 %", loss = "500 mW" }
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "campaign.toml"
    path.write_text(WHOLE)
    return path


def test_units_become_si_and_paths_lie_beside_the_file(file: Path) -> None:
    found = read_campaign(file)
    tolerance = found.file.table.tolerances
    assert found.values["recordings.path"] == file.parent / "runs"
    assert found.values["analysis.terms_sun"] == "0,1,2.5"
    assert set(tolerance) == {"torque_sun", "efficiency_total", "loss_total"}
    assert tolerance["torque_sun"] == pytest.approx((0.01, 0.02))
    assert tolerance["efficiency_total"] == pytest.approx((0.01, 0.0))
    assert tolerance["loss_total"] == pytest.approx((0.5, 0.0))
    limits = chosen_limits(choose(file).limits)
    assert limits.shortest == pytest.approx(1.5)
    assert limits.speed_change == pytest.approx(0.75 * RPM)
    assert limits.torque_drift == pytest.approx(0.02)
    assert limits.settle == LIMITS.settle
    options = choose(file).options()
    assert options.powers_sun == (0.0, 1.0, 2.5)
    assert (options.correction, options.robust) == ("0.8", True)


def test_an_option_wins_over_the_file_and_the_file_over_the_default(file: Path) -> None:
    chosen = choose(file, k_corr="rule", robust=False, store=Path("other"))
    found = {setting.key: setting for setting in settings(chosen)}
    assert (found["analysis.k_corr"].value, found["analysis.k_corr"].origin) == ("rule", "--k-corr")
    assert (found["analysis.robust"].value, found["analysis.robust"].origin) == (False, "--no-robust")
    assert found["store.path"].origin == "--store"
    assert found["analysis.terms_sun"].origin == f"{file}:11"
    assert found["analysis.terms_ring"].origin == "default"
    assert found["windows.speed_change"].origin == f"{file}:8"
    assert found["windows.speed_change"].written == '"0.75 rpm"'
    assert found["windows.speed_change"].unit == "rad/s"
    assert found["compare.note"].origin == f"{file}:15"
    assert found["compare.tolerance.loss"].origin == f"{file}:18"
    assert found["compare.tolerance.loss"].value == {"absolute": pytest.approx(0.5), "relative": 0.0}


def test_grids_of_the_command_line_take_the_place_of_recordings_in_the_file(file: Path) -> None:
    chosen = choose(file, grids=Path("grids"))
    assert chosen.path("recordings") is None
    assert chosen.options().powers_sun == (0.0, 1.0, 2.5)
    usual = {setting.key: setting for setting in settings(choose(None, grids=Path("grids")))}
    assert (usual["analysis.k_corr"].value, usual["analysis.k_corr"].origin) == ("0.8", "default for published grids")


def test_without_file_and_options_the_defaults_hold() -> None:
    chosen = choose(None)
    assert chosen.options() == AnalysisOptions()
    assert chosen_limits(chosen.limits) == LIMITS
    assert {setting.origin for setting in settings(chosen)} == {"default"}
    with pytest.raises(BenchError, match="--config"):
        chosen.needed("store")


def test_a_file_of_limits_takes_the_place_of_the_table(file: Path, tmp_path: Path) -> None:
    other = tmp_path / "limits.toml"
    other.write_text("# strict\n[windows]\nsettle = 2.0\nspeed_change_rpm = 0.25\n")
    found = {setting.key: setting for setting in settings(choose(file, limits=other))}
    assert found["windows.speed_change"].value == pytest.approx(0.25 * RPM)
    assert found["windows.speed_change"].origin == f"{other}:4"
    assert found["windows.shortest"].origin == "default"


@pytest.mark.parametrize(
    ("old", "new", "where", "words"),
    [
        ("k_corr", "k_cor", r"line 12, analysis\.k_cor$", "k_corr"),
        ("[analysis]", "[analyse]", r"line 10, analyse$", "analysis"),
        ("speed_change =", "speed_chnge =", "line 8", "speed_change"),
        ('"0.75 rpm"', '"0.75 N m"', "line 8", "a speed"),
        ('"0.75 rpm"', "0.75", "line 8", "speed_change_rpm"),
        ('"2 %"', '"2 %%"', "line 9", "a ratio"),
        ("0.8", "1.8", r"line 12, analysis\.k_corr", "from 0 to 1"),
        ("0.8", '"jont"', r"line 12, analysis\.k_corr", "joint"),
        ("[0, 1, 2.5]", "[0, 0]", r"line 11", "distinct"),
        ("robust = true", 'robust = "yes"', r"line 13", "true or false"),
        ('path = "runs"', 'path = "runs"\ngrids = "g"', "line 3, recordings.grids", "one of the two"),
        ("loss =", "los =", r"line 18, compare\.tolerance\.los", "loss"),
        ('"500 mW"', '"500 mN m"', r"line 18", "a torque"),
        ('"500 mW"', '"500 mW or 1 W"', r"line 18", "at most one"),
        ("loss =", 'efficiency_total = "2 %", loss =', r"line 18", "efficiency_total"),
        ('"500 mW"', '"0 W"', r"line 18", "above 0"),
        ('"1500 ms"', '"16 s"\nfrequency_low = "16 kHz"', "windows", "lower one first"),
        ('path = "kept"', "path = kept", "line 5, column 8", "text stands in quotation marks"),
        ('path = "kept"', r'path = "C:\data"', "line 5", "single quotes"),
        ('path = "kept"', r'path = "C:\users"', "line 5", "single quotes"),
        ("[store]", "[bench]", "line 4, bench$", "unknown key"),
        ('path = "kept"', 'path = ""', r"line 5, store\.path", "a name"),
        ("[store]", "[ingest]\nworkers = 0\n[store]", r"line 5, ingest\.workers", "1 or more"),
    ],
)
def test_a_fault_is_told_with_its_line_and_what_was_expected(
    file: Path, old: str, new: str, where: str, words: str
) -> None:
    assert WHOLE.count(old) >= 1
    file.write_text(WHOLE.replace(old, new, 1))
    with pytest.raises(PmgError) as caught:
        read_campaign(file)
    assert re.search(where, caught.value.where)
    assert words in f"{caught.value.came} {caught.value.expected} {caught.value.do}"


def test_a_mark_of_byte_order_is_no_fault(file: Path) -> None:
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
    assert read_campaign(file).origin("store.path") == f"{file}:5"


def test_the_template_sets_nothing_and_each_of_its_lines_can_be_taken(tmp_path: Path) -> None:
    path = tmp_path / "campaign.toml"
    path.write_text(template())
    assert not read_campaign(path).values
    lines = template().splitlines()
    offers = [n for n, line in enumerate(lines) if re.match(r"# \w+ = ", line)]
    named = {lines[n].split()[1] for n in offers}
    assert all(re.search(r" # \w", lines[n]) for n in offers), "each has its meaning"
    assert {f.name for f in fields(Steadiness)} <= named
    for n in offers:
        path.write_text("\n".join([*lines[:n], lines[n][2:], *lines[n + 1 :]]))
        found = read_campaign(path)
        assert len(found.values) + sum(map(found.count, ("windows", "checks"))) + bool(found.file.table.tolerances) == 1
        assert found.windows in (None, LIMITS)


@given(
    st.floats(-1e6, 1e6).filter(lambda v: v == 0.0 or abs(v) > 1e-6),
    st.sampled_from([(d, unit) for d in DIMENSIONS for unit in d.units]),
)
def test_a_quantity_is_its_number_times_its_unit(value: float, named: tuple[Any, str]) -> None:
    dimension, unit = named
    assert quantity(f"{value!r} {unit}", dimension, "here") == pytest.approx(value * dimension.units[unit], rel=1e-12)
    others = [d for d in DIMENSIONS if unit not in d.units]
    for other in others:
        with pytest.raises(BenchError) as caught:
            quantity(f"{value!r} {unit}", other, "here")
        assert other.name in caught.value.expected
        assert dimension.name in caught.value.came


@given(st.text(max_size=20))
def test_any_text_is_a_quantity_or_refused(text: str) -> None:
    try:
        assert math.isfinite(quantity(text, RATIO, "here"))
    except BenchError:
        with pytest.raises(BenchError):
            quantity(text, RATIO, "here")


@given(st.floats(1e-6, 1e3), st.floats(1e-3, 1e3))
def test_both_parts_of_a_tolerance_are_found_in_either_order(absolute: float, percent: float) -> None:
    for text in (f"{absolute!r} mN m or {percent!r} %", f"{percent!r}% or {absolute!r} mNm"):
        name, parts = tolerance("torque_ring", text, "here")
        assert name == "torque_ring"
        assert parts == pytest.approx((absolute / 1e3, percent / 100.0))


def test_what_is_shown_of_a_tolerance_and_of_terms_is_as_it_may_be_written(file: Path) -> None:
    chosen = choose(file, terms_ring="0,0.3,1")
    told = {setting.key: json.loads(setting.written) for setting in settings(chosen) if setting.written.startswith('"')}
    assert told["compare.tolerance.efficiency"] == "1 %"
    assert told["compare.tolerance.loss"] == "0.5 W"
    for word in ("efficiency", "loss", "torque_sun"):
        name, parts = tolerance(word, told[f"compare.tolerance.{word}"], "here")
        assert parts == pytest.approx(chosen.tolerance[name])
    assert (told["analysis.terms_ring"], told["windows.speed_change"]) == ("0,0.3,1", "0.75 rpm")
    usual = {setting.key: setting.written for setting in settings(choose(None))}
    assert usual["analysis.terms_sun"] == '"0,1/2,1,2"'


def test_a_torque_has_a_unit() -> None:
    with pytest.raises(BenchError, match="no unit"):
        quantity("10", TORQUE_OF_SHAFT, "here")


def test_the_line_of_a_key_is_found_behind_a_list_and_a_text_of_many_lines() -> None:
    """Each in one pass: a parser that begins anew with every line would not end."""
    text = "a = [\n" + "1,\n" * 50_000 + ']\nb = """\n' + '[x] \\""" #\n' * 20_000 + '"""\nc = 1\n'
    assert lines_of(text) == {("a",): 1, ("b",): 50_003, ("c",): 70_005}


def test_the_line_of_each_key_is_found_past_long_values() -> None:
    text = (
        '# head\ntop = 1\n[a."b c"]\nlist = [\n  1, # [x]\n  2,\n]\n'
        'text = """\nk = 3\n[no]\n"""\n'
        "d.e = { f = 1, g = [{ h = 2 }] }\n[[rows]]\nr = 1\n[rows.in]\nq = 1\n[[rows]]\nr = 2\n"
    )
    assert lines_of(text) == {
        ("top",): 2,
        ("a", "b c"): 3,
        ("a", "b c", "list"): 4,
        ("a", "b c", "text"): 8,
        ("a", "b c", "d"): 12,
        ("a", "b c", "d", "e"): 12,
        ("a", "b c", "d", "e", "f"): 12,
        ("a", "b c", "d", "e", "g"): 12,
        ("rows",): 13,
        ("rows", 0): 13,
        ("rows", 0, "r"): 14,
        ("rows", 0, "in"): 15,
        ("rows", 0, "in", "q"): 16,
        ("rows", 1): 17,
        ("rows", 1, "r"): 18,
    }


def call(*arguments: object, expect: int) -> dict[str, Any]:
    outcome = RUNNER.invoke(app, [*map(str, arguments), "--json"])
    assert outcome.exit_code == expect, outcome.output
    result: dict[str, Any] = json.loads(outcome.stdout)
    return result


def test_the_commands_show_check_and_refuse(file: Path) -> None:
    shown = call("config", "show", "--config", file, "--k-corr", "0.7", expect=0)["data"]["settings"]
    assert {s["key"]: s["origin"] for s in shown}["analysis.k_corr"] == "--k-corr"
    told = RUNNER.invoke(app, ["config", "show", "--config", str(file), "--origin"]).stdout
    assert re.search(r'^analysis\.k_corr = "0\.8" +.*campaign\.toml:12$', told, flags=re.MULTILINE)
    checked = call("config", "check", file, expect=0)
    assert checked["data"]["absent"] == ["recordings"]
    call("config", "check", file, "--fail-on", "findings", expect=1)
    made = RUNNER.invoke(app, ["config", "template"])
    assert made.stdout == template()
    file.write_text("[ingest]\nworkrs = 2\n")
    refused = RUNNER.invoke(app, ["config", "check", str(file)])
    assert refused.exit_code == 2
    assert refused.stderr.splitlines()[-1] == "hint: Did you mean 'workers'?"
    assert refused.stderr.splitlines()[-2].endswith("line 2, ingest.workrs: unknown key; expected a known one.")


def test_a_run_takes_its_settings_from_the_file(tmp_path: Path, published_folder: Path) -> None:
    file = tmp_path / "campaign.toml"
    file.write_text(
        f'[recordings]\ngrids = "{published_folder}"\n[store]\npath = "kept"\n[analysis]\nk_corr = 0.9\nrobust = true\n'
        '[compare]\nmodel = "for-the-comparison.toml"\n'
    )
    terms = call("analyse", "--config", file, "--terms-ring", "0,1", expect=0)["data"]["analysis"]
    options = terms["options"]
    assert (options["correction"], options["robust"], options["powers_ring"]) == ("0.9", True, [0.0, 1.0])
    assert (tmp_path / "kept" / "analysis").is_dir()
    error = call("compare", "--config", file, expect=2)["error"]
    assert (error["where"], error["came"]) == ("--report", "missing")
    assert "[report]" in error["expected"]


def test_a_check_tells_every_fault_of_a_file_at_once(tmp_path: Path) -> None:
    path = tmp_path / "campaign.toml"
    path.write_text(
        '[store]\nstoer = "x"\n[ingest]\nworkers = 0\nlimits = "none.toml"\n[checks]\none = "a"\nother = "b"\n'
        '[analysis]\nk_corr = "abc"\n[compare]\ntolerance = { torque_sun = "10 mN", effciency = "1 %" }\n'
        'model = "bad-model.toml"\n'
    )
    (tmp_path / "bad-model.toml").write_text("[baseline]\n")
    done = RUNNER.invoke(app, ["config", "check", str(path), "--json"])
    result = json.loads(done.stdout)
    assert done.exit_code == 2
    told = [result["error"]["where"], *(finding["where"] for finding in result["findings"])]
    faults = " ".join(told)
    for key in ("store.stoer", "ingest.workers", "checks.one", "checks.other", "analysis.k_corr"):
        assert key in faults
    for key in ("compare.tolerance.torque_sun", "compare.tolerance.effciency", "bad-model.toml", "ingest.limits"):
        assert key in faults
    assert len(told) == 9
