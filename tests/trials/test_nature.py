"""The proving bench: its laws, the sizes of what it conceals, its seals, and that it shares nothing with the models."""

from __future__ import annotations

import ast
import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.conftest import ROOT
from tests.trials.strata_by_name import find_stratum

from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.recording.write import rated_calibration
from pmg.pipeline.trials.absorb import CEILING, Yardstick, scale_on
from pmg.pipeline.trials.design import ORDERS, POLE_PAIRS, RATIO, CampaignDesign, acting, draw_design
from pmg.pipeline.trials.effect import BenchRun, Effect, torques
from pmg.pipeline.trials.forms_thermal import _two_nodes
from pmg.pipeline.trials.nature import ConcealedCampaign, _draw_effect, draw_case, measure_case, seal_truth
from pmg.pipeline.trials.record import _bench_calibration, _record_case, write_case
from pmg.pipeline.trials.strata import FORMS, LIBRARY_FORMS, strata
from pmg.pipeline.trials.world import FASTEST_SUN, World, draw_world
from pmg.sim.bench import BenchParameters
from pmg.sim.signals import Array

SECRET = ("mechanisms", "losscurve", "lossmodel", "steady", "dynamics")
"""Rooms and modules of sim that this bench must not know."""
PLACED = [(form.identifier, shaft) for form in FORMS for shaft in form.components]
DRAGS = {form.identifier for form in FORMS if form.drag is not None}
ENGAGED_ONLY = {
    "load_dependent_bearing_friction",
    "engaged_dry_friction",
    "eddy_skin_effect",
    "load_dependent_iron_loss",
    "magnet_temperature",
    "outside_saturating_load_speed",
    "outside_load_speed_corner",
}
MOSTLY_ABSORBED = {
    "windage",
    "stribeck_mixed_lubrication",
    "engaged_dry_friction",
    "eddy_skin_effect",
    "magnet_temperature",
    "outside_saturating_load_speed",
}
"""What a free baseline takes up nearly whole, so that one sigma of it may lie beyond what a bench could have."""


def scene_of(rng: np.random.Generator, order: str | None = None) -> BenchRun:
    return BenchRun(draw_design(rng, order=order), draw_world(rng))


def sized(identifier: str, shaft: str, scene: BenchRun, rng: np.random.Generator, size: float = 4.0) -> Effect:
    return scale_on(Yardstick(scene), _draw_effect(identifier, shaft, scene, rng), size).effect


def changes(scene: BenchRun, effect: Effect) -> tuple[Array, Array]:
    """What an effect changes in the readings of sun and ring [N m]."""
    with_it, without = torques(scene, (effect,))[1], torques(scene, ())[1]
    return with_it[0] - without[0], with_it[1] - without[1]


# --- laws ----------------------------------------------------------------------------------------------


def test_drag_is_against_rotation_and_nothing_turns_at_the_zero_checks(rng: np.random.Generator) -> None:
    for _ in range(20):
        scene = scene_of(rng)
        at, (sun, ring) = scene.design.at, scene.drags
        for drag, speed in ((sun, at.speed_sun), (ring, at.speed_ring)):
            assert np.all(drag[speed != 0.0] * speed[speed != 0.0] > 0.0)
            assert not np.any(drag[speed == 0.0])
        applied = torques(scene, ())[0]
        assert not np.any(applied[0][at.zero])
        assert not np.any(applied[1][at.zero])


def test_the_loss_is_the_power_of_all_drag_whatever_the_flow(rng: np.random.Generator) -> None:
    scene = scene_of(rng)
    at, (sun, ring) = scene.design.at, scene.drags
    t_s, t_r = torques(scene, ())[0]
    np.testing.assert_allclose(t_s * at.speed_sun + t_r * at.speed_ring, sun * at.speed_sun + ring * at.speed_ring)
    backwards = at.engaged & (at.drive == "ring")
    assert np.all(t_r[backwards] * at.speed_ring[backwards] > 0.0)
    assert np.all(t_r[at.engaged & (at.drive == "sun")] * at.speed_ring[at.engaged & (at.drive == "sun")] < 0.0)


