"""A mass that is not fixed to its rotor: its torque grows towards a resonance, as that of a fixed one does not."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.catalogue import columns_beside
from pmg.pipeline.fit.span import pseudo_inverse
from pmg.pipeline.motion.smooth import BAND
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.catalogue import TermNaming
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.sim.signals import Array

FIXED_FROM = 2.7 * BAND
"""Frequency of a resonance [Hz] from which on a mass passes for a fixed one: within the band it is felt as 16 % more
at most."""

ONE_IN_HUNDRED = 2.33
"""Standard uncertainties by which a resonance must lie below that: chance does so one time in a hundred."""


def on_spring(naming: TermNaming, found: MotionEvidence) -> TermNaming:
    r"""The answer, no inertia named where its torque grows with frequency as that of a mass on a spring does.

    Parameters
    ----------
    naming : TermNaming
        The answer of the search.
    found : MotionEvidence
        In which it was found.

    Notes
    -----
    A mass m on a spring of resonance :math:`\omega_0` acts on its rotor with :math:`m a / (1 - \omega^2/\omega_0^2)`;
    below the resonance that is :math:`m (a - \ddot a / \omega_0^2)`. That is looked for even where nothing is left: one
    column shows what is too little among all that a remainder may follow. As most of :math:`\ddot a` is noise, it is
    fitted by two-stage least squares with what smoothing leaves of it. Terms of higher order are left out: where the
    motion fills the band a resonance of 76 Hz is read as 71, one of 50 Hz as 42.
    """
    for place, fit in enumerate(naming.best.fits):
        if fit.identifier == "rotor_inertia" and _below(naming.best.fits, place, found) > ONE_IN_HUNDRED:
            below = f"with a resonance below {FIXED_FROM:.0f} Hz"
            why = f"its torque grows with frequency like that of a mass on a spring, {below}"
            return replace(naming, explained=False, in_the_main=False, against=why)
    return naming


def _below(fits: tuple[TermFit, ...], place: int, found: MotionEvidence) -> float:
    """Standard uncertainties by which the resonance of the mass `fits[place]` lies below `FIXED_FROM`."""
    mass = fits[place]
    slopes = [found.problem.slopes(fit) for fit in fits]
    smoothed, unsmoothed = found.swinging[mass.place].T
    columns = np.hstack([smoothed[:, None], *slopes, columns_beside(found, fits)])
    at = 1 + sum(slope.shape[1] for slope in slopes[:place])
    columns[:, 0] = columns @ (pseudo_inverse(columns) @ unsmoothed)
    inverse = pseudo_inverse(columns)
    heavier = float(np.sign(mass.amplitudes[0]))
    weights: Array = -heavier * (inverse[0] + inverse[at] / (REVOLUTION * FIXED_FROM) ** 2)
    return float(weights @ found.y) / float(np.sqrt(found.covariance_of(weights[None])[0, 0]))
