"""How far the torques of causes lie apart in runs that were not made yet."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.motion.design.proposed_run import with_runs
from pmg.pipeline.diagnosis.motion.view import views_of

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.design.proposed_run import ProposedRun
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array


def torque_apart(
    found: MotionEvidence, run: ProposedRun, one: tuple[TermFit, ...], other: tuple[TermFit, ...]
) -> dict[str, float]:
    """Root mean square of the torque of one set of causes less that of another, by shaft [N m].

    The constants are those of the evidence: fitted anew, they would take up a part of it.

    Parameters
    ----------
    found : MotionEvidence
        Of the campaign.
    run : ProposedRun
        The run.
    one, other : tuple of TermFit
        The sets, as fitted; an empty one is the model without a cause.
    """
    whole, first = with_runs(found.baseline, (run,))
    return {
        view.side: float(np.sqrt(np.mean((_torque(view, one) - _torque(view, other)) ** 2)))
        for view in views_of(whole)[first:]
    }


def _torque(view: RotorView, fits: tuple[TermFit, ...]) -> Array:
    """Torque of a set at the fine samples (n,) [N m]."""
    parts = (cast("MotionTerm", fit.candidate).columns_on(view, fit.shape) @ fit.amplitudes for fit in fits)
    return sum(parts, np.zeros(len(view.speed)))