@pytest.mark.parametrize(("identifier", "shaft"), [pair for pair in PLACED if pair[0] in DRAGS])
def test_losses_stay_positive_with_a_large_effect(identifier: str, shaft: str, rng: np.random.Generator) -> None:
    for _ in range(8):
        scene = scene_of(rng)
        at = scene.design.at
        t_s, t_r = torques(scene, (sized(identifier, shaft, scene, rng, 8.0),))[0]
        loss = t_s * at.speed_sun + t_r * at.speed_ring
        assert np.all(loss[~at.zero] > 0.0)


def test_two_thermal_nodes_follow_their_equations(rng: np.random.Generator) -> None:
    scene = scene_of(rng)
    still = BenchRun(scene.design, replace(scene.world, drift=0.0))
    nodes = (0.5, 0.8, 120.0, 1500.0)
    n = len(scene.design.at)
    rise = _two_nodes(still, np.full(n, 20.0), nodes, 10.0)
    c_in, c_out = nodes[2] / nodes[0], nodes[3] / nodes[1]
    between = np.diff(scene.design.elapsed)
    stop = int(np.argmax(between > 120.0)) if np.any(between > 120.0) else n - 1  # up to the first pause

    def slope(t: float, y: Array) -> list[float]:
        across = (y[0] - y[1]) / nodes[0]
        return [(20.0 - across) / c_in, (across - y[1] / nodes[1]) / c_out]

    times = scene.design.elapsed[: stop + 1] + 2.5
    exact = solve_ivp(slope, (0.0, times[-1]), [10.0, 10.0], t_eval=times, rtol=1e-9, atol=1e-9).y[0]
    np.testing.assert_allclose(rise[: stop + 1], exact, rtol=1e-6)


# --- what an effect touches ----------------------------------------------------------------------------


@pytest.mark.parametrize(("identifier", "shaft"), PLACED)
def test_an_effect_changes_only_what_it_should(identifier: str, shaft: str, rng: np.random.Generator) -> None:
    scene = scene_of(rng)
    effect = sized(identifier, shaft, scene, rng)
    at = scene.design.at
    sun, ring = changes(scene, effect)
    assert np.any(sun) or np.any(ring)
    if identifier in DRAGS:
        assert not np.any(sun[at.zero])
        assert not np.any(ring[at.zero | at.engaged]), "the ring motor holds its load"
        if shaft == "sun":
            assert not np.any(ring)
        if shaft == "ring":
            assert not np.any(sun[at.neutral])
    else:
        assert shaft == "both" or not np.any(ring if shaft == "sun" else sun)
        bare, faulty = torques(scene, ())[0], torques(scene, (effect,))[0]
        np.testing.assert_array_equal(bare, faulty)
    if identifier in ENGAGED_ONLY:
        assert not np.any(sun[~at.engaged])
    if identifier == "residual_magnetic_coupling":
        assert not np.any(sun[at.engaged])


def test_crosstalk_and_gain_leave_the_free_bench_at_zero_and_an_offset_does_not(rng: np.random.Generator) -> None:
    scene = scene_of(rng, "random")
    zero = np.flatnonzero(scene.design.at.zero)
    for identifier, seen in (("torque_gain_error", False), ("torque_zero_offset", True)):
        sun, _ = changes(scene, sized(identifier, "sun", scene, rng))
        assert bool(np.any(sun[zero])) is seen


# --- sizes ---------------------------------------------------------------------------------------------


