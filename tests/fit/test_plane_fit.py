"""What the other shaft does: uniform p-values where it does nothing, planted terms where it does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from tests.points import measured, points

from pmg.pipeline.fit.loss_fit import fit_losses
from pmg.pipeline.fit.plane_fit import FORMS, PlaneFits, _holm, plane_fits
from pmg.pipeline.grid.tables import read_published
from pmg.sim.bench import BenchParameters
from pmg.sim.grid import Grid
from pmg.sim.signals import RPM, Array

SUN, RING = (
    axis.ravel() for axis in np.meshgrid(np.linspace(-1800.0, 1800.0, 12), [-720.0, -400.0, -90.0, 90.0, 400.0, 720.0])
)
NAMES = [name for name, _ in FORMS]


def drawn(rng: np.random.Generator, extra_sun: Array | float = 0.0, extra_ring: Array | float = 0.0) -> Grid:
    at = points("neutral", SUN, RING)
    sun = np.sign(SUN) * (0.02 + 0.1 * np.abs(SUN) / 1872.0)
    ring = np.sign(RING) * (0.1 + 0.2 * np.abs(RING) / 720.0)
    noise = 1e-3 * rng.standard_normal((2, len(at)))
    return measured(at, sun + extra_sun + noise[0], ring + extra_ring + noise[1])


def tried(grid: Grid, bench: BenchParameters) -> PlaneFits:
    return plane_fits(grid, fit_losses(grid, (0.0, 1.0), (0.0, 1.0)), bench)


def test_p_values_are_uniform_where_the_other_shaft_does_nothing(
    rng: np.random.Generator, bench: BenchParameters
) -> None:
    single: dict[str, list[float]] = {name: [] for name in NAMES}
    together, false = [], 0
    for _ in range(200):
        plane = tried(drawn(rng), bench)
        for term in plane.ring.terms:
            if term.tested:
                single[term.name].append(term.p)
        together.append(plane.sun.p)
        false += bool(plane.found)
    assert [name for name, values in single.items() if not values] == ["pole slip"]
    for name, values in (*single.items(), ("together", together)):
        if not values:
            continue
        assert stats.kstest(values, "uniform").pvalue > 1e-3, name
    assert false <= 8


@pytest.mark.parametrize(
    "name", ["direction of the difference", "direction of the pole slip", "difference", "other speed"]
)
def test_a_planted_term_is_found_with_its_size(name: str, rng: np.random.Generator, bench: BenchParameters) -> None:
    own, other = SUN * RPM, RING * RPM
    slip = bench.gear1.pole_pairs_sun * own + bench.gear1.pole_pairs_ring * other
    shapes = {
        "direction of the difference": np.sign(own - other),
        "direction of the pole slip": np.sign(slip),
        "difference": (own - other) / np.abs(own - other).max(),
        "other speed": np.sign(own) * np.abs(other) / np.abs(other).max(),
    }
    plane = tried(drawn(rng, extra_sun=0.004 * shapes[name]), bench)
    term = next(term for term in plane.sun.terms if term.name == name)
    assert term.found
    assert abs(term.size - 0.004) < 4.0 * term.size_u
    assert plane.sun.rmse_plane < plane.sun.rmse_line
    assert not any(shaft == "ring" for shaft, _ in plane.found)


def test_f_is_that_of_two_fits(rng: np.random.Generator, bench: BenchParameters) -> None:
    grid = drawn(rng)
    fit = fit_losses(grid, (0.0, 1.0), (0.0, 1.0)).sun
    term = plane_fits(grid, fit_losses(grid, (0.0, 1.0), (0.0, 1.0)), bench).sun.terms[0]
    design = np.c_[fit.curve.terms(grid.points.speed_sun), np.abs(grid.points.speed_ring) / np.abs(RING * RPM).max()]
    drag = np.sign(SUN) * grid.torque_sun
    coefficients, rss, *_ = np.linalg.lstsq(design, drag, rcond=None)
    before = float(fit.residuals @ fit.residuals)
    dof = len(drag) - 3
    assert term.f == pytest.approx((before - rss[0]) / (rss[0] / dof))
    assert term.size == pytest.approx(coefficients[2])
    assert term.p == pytest.approx(stats.f.sf(term.f, 1, dof))


def test_terms_that_forward_rotation_cannot_split_are_named(rng: np.random.Generator, bench: BenchParameters) -> None:
    grid = drawn(rng)
    forward = grid[np.asarray((SUN > 0) & (RING > 0))]
    terms = {term.name: term for term in tried(forward, bench).sun.terms}
    assert terms["difference"].alike == "other speed"
    assert terms["pole slip"].alike == "other speed"
    assert terms["direction of the pole slip"].alike == "own curve"
    assert not terms["pole slip"].tested


def test_holm_steps_down() -> None:
    np.testing.assert_allclose(_holm(np.array([0.01, 0.04, 0.03, 0.005])), [0.03, 0.06, 0.06, 0.02])
    np.testing.assert_allclose(_holm(np.array([0.9, 0.8])), [1.0, 1.0])
    assert len(_holm(np.array([]))) == 0


def test_an_unread_ring_leaves_the_sun_tested(rng: np.random.Generator, bench: BenchParameters) -> None:
    grid = drawn(rng)
    slow = replace(grid, points=points("neutral", SUN, np.full(len(SUN), 90.0)))
    fits = fit_losses(slow, (0.0, 1.0), (0.0,))
    terms = plane_fits(slow, fits, bench).sun.terms
    assert not any(term.tested for term in terms[:2])


def test_the_published_grids_are_not_one_dimensional(bench: BenchParameters, published_folder: Path) -> None:
    grid = read_published(published_folder, bench)
    plane = plane_fits(grid, fit_losses(grid), bench)
    for fit in (plane.sun, plane.ring):
        friction = next(term for term in fit.terms if term.name == "direction of the difference")
        assert friction.found
        assert 0.004 < friction.size < 0.012
        assert fit.rmse_plane < 0.75 * fit.rmse_line
