"""Parameters of a drive and their intervals: shapes that later terms move, an acceleration that is measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from tests.balance.reading import read_one
from tests.balance.slide import make_case, plain

from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.estimate import FittedTerms, design_of, fit_together, for_search
from pmg.pipeline.diagnosis.balance.fitting import fit_term, tabulate, term_problem
from pmg.pipeline.diagnosis.balance.serial import fit_noise
from pmg.pipeline.diagnosis.engine.held_out import solve

if TYPE_CHECKING:
    from pathlib import Path

    from tests.balance.slide import Moving

    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.sim.signals import Array

CAMPAIGNS = 30


def bell(m: Moving) -> Array:
    return np.sign(m.v) * (15.0 + 8.0 * np.exp(-((m.v / 0.03) ** 2)))


def read_slide(folder: Path, seed: int, blur: float = 0.0) -> tuple[Recorded, FittedTerms]:
    """A slide with a bell of friction, an offset and a ripple, fitted with all that it has.

    The terms are found in turn: the bell while offset and ripple are still missing.
    """
    folder.mkdir()
    path = make_case(
        folder,
        lambda m: plain(m) + bell(m) - 6.0 + 5.0 * np.sin(2.0 * np.pi * m.q / 0.05),
        seed,
        '["inertia", "viscous", "coulomb"]',
        blur=blur,
    )
    case = read_case(path)
    recorded = read_one(case.fit[0], case)
    library = {term.key: term for term in case.library}
    later = tuple(library[key] for key in ("stribeck/bell", "constant_offset", "position_ripple"))
    baseline = tuple(library[key] for key in case.baseline)
    noise = fit_noise(np.random.default_rng(1).standard_normal(len(recorded.force)))
    problem = term_problem(
        recorded, tabulate(recorded, later), noise, np.hstack([recorded.columns(t) for t in baseline])
    )
    fits = []
    for term in later:
        fits.append(fit_term(problem, term))
        problem = problem.take_out(fits[-1])
    return recorded, fit_together(recorded, noise, baseline, tuple(fits))


TRUTHS = {
    ("inertia", "M"): 80.0,
    ("viscous", "b"): 150.0,
    ("coulomb", "Fc"): 15.0,
    ("stribeck", "Fs"): 8.0,
    ("stribeck", "vs"): 0.03,
    ("constant_offset", "F0"): -6.0,
    ("position_ripple", "A"): 5.0,
}


def test_intervals_hold_though_terms_were_found_in_turn(tmp_path: Path) -> None:
    inside, off = [], []
    for seed in range(CAMPAIGNS):
        _, fitted = read_slide(tmp_path / str(seed), seed)
        found = {(e.term, e.name): e for e in fitted.estimates}
        inside.append([found[key].interval[0] <= truth <= found[key].interval[1] for key, truth in TRUTHS.items()])
        off.append([(found[key].value - truth) / found[key].standard_error for key, truth in TRUTHS.items()])
    assert 0.75 < np.sqrt(np.mean(np.square(off))) < 1.25, "errors are neither too small nor too large"
    counts = dict(zip(TRUTHS, np.sum(inside, axis=0).tolist(), strict=True))
    assert min(counts.values()) >= 0.85 * CAMPAIGNS, counts
    assert sum(counts.values()) >= 0.92 * CAMPAIGNS * len(TRUTHS), counts


def test_noise_of_an_encoder_does_not_make_the_inertia_smaller(tmp_path: Path) -> None:
    freed, plain_ones = [], []
    for seed in range(8):
        recorded, fitted = read_slide(tmp_path / str(seed), seed, blur=1e-5)
        (mass,) = [e for e in fitted.estimates if e.term == "inertia"]
        freed.append(mass.value / 80.0 - 1.0)
        assert mass.interval[0] - mass.standard_error < 80.0 < mass.interval[1] + mass.standard_error
        design = design_of(recorded, fitted.baseline, fitted.fits)
        plain_ones.append(solve(design, recorded.force)[0] / 80.0 - 1.0)
    assert abs(float(np.mean(freed))) < 0.003
    assert float(np.mean(plain_ones)) < -0.01, "least squares on a measured acceleration is off"


def test_the_fast_part_of_an_acceleration_has_the_inertia_beside_the_terms_that_were_found(tmp_path: Path) -> None:
    """A cable that is not in the baseline goes with the acceleration as far as that swings about one place."""

    def force(m: Moving) -> Array:
        return np.asarray(plain(m) + 400.0 * (m.q - 0.5 * (m.q.min() + m.q.max())))

    path = make_case(tmp_path, force, 3, '["inertia", "viscous"]')
    case = read_case(path)
    recorded = read_one(case.fit[0], case)
    library = {term.key: term for term in case.library}
    baseline = tuple(library[key] for key in case.baseline)
    columns = design_of(recorded, baseline, ())
    fast = columns[:, 0] - recorded.slow(columns[:, 0])
    noise = fit_noise(np.random.default_rng(1).standard_normal(len(recorded.force)))
    cable = fit_term(
        term_problem(recorded, tabulate(recorded, (library["spring"],)), noise, columns), library["spring"]
    )

    def inertia(*fits: TermFit) -> float:
        freed, given = for_search(recorded, baseline, fits)
        assert given.shape == columns.shape
        return float(fast @ (recorded.force - freed.force) / (fast @ fast))

    assert abs(inertia() - 80.0) > 1.0
    assert abs(inertia(cable) - 80.0) < 0.2
