"""`./pmgw bench cost`: time of one diagnosis against the number of points and of candidate mechanisms.

All of it is processor time of one process, so that other work on the machine counts little; ratios within one run are
what is meant.
"""

from __future__ import annotations

import cProfile
import os
import pstats
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from unittest.mock import patch

import numpy as np

from pmg.pipeline.commands.compare_and_diagnose import SEED
from pmg.pipeline.diagnosis.design.plans import join_points
from pmg.pipeline.diagnosis.grid.decide import diagnose
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.trials.nature import draw_case, measure_case
from pmg.sim.bench import load_bench
from pmg.sim.mechanisms import CANDIDATES
from tests.bench.case import timed
from tests.bench.speed import report
from tests.trials.strata_by_name import find_stratum

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.sim.mechanisms import Mechanism

ROOT = Path(__file__).resolve().parents[2]
CAUSE = "lubricant_viscosity"
"""Concealed in the first campaign; it stays among the candidates however few they are."""
STRATA = (f"{CAUSE} sun 4", "outside_run_in_step ring 4")
"""What is concealed: one cause that is known, one that is not."""
PARTS = (0.25, 0.5, 1.0, 2.0)
"""Of the points of a campaign; twice is the whole campaign run again afterwards."""
SHARES = (0.25, 0.5, 1.0)
"""Of the catalogue."""
CAMPAIGNS = 3
"""Campaigns of each size; the median of their times is reported."""
LISTED = 12
"""Functions that are listed."""


def campaign(name: str, part: float = 1.0, number: int = 0) -> Analysis:
    """A concealed campaign by its number, thinned evenly or run twice, measured and analysed."""
    rng = np.random.default_rng([20261121, number])
    case = draw_case(find_stratum(name), rng)
    at = case.design.at
    span = float(np.ptp(at.started_at))
    later = replace(at, started_at=at.started_at + 1.01 * span, name=np.array([f"{point}_again" for point in at.name]))
    longer = join_points(at, later) if part > 1.0 else at[np.arange(0, len(at), round(1.0 / part))]
    run = replace(case, design=replace(case.design, at=longer))
    return analyse(measure_case(run, rng), AnalysisOptions(), load_bench())


def told(analysis: Analysis) -> Diagnosis:
    """What the diagnosis says of it."""
    assert analysis.fits is not None
    assert analysis.floor is not None
    assert analysis.calibration is not None
    draws = np.random.default_rng(SEED)
    return diagnose(analysis.grid, analysis.fits, analysis.floor, analysis.calibration, load_bench(), draws)


def some(share: float) -> tuple[type[Mechanism], ...]:
    """Part of the catalogue, evenly from it, the cause that is concealed among it."""
    first = sorted(CANDIDATES, key=lambda kind: kind.identifier != CAUSE)
    return tuple(first[:: round(1.0 / share)])


def exponent(size: Sequence[float], seconds: Sequence[float]) -> str:
    """The power of the size with which time grows, and its standard error from the scatter about the power law."""
    x, y = np.log(np.array(size)), np.log(np.array(seconds))
    basis = np.stack([x, np.ones_like(x)], axis=1)
    found, rest, *_ = np.linalg.lstsq(basis, y)
    free = len(x) - 2
    error = float(np.sqrt(rest[0] / free * np.linalg.inv(basis.T @ basis)[0, 0])) if free > 0 else float("nan")
    return f"{found[0]:.2f} (u {error:.2f})"


def series(what: str, entries: Sequence[tuple[float, Sequence[tuple[float, str]]]], whole: float) -> None:
    """A table: size, median, least and most processor time, the median over that of the whole, what was said.

    The exponent is that of the medians of the runs that said what most runs say: a run that stops at an earlier stage
    of the diagnosis, or goes on to a later one, is another matter than growth.
    """
    report(what, "median [s]", "least", "most", "of the whole", "  said")
    base = next(np.median([seconds for seconds, _ in runs]) for size, runs in entries if size == whole)
    said = Counter(verdict for _, runs in entries for _, verdict in runs)
    usual = said.most_common(1)[0][0]
    alike = []
    for size, runs in entries:
        seconds = np.array([time for time, _ in runs])
        counted = ", ".join(f"{n} {verdict}" for verdict, n in Counter(verdict for _, verdict in runs).items())
        middle = float(np.median(seconds))
        ends = (f"{seconds.min():.2f}", f"{seconds.max():.2f}")
        report(f"  {size:.0f}", f"{middle:.2f}", *ends, f"{middle / base:.2f}", f"  {counted}")
        same = [time for time, verdict in runs if verdict == usual]
        if same:
            alike.append((size, float(np.median(same))))
    if len(alike) > 1:
        report(f"  exponent, {usual} only", exponent(*zip(*alike, strict=True)))


def diagnosed(analysis: Analysis) -> tuple[float, str]:
    """Processor time [s] and verdict."""
    found = timed(lambda: told(analysis))
    return found.cpu, str(getattr(found.value, "verdict", None))


def profile(analysis: Analysis) -> None:
    """Functions of pmg by the share of the time that passes in them and in what they call; shares overlap.

    Comprehensions are left out: their time is in the function around them.
    """
    run = cProfile.Profile()
    run.runcall(told, analysis)
    stats = pstats.Stats(run)
    roots = tuple(f"{ROOT / room}{os.sep}" for room in ("pipeline", "sim"))
    entries = [
        (cumulative, calls, f"{Path(file).stem}.{name}")
        for (file, _, name), (calls, _, _, cumulative, _) in stats.stats.items()  # type: ignore[attr-defined]
        if not name.startswith("<") and str(Path(file).resolve()).startswith(roots)
    ]
    entries.sort(reverse=True)
    whole = entries[0][0]
    report("where it goes (under the profiler)", "share", "calls")
    for cumulative, calls, name in entries[1 : LISTED + 1]:
        report(f"  {name}", f"{cumulative / whole:.0%}", str(calls))


def main() -> None:
    """Print the tables."""
    told(campaign(STRATA[0], PARTS[0]))  # what is compiled or read once
    for name in STRATA:
        report(f"concealed: {name}")
        runs = [[campaign(name, part, number) for number in range(CAMPAIGNS)] for part in PARTS]
        whole = runs[PARTS.index(1.0)]
        points = [(float(np.mean([len(run.grid) for run in size])), [diagnosed(run) for run in size]) for size in runs]
        series("points, mean", points, points[PARTS.index(1.0)][0])
        entries = []
        for share in SHARES[:-1]:
            with patch("pmg.pipeline.diagnosis.grid.candidates.CANDIDATES", some(share)):
                entries.append((float(len(some(share))), [diagnosed(run) for run in whole]))
        entries.append((float(len(CANDIDATES)), points[PARTS.index(1.0)][1]))
        series("candidate mechanisms", entries, len(CANDIDATES))
        profile(whole[0])


if __name__ == "__main__":
    main()
