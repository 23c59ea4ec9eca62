"""What runs hold beside a cause that only a filter of the torque would follow, as lags of many times at once do."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.motion.catalogue import MAIN_LEAVES, moved_by_constants
from pmg.pipeline.diagnosis.motion.compressed import scatter_beyond
from pmg.pipeline.diagnosis.motion.free_form import bent_columns

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.catalogue import TermNaming
    from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
    from pmg.pipeline.diagnosis.engine.explanation import Explanation
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence

LOUDEST, LITTLE = 1.3, 0.03
"""Standard deviation of rows beside a cause [`MotionEvidence.scatter`] that noise may make, and part of the torque that
a constant moves which they may hold instead. Causes of the library left 0.93 to 1.15 in 27 campaigns, three inertias
among them; two heavy masses on the ring 1.5 and 2.1, or a hundredth of their torque; and a mass on a spring of 19 Hz
1.9, where a soft coupling was named."""


def scatter_beside(found: MotionEvidence, best: Explanation[TermFit, TermProblem]) -> float:
    """Standard deviation of the rows about all that is looked for and a set, in units of `found.scatter`.

    It holds what faults of transducers would follow: the noise of their torque, and anything like a filter of it.
    """
    beside = [found.columns, found.granted, *found.evidence.families, *(found.problem.slopes(f) for f in best.fits)]
    if best.bent > 0.0:
        beside += [bent_columns(found.problem, fit) for fit in best.fits]
    searched = (found.block < len(found.baseline.stretches)) | found.of_sheet
    return scatter_beyond(found.y[searched], np.hstack(beside)[searched])


def unless_like_filter(naming: TermNaming, found: MotionEvidence) -> TermNaming:
    """The answer, unless rows beside it scatter more than noise does, and that is not little of what it explains.

    The scatter is judged without the columns of transducers' faults, which hold noise. Lags and delays of many times
    together follow any filter of a torque, as a resonance is: a small cause beside one would pass for all there is.
    """
    if not (naming.best.fits or naming.weak):
        return naming
    scatter, fits = scatter_beside(found, naming.best), naming.best.fits
    of_laws = sum(fit.gain for fit in fits if not cast("MotionTerm", fit.candidate).constants)
    little = LITTLE**2 * moved_by_constants(found, fits) + MAIN_LEAVES * of_laws
    if scatter <= LOUDEST or (scatter**2 - 1.0) * len(found.y) <= little:
        return naming
    why = f"runs scatter {scatter:.1f} times the noise beside it, as a resonance or another slow transducer would leave"
    return replace(naming, explained=False, in_the_main=False, weak=(), against=why)
