"""No cause is named where the runs also show a filtered torque that nothing explains, such as a resonance."""

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
"""Largest scatter of the rows beside a cause that is named, in units of the noise; and the part of the torque moved by
the cause's constants below which a larger scatter does not count. Causes of the library left 0.93 to 1.15 in 27
campaigns, three inertias among them. Two heavy masses on the ring left 1.5 and 2.1, a hundredth of their own torque. A
mass on a spring of 19 Hz left 1.9 where a soft coupling was named."""


def scatter_beside(found: MotionEvidence, best: Explanation[TermFit, TermProblem]) -> float:
    """Standard deviation of the rows once all structures and a set are fitted, in units of `found.scatter`.

    It includes what faults of transducers would fit: noise of their torque, and any filtered torque.
    """
    fitted = [found.columns, found.granted, *found.evidence.families, *(found.problem.slopes(f) for f in best.fits)]
    if best.bent > 0.0:
        fitted += [bent_columns(found.problem, fit) for fit in best.fits]
    return scatter_beyond(found.y[~found.of_held], np.hstack(fitted)[~found.of_held])


def unless_like_filter(naming: TermNaming, found: MotionEvidence) -> TermNaming:
    """Withdraw the cause that is named if the rows beside it scatter well above the noise.

    A scatter that is small against what the set explains does not count. The noise is estimated without the columns of
    transducer faults, as these hold noise. Lags and delays of many times together fit any filter of a torque, such as a
    resonance: a small cause beside a resonance would then seem to explain everything.
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
