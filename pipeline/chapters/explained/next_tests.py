"""Rivals of the leading cause, and the tests that would tell: points to run, one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.grid.rivals import why_weak
from pmg.pipeline.report.document import Column, Table
from pmg.sim.signals import MINUTE, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.design.next_test import NextTest
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.report.table import Cell


def next_test_items(diagnosis: Diagnosis) -> list[Table]:
    """Rivals, the tests that would tell, and the points of the strongest; none where no question is open."""
    items = [_rivals(diagnosis)] if diagnosis.rivals else []
    tests = tuple({test.plan.description: test for test in diagnosis.next_tests}.values())
    if tests:
        best = max(tests, key=lambda test: (test.power, -test.plan.seconds))
        items += [_tests(diagnosis, tests), _points(best)]
    return items


def _rivals(diagnosis: Diagnosis) -> Table:
    assert diagnosis.naming is not None
    rows: list[tuple[Cell, ...]] = []
    for rival in diagnosis.rivals:
        names = " + ".join(f"{fit.candidate.kind.title} ({fit.candidate.shaft})" for fit in rival.explanation.fits)
        test = rival.test
        rows.append(
            (
                names,
                diagnosis.naming.best.score - rival.explanation.score,
                "none known" if test is None else test.plan.description,
                None if test is None else 100.0 * test.power,
            )
        )
    why = f"{why_weak(diagnosis)[1]}. " if diagnosis.weak else ""
    return Table(
        "rivals",
        "What these recordings cannot tell from it",
        f"{why}Evidence in noise variances; the test that would tell, and the probability that it does.",
        (
            Column("rival", "Rival"),
            Column("behind", "Behind by", "", digits=1),
            Column("test", "Separating test"),
            Column("power", "Power", "%", digits=0),
        ),
        tuple(rows),
    )


def _tests(diagnosis: Diagnosis, tests: tuple[NextTest, ...]) -> Table:
    power = (
        "the probability that it shows a slow change of twice the noise"
        if diagnosis.lifting is not None
        else "the probability that the test separates the causes if the leading one is true"
    )
    return Table(
        "next-tests",
        "What to run next",
        f"Bench time includes approach, settling, windows and rests; power is {power}.",
        (
            Column("test", "Test"),
            Column("separates", "Asks between"),
            Column("points", "Points", "", digits=0),
            Column("minutes", "Bench time", "min", digits=0),
            Column("power", "Power", "%", digits=0),
        ),
        tuple(
            (
                test.plan.description,
                ", ".join(name.replace("_", " ") for name in test.separates),
                len(test.plan.points),
                test.plan.seconds / MINUTE,
                100.0 * test.power,
            )
            for test in tests
        ),
    )


def _points(test: NextTest) -> Table:
    at = test.plan.points
    begin = float(np.min(at.started_at)) if len(at) else 0.0
    return Table(
        "next-points",
        "Points to run, in this order",
        f"{test.plan.description}. The CSV is the plan for the bench; times are those from the first window on. A "
        "negative load is drawn from the ring motor as it turns.",
        (
            Column("minute", "After", "min", digits=1),
            Column("configuration", "Configuration"),
            Column("drive", "Driving"),
            Column("sun_speed", "Sun", "rpm", digits=0),
            Column("ring_speed", "Ring", "rpm", digits=0),
            Column("ring_torque", "Ring load", "N m", digits=2),
        ),
        tuple(
            (
                (float(at.started_at[i]) - begin) / MINUTE,
                str(at.configuration[i]),
                str(at.drive[i]) if at.engaged[i] else "each its own",
                SPEED_SUN.display(float(at.speed_sun[i])),
                SPEED_RING.display(float(at.speed_ring[i])),
                float(at.load_set[i]) if at.engaged[i] else None,
            )
            for i in range(len(at))
        ),
    )