def left_by_lstsq(scene: BenchRun, effect: Effect) -> float:
    """Size after absorption by another way: least squares on rows written out one by one [N m]."""
    at, world = scene.design.at, scene.world
    d_sun, d_ring = changes(scene, effect)
    rows, values = [], []
    for i in range(len(at)):
        w_s, w_r = float(at.speed_sun[i]), float(at.speed_ring[i])
        on_sun = [np.sign(w_s) * abs(w_s) ** p for p in (0.0, 0.5, 1.0, 2.0)]
        on_ring = [np.sign(w_r) * abs(w_r) ** p for p in (0.0, 0.5, 1.0, 2.0)]
        if at.zero[i]:
            rows += [[0.0] * 11, [0.0] * 11]
            values += [d_sun[i], d_ring[i]]
        elif at.engaged[i]:
            k, own_s, own_r = world.bearing_part, world.sun.drag(at.speed_sun[i]), world.ring.drag(at.speed_ring[i])
            shared = [k * x for x in on_sun] + [-k * x / RATIO for x in on_ring]
            magnetic = [np.sign(w_s) - np.sign(w_r) / RATIO, w_s - w_r / RATIO]
            rows.append([*shared, *magnetic, float(own_s - own_r / RATIO)])
            values.append(d_sun[i] - d_ring[i] / RATIO)
        else:
            if w_s != 0.0:
                rows.append([*on_sun, *([0.0] * 7)])
                values.append(d_sun[i])
            if w_r != 0.0:
                rows.append([*([0.0] * 4), *on_ring, 0.0, 0.0, 0.0])
                values.append(d_ring[i])
    a, y = np.array(rows), np.array(values)
    scale = np.linalg.norm(a, axis=0)
    residual = y - a @ (np.linalg.lstsq(a / scale, y, rcond=1e-12)[0] / scale)
    return float(np.sqrt(np.mean(residual**2)))


@pytest.mark.parametrize(("identifier", "shaft"), PLACED)
def test_an_effect_is_as_large_as_asked_for_or_says_that_it_is_not(
    identifier: str, shaft: str, rng: np.random.Generator
) -> None:
    for size in (0.25, 2.0):
        scene = scene_of(rng)
        scaled = scale_on(Yardstick(scene), _draw_effect(identifier, shaft, scene, rng), size)
        if scaled.limited:
            assert identifier in MOSTLY_ABSORBED
            assert scaled.reached < size
        else:
            assert scaled.reached == pytest.approx(size, rel=0.02)
        sigma = scene.world.sigma(scene.design)
        assert left_by_lstsq(scene, scaled.effect) == pytest.approx(scaled.reached * sigma, rel=2e-3, abs=1e-8)
        assert scaled.touched <= CEILING * 1.01
        assert scaled.effect.size <= scaled.effect.form.most


def test_a_free_baseline_takes_up_the_bare_bench(rng: np.random.Generator) -> None:
    """What is left of a bench without effects is too little to be seen: a tenth of a point's uncertainty."""
    for _ in range(50):
        yardstick = Yardstick(scene_of(rng))
        left = yardstick.left(yardstick.bare)
        assert np.sqrt(np.mean(left**2)) < 0.15 * yardstick.sigma


def test_what_is_absorbed_whole_may_be_missed(rng: np.random.Generator) -> None:
    hidden, open_to_all = (draw_case(find_stratum(f"{name} sun 2"), rng) for name in ("windage", "torque_gain_error"))
    assert hidden.effects[0].limited
    assert "consistent" in hidden.expected
    assert "consistent" not in open_to_all.expected


def test_raw_sizes_count_before_absorption(rng: np.random.Generator) -> None:
    case = draw_case(find_stratum("rising order, torque_zero_drift sun 4"), rng)
    (scaled,) = case.effects
    assert scaled.raw == pytest.approx(4.0, rel=0.02)
    assert scaled.reached < 1.0
    assert not scaled.limited


# --- design and noise ----------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ORDERS)
def test_a_design_runs_what_the_recorded_campaigns_ran(order: str, rng: np.random.Generator) -> None:
    design = draw_design(rng, order=order)
    at = design.at
    assert len(at) == 288
    assert len(set(at.name)) == len(at)
    assert int(at.zero.sum()) == 5
    assert int((at.drive == "ring").sum()) == 12
    assert int((at.speed_sun < 0.0).sum()) == 6
    assert sum(str(name).endswith("_rep") for name in at.name) == 10
    gaps = np.diff(at.started_at)
    assert np.all((gaps >= 29.9) & (gaps <= 421.0))
    np.testing.assert_allclose(at.speed_sun[at.engaged], -RATIO * at.speed_ring[at.engaged])
    neutral = at[at.neutral & ~np.char.endswith(at.name, "_rep") & (at.speed_sun >= 0.0)]
    follows = np.corrcoef(np.arange(len(neutral)), neutral.speed_sun)[0, 1]
    assert (abs(follows) > 0.95) == (order in ("rising", "falling"))


