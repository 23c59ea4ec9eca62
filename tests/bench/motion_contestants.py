"""Other ways to ask what runs in motion lack: a ladder of best BIC, sparse regression, a latent force by itself."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pmg.pipeline.diagnosis.balance.fitting import fit_term
from tests.bench.bout import BESIDE, PHYSICAL, Answer, Reply
from tests.bench.contestants import USUAL_MARGIN
from tests.bench.peers import installed
from tests.bench.sparse import SparseRegression

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.sim.signals import Array
    from tests.bench.bout import Contestant
    from tests.bench.motion_bout import MotionBout

RUNGS = 3
"""Mechanisms of a ladder at most."""
TIMES, SIZES = (0.05, 0.2, 1.0, 5.0), tuple(np.geomspace(0.02, 3.0, 12))
"""Correlation times [s] and sizes [noise] of a latent force that are tried."""


@dataclass(frozen=True)
class LadderOfLibrary:
    """Mechanisms of pmg's library added one after the other while BIC improves; the largest gain is the cause."""

    name: str = "best BIC ladder of the library"

    def __call__(self, bout: MotionBout, *, withheld: bool) -> Answer:
        """Fall of the whitened sum of squares less the parameters' cost, for the first rung."""
        del withheld
        began, problem = time.perf_counter(), bout.found.problem
        cost = math.log(len(problem.left))
        rungs: list[tuple[float, TermFit]] = []
        while len(rungs) < RUNGS:
            taken = {fit.identifier for _, fit in rungs}
            fits = [
                fit_term(problem, table.term) for table in problem.tables.values() if table.term.identifier not in taken
            ]
            level, best = max(((fit.gain - fit.cost * cost, fit) for fit in fits), key=lambda each: each[0])
            if rungs and level <= 0.0:
                break
            rungs.append((level, best))
            if level <= 0.0:
                break
            problem = problem.take_out(best)
        level, first = rungs[0]
        said = (first.identifier, first.place)
        reply = Reply(True, said)
        remarks = {"rungs": [fit.identifier for gain, fit in rungs if gain > 0.0]}
        seconds = time.perf_counter() - began
        settings = {"BIC": Reply(True, said) if level > 0.0 else Reply(alarm=False)}
        return Answer(level, settings, ((level, reply),), seconds, remarks)


@dataclass(frozen=True)
class LatentForce:
    """One unknown force of a first-order Markov law in the missing torque, named by the mechanism that is most like it.

    References
    ----------
    M. Alvarez, D. Luengo, N. Lawrence, 'Latent force models', AISTATS 2009; here with the balance as the mechanics.
    """

    name: str = "latent force only"

    def __call__(self, bout: MotionBout, *, withheld: bool) -> Answer:
        """Twice the likelihood ratio against noise alone, less its cost; the largest correlation is the cause."""
        del withheld
        began = time.perf_counter()
        rows = sum(len(trace) for trace in bout.traces)
        tried = {(t, s): _evidence(bout, t, s) for t in TIMES for s in SIZES}
        best = max(tried, key=lambda each: tried[each])
        level = tried[best] - 2.0 * math.log(rows)
        library = bout.library(PHYSICAL)
        alike = np.abs(library.theta.T @ bout.residual)
        said = library.owners[int(np.argmax(alike))]
        reply = Reply(True, said)
        settings = {"BIC": reply if level > USUAL_MARGIN else Reply(alarm=False)}
        seconds = time.perf_counter() - began
        return Answer(level, settings, ((level, reply),), seconds, {"time": best[0], "size": best[1]})


def _evidence(bout: MotionBout, settles: float, size: float) -> float:
    """Twice the logarithm of the likelihood of a force in white noise of 1 over that of the noise alone.

    The Kalman filter of a first-order Markov force is in its steady state throughout.
    """
    kept = math.exp(-1.0 / (settles * bout.row_rate))
    driven = size**2 * (1.0 - kept**2)
    half = 0.5 * (driven + kept**2 - 1.0)
    before = half + math.sqrt(half**2 + driven)
    gain, spread = before / (before + 1.0), before + 1.0
    found = 0.0
    for trace in bout.traces:
        innovation: Array = lfilter([1.0, -kept], [1.0, -kept * (1.0 - gain)], trace)
        found += float(np.sum(trace**2 - innovation**2 / spread)) - len(trace) * math.log(spread)
    return found


def contestants_in_motion() -> tuple[Contestant[MotionBout], ...]:
    """All whose packages are there."""
    found: list[Contestant[MotionBout]] = [LadderOfLibrary(), LatentForce()]
    if installed("pysindy"):
        found += [SparseRegression(kind, "STLSQ") for kind in (PHYSICAL, BESIDE)]
    return tuple(found)
