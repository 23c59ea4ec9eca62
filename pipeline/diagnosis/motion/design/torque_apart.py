"""How far the torques of causes lie apart in runs that were not made yet."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.motion.candidates.terms import torque_of_terms
from pmg.pipeline.diagnosis.motion.design.proposed_run import with_runs
from pmg.pipeline.diagnosis.motion.view import views_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.design.proposed_run import ProposedRun
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.sim.signals import Array


def torque_apart(
    found: MotionEvidence, run: ProposedRun, one: tuple[TermFit, ...], others: Sequence[tuple[TermFit, ...]]
) -> list[dict[str, float]]:
    """Root mean square of the torque of one set of causes less that of each of some others, by shaft [N m].

    The constants are those of the evidence: fitted anew, they would take up a part of it.

    Parameters
    ----------
    found : MotionEvidence
        Of the campaign.
    run : ProposedRun
        The run.
    one : tuple of TermFit
        The set, as fitted.
    others : sequence of tuple of TermFit
        The other sets; an empty one is the model without a cause.
    """
    whole, first = with_runs(found.baseline, (run,))
    views = views_of(whole)[first:]
    of_one, *of_others = ([torque_of_terms(view, map(_part, fits)) for view in views] for fits in (one, *others))
    return [
        {view.side: float(np.sqrt(np.mean((a - b) ** 2))) for view, a, b in zip(views, of_one, other, strict=True)}
        for other in of_others
    ]


def _part(fit: TermFit) -> tuple[MotionTerm, float, Array]:
    return cast("MotionTerm", fit.candidate), fit.shape, fit.amplitudes