def test_a_short_design_has_no_repeats_and_a_one_way_design_no_reversed_flow(rng: np.random.Generator) -> None:
    short, one_way = draw_design(rng, extended=False), draw_design(rng, one_way=True)
    assert len(short.at) == 207 + 48
    assert not short.at.zero.any()
    assert not (one_way.at.drive == "ring").any()
    assert not (one_way.at.load_set < 0.0).any()


def test_the_wander_has_its_size_and_its_memory(rng: np.random.Generator) -> None:
    noise = replace(draw_world(rng).noise, correlation=0.4, growth=0.0, outliers=0)
    chain = noise.wander_of(np.zeros(200_000), FASTEST_SUN, rng)
    assert chain.std() == pytest.approx(noise.wander, rel=0.02)
    assert np.corrcoef(chain[1:], chain[:-1])[0, 1] == pytest.approx(0.4, abs=0.01)
    grown = replace(noise, growth=1.5).wander_of(np.full(200_000, FASTEST_SUN), FASTEST_SUN, rng)
    assert grown.std() == pytest.approx(noise.wander * np.sqrt(2.5), rel=0.02)


def test_readings_scatter_about_the_truth_by_the_stated_uncertainty(rng: np.random.Generator) -> None:
    score: list[float] = []
    for _ in range(10):
        case = draw_case(find_stratum("torque_gain_error sun 2"), rng)
        grid = measure_case(case, rng)
        rows, _ = acting(case.design.at)
        u, _ = case.world.uncertainties(case.design)
        loss = (
            grid.torque_sun
            - case.shown[0]
            - np.where(case.design.at.engaged, 1.0 / RATIO, 0.0) * (grid.torque_ring - case.shown[1])
        )
        score += list((loss / u)[rows])
    assert np.std(score) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("gear", [1, 2])
def test_power_is_balanced_in_either_stage(rng: np.random.Generator, gear: int) -> None:
    """What both motors put in is what the drags take out, whatever the ratio of the stage."""
    case = draw_case(find_stratum("clean"), rng)
    rows = case.design.at.engaged
    sun = np.abs(case.design.at.speed_sun[rows])
    at = case.design.at[rows]
    ratio = (13 / 5, 11 / 7)[gear - 1]
    at = replace(at, gear=np.full(len(at), gear), speed_sun=sun, speed_ring=-sun / ratio)
    scene = BenchRun(replace(case.design, at=at), case.world)
    (t_s, t_r), _ = torques(scene, ())
    d_s, d_r = scene.drags
    w_s, w_r = scene.speeds
    np.testing.assert_allclose(t_s * w_s + t_r * w_r, d_s * w_s + d_r * w_r, rtol=1e-9)


# --- cases, seals, recordings --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def case() -> ConcealedCampaign:
    return draw_case(find_stratum("lubricant_viscosity ring 4"), np.random.default_rng(5))


def test_the_same_seed_gives_the_same_bytes(case: ConcealedCampaign) -> None:
    again = draw_case(case.stratum, np.random.default_rng(5))
    other = draw_case(case.stratum, np.random.default_rng(6))
    assert seal_truth(again.truth) == seal_truth(case.truth)
    assert seal_truth(other.truth)[1] != seal_truth(case.truth)[1]
    one, two = (measure_case(case, np.random.default_rng(1)) for _ in range(2))
    np.testing.assert_array_equal(one.torque_sun, two.torque_sun)
    first, second = (next(_record_case(case, np.random.default_rng(2))) for _ in range(2))
    assert first == second
    assert next(_record_case(case, np.random.default_rng(3))) != first


def test_a_truth_is_sealed_and_complete(case: ConcealedCampaign) -> None:
    text, digest = seal_truth(case.truth)
    assert digest == hashlib.sha256(text.encode("utf-8")).hexdigest()
    truth = json.loads(text)
    assert len(bytes.fromhex(truth["nonce"])) == 16
    assert truth["effects"][0]["id"] == "lubricant_viscosity"
    assert truth["effects"][0]["component"] == "ring_bearings"
    assert truth["effects"][0]["reached_sigma"] == pytest.approx(4.0, rel=0.02)
    assert truth["world"] == json.loads(json.dumps(asdict(case.world)))
    gone = np.array(truth["points"]["torque_ring_Nm"]) - np.array(truth["points"]["torque_ring_without_Nm"])
    np.testing.assert_allclose(gone, case.shown[1] - case.bare[1], atol=2e-7)


