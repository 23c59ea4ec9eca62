"""Scenarios: what a file may say, and how a fault in it is reported."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from tests.conftest import ROOT

from pmg.pipeline.analysis.outputs import write_analysis
from pmg.pipeline.files.json_values import PROOF
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import THESIS_OPTIONS, chosen_options
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.simulate.inputs import gather_inputs, unproven_losses
from pmg.pipeline.simulate.scenario_file import read_scenario
from pmg.sim.bench import BenchParameters
from pmg.sim.dynamics.constants import Control
from pmg.sim.errors import BenchError, PmgError
from pmg.sim.signals import REVOLUTION, RPM
from pmg.sim.steady.power_chain import MotorConvention

SCENARIOS = sorted((ROOT / "raw" / "scenarios").glob("*.toml"))

GOOD = """
[bench]
gear = 1
[losses]
none = true
[assumptions]
sensor_lag = 0.02
[point]
speed_sun_rpm = 600
torque_ring_Nm = 1.5
[transient]
duration_s = 2
[transient.sun]
ramp = { to_Nm = 1, over_s = 0.5 }
[response]
side = "sun"
[output]
rate_Hz = 100
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "bench.toml"
    path.write_text(text)
    return path


def test_what_a_good_file_says_is_read(tmp_path: Path) -> None:
    scenario = read_scenario(written(tmp_path, GOOD)).table
    assert scenario.assumptions.sensor_lag == 0.02
    assert scenario.point is not None
    assert scenario.point.torque_ring_nm == 1.5
    assert scenario.transient is not None
    assert scenario.transient.sun is not None
    assert scenario.transient.sun.ramp is not None
    assert scenario.transient.sun.ramp.to == 1.0
    assert scenario.output.rate_hz == 100.0


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_each_scenario_that_ships_is_sound_and_explained(path: Path) -> None:
    assert read_scenario(path).table.title
    assert path.read_text().startswith("# ")


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ("to_Nm", "too_Nm", "transient.sun.ramp.too_Nm", "Did you mean 'to_Nm'?"),
        ("sensor_lag", "sensorlag", "assumptions.sensorlag", "Did you mean 'sensor_lag'?"),
        ("[response]", "[respons]", "respons", "Did you mean 'response'?"),
        ("gear = 1", "geer = 1", "bench.geer", "Did you mean 'gear'?"),
        ("rate_Hz", "rate_hz", "output.rate_hz", "Did you mean 'rate_Hz'?"),
        ("gear = 1", "gear = 3", "bench.gear", "1 to 2"),
        ("gear = 1", "gear = 1.0", "bench.gear", "a whole number"),
        ("0.02", "20.0", "assumptions.sensor_lag", "1e-05 to 10 s"),
        ("0.02", '"0.02"', "assumptions.sensor_lag", "1e-05 to 10 s"),
        ("sensor_lag = 0.02", 'motor_signs = "thessis"', "assumptions.motor_signs", "Did you mean 'thesis'?"),
        ("sensor_lag = 0.02", "carrier_in_map = 1", "assumptions.carrier_in_map", "true or false"),
        ("duration_s = 2", 'duration_s = "2"', "transient.duration_s", "a number"),
        ("duration_s = 2", "duration_s = -2", "transient.duration_s", "1e-06 to 1e+06 s"),
        ("duration_s = 2", "duration_s = nan", "transient.duration_s", "1e-06 to 1e+06 s"),
        ("duration_s = 2", "", "transient.duration_s", "Add duration_s."),
        ("to_Nm = 1,", "to_Nm = true,", "transient.sun.ramp.to_Nm", "a number"),
        ("to_Nm = 1,", "", "transient.sun.ramp.to_Nm", "Add to_Nm."),
        ("to_Nm", "to_rpm", "transient.sun.ramp.to_rpm", "to_Nm, as control_sun is torque"),
        ("ramp =", "hold_Nm = 1\nramp =", "transient.sun", "exactly one of hold, ramp"),
        ("ramp = { to_Nm = 1, over_s = 0.5 }", "", "transient.sun", "exactly one of hold, ramp"),
        ("gear = 1", 'control_sun = "sped"', "bench.control_sun", "Did you mean 'speed'?"),
        ("gear = 1", 'configuration = "zero"', "bench.configuration", '"engaged" or "neutral"'),
        ("gear = 1", 'held = "sum"', "bench.held", "Did you mean 'sun'?"),
        ("gear = 1", 'held = "sun"', "bench.held", "expected [transient] and [response]"),
        ('side = "sun"', 'side = "son"', "response.side", "Did you mean 'sun'?"),
        ("none = true", "", "losses", "exactly one of grids, analysis, model, none"),
        ("none = true", 'grids = "a"\nanalysis = "b"', "losses", "exactly one of grids, analysis, model, none"),
        ("none = true", "none = true\nb = 0.0", "losses.b", "a source of losses"),
        ("none = true", 'grids = "a"\nK_corr = 1.5', "losses.K_corr", "0 to 1"),
        ("[losses]\nnone = true", "", "losses", "Add losses."),
        ("torque_ring_Nm = 1.5", "", "point", "speed_sun_rpm and torque_ring_Nm"),
        ("speed_sun_rpm = 600", "speed_ring_rpm = 600", "point", "torque_ring_Nm and torque_sun_Nm"),
        ("rate_Hz = 100", "rate_Hz = 1e9", "output.rate_Hz", "1 to 100000 Hz"),
        ("rate_Hz = 100", 'formats = ["xlsx"]', "output.formats[1]", "'csv', 'parquet' or 'mcap'"),
        ("[output]", "[grid]\nspeed_sun_rpm = [1]\n[output]", "grid.load_Nm", "Add load_Nm."),
        ("[output]", "[grid]\nspeed_sun_rpm = []\nload_Nm = [1]\n[output]", "grid.speed_sun_rpm", "at least one"),
        ("[output]", '[map]\nfem = "a"\ncogging_sun_Nm = 0.1\n[output]', "map.cogging_sun_Nm", "Take one out."),
        ("[output]", "[map]\nharmonics = { 1 = 0.1 }\n[output]", "map.harmonics", "whole orders from 2"),
        ("gear = 1", 'control_sun = "speed"\nconfiguration = "neutral"\nheld = "ring"', "transient", "to_rpm"),
        ("gear = 1", 'held = "ring"\n[map]\n[assumptionz]', "assumptionz", "Did you mean 'assumptions'?"),
    ],
)
def test_a_fault_is_told_with_its_place(old: str, new: str, key: str, words: str, tmp_path: Path) -> None:
    assert old in GOOD
    path = written(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(BenchError) as told:
        read_scenario(path)
    assert re.match(rf"{re.escape(str(path))}: (line \d+, )?{re.escape(key)}", told.value.where)
    assert words in str(told.value)


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("[losses]\nnone = true\n", "", "Add one of these tables."),
        ("[losses]\nnone = true\n[response]\n", "response", "with [point] or [transient]"),
        (
            '[bench]\nconfiguration = "neutral"\n[losses]\nnone = true\n[point]\nspeed_sun_rpm = 1\n',
            "point",
            "speed_ring_rpm and speed_sun_rpm in neutral",
        ),
        (
            '[bench]\nheld = "ring"\n[losses]\nnone = true\n[assumptions]\ncarrier_in_map = false\n'
            "[transient]\nduration_s = 1\n",
            "assumptions.carrier_in_map",
            "Take one of them out.",
        ),
        (
            "[losses]\nnone = true\n[transient]\nduration_s = 1e5\n[output]\nrate_Hz = 1e3\n",
            "output.rate_Hz",
            "at most 2000000 samples",
        ),
        (
            f"[losses]\nnone = true\n[grid]\nspeed_sun_rpm = {[*range(90)]}\nload_Nm = {[*range(90)]}\n"
            "[output]\nseconds = 100.0\n",
            "output.seconds",
            "Record less, or leave mcap out.",
        ),
        (
            "[losses]\nnone = true\n[transient]\nduration_s = 1\n"
            "[transient.ring]\npoints = { times_s = [0, 2, 1], values_Nm = [0, 1, 2] }\n",
            "transient.ring.points.times_s",
            "Sort them.",
        ),
    ],
)
def test_tables_that_contradict_each_other_are_told(text: str, key: str, words: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    with pytest.raises(BenchError) as told:
        read_scenario(path)
    assert re.fullmatch(rf"{re.escape(str(path))}(: line \d+, {re.escape(key)})?", told.value.where)
    assert told.value.where.endswith(key)
    assert words in str(told.value)


@pytest.mark.parametrize(
    ("data", "place"),
    [
        (b"[bench]\ngear = \n", "line 2, column 8"),
        (b"[bench]\ngear = 1\ngear = 2\n", "line 3"),
        (b'[bench]\nname = "', "line 2"),
    ],
)
def test_what_is_not_toml_is_told_by_its_line(data: bytes, place: str, tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_bytes(data)
    with pytest.raises(BenchError) as told:
        read_scenario(path)
    assert told.value.where.startswith(f"{path}: {place}")


def test_a_file_that_is_no_text_or_not_there_is_told(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_bytes(b"\xff\xfe")
    for bad, words in ((path, "UTF-8"), (tmp_path / "none.toml", "no such file")):
        with pytest.raises(BenchError, match=words):
            read_scenario(bad)


@pytest.mark.parametrize(
    ("table", "known"),
    [
        ("[grid]\nloda_Xm = 1", "load_Nm"),
        ("[transient.sun.ramp]\nfrobnicate = 1", "begin_s, over_s, start_rpm, to_rpm"),
        ("[transient.ring.ramp]\nfrobnicate = 1", "begin_s, over_s, start_Nm, to_Nm"),
    ],
)
def test_the_known_keys_are_those_of_the_file(tmp_path: Path, table: str, known: str) -> None:
    text = f'[bench]\ncontrol_sun = "speed"\n[losses]\nnone = true\n{table}\n'
    with pytest.raises(BenchError) as told:
        read_scenario(written(tmp_path, text))
    assert known in told.value.do


# --- what a scenario names -----------------------------------------------------------------------------


def test_programmes_come_out_in_si(tmp_path: Path, bench: BenchParameters) -> None:
    (tmp_path / "r.csv").write_text("t, n\n0, 0\n1, 300\n2, 600\n")
    text = (
        '[bench]\nconfiguration = "neutral"\ncontrol_ring = "speed"\n[losses]\nnone = true\n'
        '[assumptions]\nmotor_signs = "thesis"\nderivative_filter = 1e6\n[transient]\nduration_s = 4\n'
        "[transient.sun]\nhold_Nm = 0.1\n"
        "sweep = { amplitude_Nm = 0.2, from_Hz = 5, to_Hz = 10, begin_s = 1.0, over_s = 2.0 }\n"
        '[transient.ring]\nrecorded = { file = "r.csv", time = "t", value = "n" }\n'
    )
    inputs = gather_inputs(read_scenario(written(tmp_path, text)), bench)
    assert inputs.ring.value(1.5) == pytest.approx(450.0 * RPM)
    assert inputs.sun.value(0.5) == 0.1
    (sweep,) = inputs.sun.sweeps
    assert (sweep.frequency_begin, sweep.frequency_end) == pytest.approx((5.0 * REVOLUTION, 10.0 * REVOLUTION))
    assert inputs.drivetrain.control_ring is Control.SPEED
    assert inputs.drivetrain.assumptions.motor_signs is MotorConvention.THESIS
    assert inputs.drivetrain.mechanisms == ()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("t,n\n0,0\n1,x\n", "line 3, column n: 'x'"),
        ("t,n\n0,0\n2,1\n1,2\n", "line 4, column t: 1 s after 2 s"),
        ("t,m\n0,0\n", "Known: m, t."),
        ("t,n\n", "no rows"),
        ("", "not a table"),
    ],
)
def test_a_recorded_programme_with_a_fault_is_told(
    table: str, words: str, tmp_path: Path, bench: BenchParameters
) -> None:
    (tmp_path / "r.csv").write_text(table)
    text = "[losses]\nnone = true\n[transient]\nduration_s = 1\n[transient.sun]\n"
    text += 'recorded = { file = "r.csv", time = "t", value = "n" }\n'
    with pytest.raises(BenchError) as told:
        gather_inputs(read_scenario(written(tmp_path, text)), bench)
    assert words in str(told.value)


def test_losses_set_by_hand_are_taken_and_the_rest_is_calibrated(
    tmp_path: Path, bench: BenchParameters, published_folder: Path
) -> None:
    whole = f'grids = "{published_folder.as_posix()}"\nK_corr = 0.7\nb = 1e-4\nc = 2e-4\nd = 0.0\nterms_sun = "0,1/2,1"'
    part = f'grids = "{published_folder.as_posix()}"\nc = 2e-4'
    models = []
    for losses in (whole, part):
        file = read_scenario(written(tmp_path, GOOD.replace("none = true", losses)))
        model = gather_inputs(file, bench).losses
        assert model is not None
        models.append(model)
    assert (models[0].correction, models[0].b, models[0].c, models[0].d) == (0.7, 1e-4, 2e-4, 0.0)
    assert models[0].curve_sun.powers == (0.0, 0.5, 1.0)
    assert (models[1].correction, models[1].c) == (0.8, 2e-4)


def test_a_scenario_chooses_the_weights_of_the_damping_constants(
    tmp_path: Path, bench: BenchParameters, published_folder: Path
) -> None:
    grids = f'grids = "{published_folder.as_posix()}"\nK_corr = 0.8\n'
    found = {}
    for word in ("", 'damping = "bisquare"\n', 'damping = "least-squares"\n'):
        file = read_scenario(written(tmp_path, GOOD.replace("none = true", grids + word)))
        model = gather_inputs(file, bench).losses
        assert model is not None
        found[word] = model.c
    default, bisquare, plain = found.values()
    assert default == bisquare != plain
    with pytest.raises(BenchError, match=r"losses\.damping.*least-squares"):
        read_scenario(written(tmp_path, GOOD.replace("none = true", grids + 'damping = "huber"')))


def test_a_scenario_may_leave_the_terms_to_the_data_and_fit_robustly(
    tmp_path: Path, bench: BenchParameters, published_folder: Path
) -> None:
    grids = f'grids = "{published_folder.as_posix()}"\n'
    terms = 'terms_sun = "auto"\nterms_ring = "auto"\n'
    chosen = terms + "robust = true\n"
    hand = "K_corr = 0.8\nb = 0.0\nc = 2e-4\nd = 0.0\n"
    options = chosen_options(published=True, terms_sun="auto", terms_ring="auto", robust=True)
    analysis = analyse(read_published(published_folder, bench), options, bench)
    assert analysis.calibration is not None
    assert analysis.fits is not None
    joint, robust = analysis.calibration.model.curve_sun, analysis.fits.sun.curve
    for losses, expected, told in ((chosen, joint, "not robustly"), (chosen + hand, robust, "fitted robustly")):
        text = GOOD.replace("none = true", grids + losses)
        inputs = gather_inputs(read_scenario(written(tmp_path, text)), bench)
        assert inputs.losses is not None
        assert inputs.losses.curve_sun.powers == expected.powers
        assert inputs.losses.curve_sun.coefficients == pytest.approx(expected.coefficients, rel=1e-6)
        assert told in dict(inputs.facts)["Losses"]
        assert "by the data" in dict(inputs.facts)["Powers of speed in the curves"]
    least = gather_inputs(read_scenario(written(tmp_path, GOOD.replace("none = true", grids + terms + hand))), bench)
    assert least.losses is not None
    assert least.losses.curve_sun.coefficients != pytest.approx(robust.coefficients, rel=1e-3)


def test_robust_beside_a_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"losses\.robust"):
        read_scenario(written(tmp_path, GOOD.replace("none = true", "none = true\nrobust = true")))


