"""`./pmgw bench shooting`: whether a named cause makes the simulated speeds better, however long a simulation runs on.

Campaigns of runs in motion with one concealed effect of the library, by code that shares none with the diagnosis. The
diagnosis itself integrates nothing, so its verdict depends on no such length; this holds it against the simulation.
"""

from __future__ import annotations

import argparse
import math
import os

import numpy as np

from pmg.pipeline.commands.compare_and_diagnose import SEED
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.shooting import LENGTHS, Shot, shoot
from pmg.pipeline.diagnosis.motion.traces import effects_of, traces_of
from pmg.pipeline.files.parallel import map_over
from pmg.pipeline.trials.motion.nature import measure_motion_case
from pmg.pipeline.trials.score.case_list import MotionLot, draw_motion_lots
from pmg.pipeline.trials.score.rates import count
from pmg.sim.bench import load_bench
from tests.bench.speed import report


def shots_of(lot: MotionLot) -> tuple[Shot, ...]:
    """How far the simulated speeds are off; nothing where no cause is named."""
    case = lot.draw()
    runs = tuple(measure_motion_case(case, lot.rng("measure")))
    found = diagnose_motion(case.campaign, runs, load_bench(), np.random.default_rng(SEED))
    return shoot(traces_of(found, effects_of(found))).shots if found.verdict is Verdict.NAMED else ()


def over_noise(shots: tuple[Shot, ...], length: float) -> tuple[float, float]:
    """Error without and with the cause, of both rotors, over what noise makes of it."""
    of = [shot for shot in shots if shot.length == length]
    before, after = (
        math.sqrt(sum((error / shot.noise) ** 2 for shot, error in pairs) / len(of))
        for pairs in ([(shot, shot.before) for shot in of], [(shot, shot.after) for shot in of])
    )
    return before, after


def main() -> None:
    """Read the arguments, run, print."""
    parser = argparse.ArgumentParser(prog="pmgw bench shooting")
    parser.add_argument("--campaigns", type=int, default=40)
    parser.add_argument("--seed", type=int, default=20261125)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    lots = draw_motion_lots(asked.campaigns, asked.seed, ("one",))
    every = [found for _, found in map_over(shots_of, list(lots), asked.workers)]
    named = [shots for shots in every if shots]
    report(
        f"causes named in {len(named)} of {len(every)} campaigns in motion",
        "nearer with the cause",
        "from",
        "to",
        "error over noise without",
        "with",
    )
    for length in LENGTHS:
        pairs = [over_noise(shots, length) for shots in named if any(shot.length == length for shot in shots)]
        if not pairs:
            continue
        better = count([after < before for before, after in pairs])
        low, high = better.interval or (0.0, 1.0)
        without, with_cause = (float(np.median([pair[at] for pair in pairs])) for at in (0, 1))
        name = "  whole runs" if math.isinf(length) else f"  {length:g} s"
        report(
            name, f"{better.hits} of {better.of}", f"{low:.1%}", f"{high:.1%}", f"{without:.2f}", f"{with_cause:.2f}"
        )


if __name__ == "__main__":
    main()
