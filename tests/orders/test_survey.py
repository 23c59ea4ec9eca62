"""Lines over a campaign: planted mechanisms are recognised by order and growth, noise is not."""

from __future__ import annotations

import math

import numpy as np
import polars as pl
import pytest

from pmg.pipeline.orders.point import Span, orders_of_point
from pmg.pipeline.orders.survey import COGGING, ECCENTRICITY, MISALIGNMENT, UNBALANCE, LineSurvey, follow_lines
from pmg.sim.bench import BenchParameters
from pmg.sim.signals import REVOLUTION, RPM

RATE = 2000.0
SECONDS = 4.0
STEP = REVOLUTION / 5120
UNBALANCED, OUT_OF_LINE, COGGED, OFF_CENTRE = 4e-6, 0.012, 0.009, 2e-3
PER_LOAD = 0.004


def campaign(bench: BenchParameters, rng: np.random.Generator, planted: bool) -> pl.DataFrame:
    """Twelve engaged points; unbalance, a coupling, cogging, an encoder off centre, ring 3 that grows with load."""
    parts = []
    t = np.arange(round(SECONDS * RATE)) / RATE
    present = 1.0 if planted else 0.0
    for number, speed in enumerate(np.geomspace(250.0, 550.0, 12)):
        load = (0.78, 1.17, 1.56, 1.95)[number % 4]
        sun = speed * RPM * t + rng.uniform(0.0, 6.0)
        ring = -sun / 2.6 + rng.uniform(0.0, 0.4)
        noise = 0.01 * rng.standard_normal((2, len(t)))
        torque_sun = UNBALANCED * (speed * RPM) ** 2 * np.cos(sun) + OUT_OF_LINE * np.cos(2 * sun)
        torque_ring = COGGED * np.cos(234 * ring) + PER_LOAD * load * np.cos(3 * ring)
        read = {"sun": sun + present * OFF_CENTRE * np.sin(sun), "ring": ring}
        samples = pl.DataFrame(
            {
                "sample": np.arange(len(t)),
                "torque_sun": load / 2.6 + present * torque_sun + noise[0],
                "torque_ring": load + present * torque_ring + noise[1],
            }
            | {f"angle_{side}": np.floor(angle / STEP) * STEP for side, angle in read.items()}
        )
        span = Span(f"P{number}", "engaged", 1, 0, len(t))
        steps, index = dict.fromkeys(("sun", "ring"), STEP), dict.fromkeys(("sun", "ring"))
        found = orders_of_point(samples, span, RATE, bench, steps=steps, index=index)
        parts.append(
            pl.DataFrame(
                [vars(row) for row in found.rows if not row.reason],
            ).with_columns(
                point=pl.lit(span.point),
                first_sample=pl.lit(0),
                configuration=pl.lit("engaged"),
                gear=pl.lit(1),
                speed_sun=pl.lit(speed * RPM),
                speed_ring=pl.lit(-speed * RPM / 2.6),
                load=pl.lit(load),
            )
        )
    return pl.concat(parts).with_columns(pl.col(pl.Float64).fill_nan(None))


def by_name(followed: tuple[LineSurvey, ...]) -> dict[tuple[str, str], LineSurvey]:
    return {(line.signal, line.line): line for line in followed}


def test_planted_mechanisms_are_recognised_with_their_size(bench: BenchParameters, rng: np.random.Generator) -> None:
    found = by_name(follow_lines(campaign(bench, rng, planted=True), bench))
    planted = {
        ("torque_sun", "sun 1"): (UNBALANCE, UNBALANCED),
        ("torque_sun", "sun 2"): (MISALIGNMENT, OUT_OF_LINE),
        ("torque_ring", "sun 90 = ring 234"): (COGGING, COGGED),
        ("speed_sun", "sun 1"): (ECCENTRICITY, OFF_CENTRE),
    }
    for key, (mechanism, size) in planted.items():
        line = found[key]
        assert line.present, key
        assert line.belongs is not None, line.remark
        assert line.belongs.mechanism == mechanism
        assert line.belongs.amplitude.value == pytest.approx(size, rel=0.02, abs=4.0 * line.belongs.amplitude.u)
    grown = found[("torque_ring", "ring 3")]
    assert grown.per_load is not None
    assert grown.per_load.value == pytest.approx(PER_LOAD, abs=4.0 * grown.per_load.u)
    assert grown.per_load.value > 3.0 * grown.per_load.u
    assert grown.belongs is None
    assert {key for key, line in found.items() if line.present} == {*planted, ("torque_ring", "ring 3")}


def test_noise_names_nothing(bench: BenchParameters, rng: np.random.Generator) -> None:
    found = follow_lines(campaign(bench, rng, planted=False), bench)
    assert len(found) > 50
    assert not [line for line in found if line.present or line.belongs is not None]
    assert all(math.isnan(line.amplitude.value) for line in found)


def test_an_order_without_its_growth_is_not_the_mechanism(bench: BenchParameters, rng: np.random.Generator) -> None:
    table = campaign(bench, rng, planted=True).filter(pl.col("line") == "sun 2")
    renamed = table.with_columns(line=pl.lit("sun 1"), order_sun=pl.lit(1))
    line = by_name(follow_lines(renamed, bench))[("torque_sun", "sun 1")]
    assert line.present
    assert line.belongs is None
    assert "its law grows with speed to the power 2 and here it is" in line.remark