def test_losses_may_come_from_a_stored_analysis(tmp_path: Path, bench: BenchParameters, published_folder: Path) -> None:
    analysis = analyse(read_published(published_folder, bench), THESIS_OPTIONS, bench)
    assert analysis.calibration is not None
    write_analysis(analysis, tmp_path / "store", bench)
    file = read_scenario(written(tmp_path, GOOD.replace("none = true", 'analysis = "store"')))
    model = gather_inputs(file, bench).losses
    assert model is not None
    assert model.c == pytest.approx(analysis.calibration.model.c, rel=1e-9)
    assert model.curve_sun.coefficients == pytest.approx(analysis.calibration.model.curve_sun.coefficients)
    assert not unproven_losses(file)
    summary = tmp_path / "store" / "analysis" / "analysis.json"
    summary.write_text(
        json.dumps({key: value for key, value in json.loads(summary.read_text()).items() if key != PROOF})
    )
    (remark,) = unproven_losses(file)
    assert (remark.severity, remark.where) == ("warning", str(summary))


def test_a_harmonic_and_cogging_reach_the_map(tmp_path: Path, bench: BenchParameters) -> None:
    text = GOOD + "[map]\nharmonics = { 3 = 0.05 }\ncogging_sun_Nm = 0.02\ncogging_sun_order = 12\n"
    coupling = gather_inputs(read_scenario(written(tmp_path, text)), bench).drivetrain.coupling
    assert coupling is not None
    assert not coupling.follows_phase
    assert 12 in coupling.orders_sun


def test_sources_that_are_not_there_are_told(tmp_path: Path, bench: BenchParameters) -> None:
    for losses in ('grids = "none"', 'analysis = "none"', 'grids = "."\nterms_sun = "0,fast"'):
        file = read_scenario(written(tmp_path, GOOD.replace("none = true", losses)))
        with pytest.raises(PmgError):
            gather_inputs(file, bench)
    file = read_scenario(written(tmp_path, GOOD + '[map]\nfem = "none.csv"\n'))
    with pytest.raises(PmgError, match="no such file"):
        gather_inputs(file, bench)


@pytest.mark.parametrize("name", ["y" * 5000, "y/" * 3000], ids=["a name", "a path"])
def test_a_name_that_no_file_can_have_is_told(name: str, tmp_path: Path, bench: BenchParameters) -> None:
    file = read_scenario(written(tmp_path, GOOD.replace("none = true", f'grids = "{name}"')))
    with pytest.raises(PmgError, match=r"cannot be the name of a file: .*too long") as told:
        gather_inputs(file, bench)
    assert len(str(told.value)) < 600