def test_recordings_hold_the_campaign_and_not_its_truth(case: ConcealedCampaign, tmp_path: Path) -> None:
    few = np.flatnonzero(case.design.at.engaged | case.design.at.zero)[:6]
    part = CampaignDesign(case.design.at[few], "random", extended=True, one_way=False)
    short = replace(case, design=part, effects=())
    write_case(short, tmp_path, np.random.default_rng(4))
    paths = sorted(tmp_path.iterdir())
    assert [path.name for path in paths] == [f"{i:04d}.mcap" for i in range(len(few))]
    for i, path in enumerate(paths):
        content = path.read_bytes()
        for secret in (case.nonce, "lubricant", "viscosity", case.stratum.name):
            assert secret.encode() not in content
        read = read_recording(path)
        assert read.run is not None
        assert read.run.campaign == case.campaign
        assert read.samples is not None
        torque = read.samples["torque_sun"].to_numpy()
        assert len(torque) == 2500
        assert torque.std() == pytest.approx(case.world.noise.white_sun, rel=0.1)
        assert torque.mean() == pytest.approx(short.shown[0][i], abs=6e-3)


def test_every_stratum_can_be_drawn(rng: np.random.Generator) -> None:
    kinds = strata()
    assert len({stratum.name for stratum in kinds}) == len(kinds)
    for stratum in kinds:
        if stratum.size in (0.0, 2.0):
            case = draw_case(stratum, rng)
            found = [(scaled.effect.form.identifier, scaled.effect.shaft) for scaled in case.effects]
            assert found == list(stratum.effects)
            grid = measure_case(case, rng)
            assert np.all(np.isfinite(grid.torque_sun + grid.torque_ring))


def test_pinned_knobs_are_pinned(rng: np.random.Generator) -> None:
    case = draw_case(find_stratum("one-way flow, torque_gain_error ring 2"), rng)
    assert case.effects[0].effect.knobs["quadratic"] == 0.02


# --- beside the project's models -----------------------------------------------------------------------


def test_every_mechanism_that_shows_in_means_has_a_form() -> None:
    from pmg.sim.mechanisms import CANDIDATES

    assert {form.identifier for form in LIBRARY_FORMS} == {mechanism.identifier for mechanism in CANDIDATES}


def test_the_proving_bench_is_built_like_the_real_one(bench: BenchParameters, rng: np.random.Generator) -> None:
    pairs = tuple((round(gear.pole_pairs_sun), round(gear.pole_pairs_ring)) for gear in (bench.gear1, bench.gear2))
    assert pairs == POLE_PAIRS
    ours, rated = _bench_calibration(), rated_calibration(bench)
    assert (ours.sun.nominal_torque, ours.ring.nominal_torque) == (rated.sun.nominal_torque, rated.ring.nominal_torque)
    world: World = draw_world(rng)
    assert world.noise.outliers == 0


def test_no_formula_of_the_models_is_imported() -> None:
    """Read from the source: not even an import hidden in a function, nor through another module of the pipeline."""
    seen: set[str] = set()
    trials = ROOT / "pipeline" / "trials"
    waiting = sorted([*trials.glob("*.py"), *(trials / "motion").glob("*.py")])
    while waiting:
        path = waiting.pop()
        tree = ast.parse(path.read_text(encoding="utf-8"))
        checked = {id(part) for node in ast.walk(tree) if is_guard(node) for part in ast.walk(node)}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and id(node) not in checked and (node.module or "").startswith("pmg."):
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                continue
            for name in names:
                parts = name.split(".")
                assert not (parts[:2] == ["pmg", "sim"] and len(parts) > 2 and parts[2] in SECRET), f"{path}: {name}"
                if parts[:2] == ["pmg", "pipeline"] and name not in seen:
                    seen.add(name)
                    source = ROOT.joinpath(*parts[1:-1]).with_suffix(".py")
                    waiting += [source] if source.is_file() else []
    assert any("recording" in name for name in seen)


def is_guard(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
