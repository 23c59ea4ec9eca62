"""Whether the torque and the angle of each shaft count in senses that can be true together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

from pmg.sim.errors import FitError
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.motion.smooth import SmoothRun
    from pmg.sim.signals import Array

MOST = 0.5
"""Part of a torque that an explanation gives from which on it counts. Of sound campaigns inertia and drag give 0.9 and
more, and their opposites less than 0.1."""


def check_senses(runs: Sequence[SmoothRun]) -> None:
    """Refuse a campaign in which a torque or an angle counts backwards, which no constant of a bench explains.

    Parameters
    ----------
    runs : sequence of SmoothRun
        Of one campaign.

    Notes
    -----
    In neutral, a torque accelerates its rotor and overcomes its drag, so that it is a sum of acceleration, speed and
    sense of rotation, none of which it holds with less than nothing. Engaged, the torques of both shafts go together,
    as the magnetic gear turns both rotors to larger pole angles by the same torque for each pole pair.

    Raises
    ------
    FitError
        A torque goes against its shaft, or against the other torque.
    """
    against = [side for side in SIDES if _against(*_in_neutral(runs, side))]
    sun, ring = _engaged(runs)
    falls = _against(sun, ring[:, None])
    if against:
        tells = len(against) == 1 and len(sun) > 0
        which = ("torque" if falls else "angle") if tells else "torque or the angle"
        raise FitError(
            f"torque of the {' and of the '.join(against)}",
            "in neutral it brakes where its shaft speeds up, and drives where that is dragged",
            "torque and angle that count in the same sense of rotation",
            f"Change the sign of the {which} in the calibration of that shaft, and ingest anew.",
        )
    if falls:
        raise FitError(
            "torques of the sun and of the ring",
            "engaged, one falls where the other rises",
            "torques that the magnetic gear moves in the same sense",
            "Change the sign of the one that brakes where its shaft speeds up, in its calibration, and ingest anew.",
        )


def _in_neutral(runs: Sequence[SmoothRun], side: str) -> tuple[Array, Array]:
    """Torque of a shaft that turns in neutral [N m], (n,), and its acceleration, speed and sense of rotation (n, 3)."""
    torques, motions = [np.zeros(0)], [np.zeros((0, 3))]
    for run in runs:
        if run.run.manoeuvre.moves and run.run.turns[side] and not run.run.coupled:
            shaft, known = run.shafts[side], np.isfinite(run.measured[side])
            motion = np.stack([shaft.acceleration, shaft.speed, np.sign(shaft.speed)], axis=1)
            torques.append(run.measured[side][known])
            motions.append(run.rows(motion)[known])
    return np.concatenate(torques), np.concatenate(motions)


def _engaged(runs: Sequence[SmoothRun]) -> tuple[Array, Array]:
    """Torques of both shafts at the rows of the engaged runs at which both are known [N m], (n,)."""
    both = [np.stack(list(run.measured)) for run in runs if run.run.coupled]
    known = np.hstack([np.zeros((len(SIDES), 0)), *(each[:, np.isfinite(each).all(axis=0)] for each in both)])
    return known[0], known[1]


def _against(torque: Array, motion: Array) -> bool:
    """Whether a torque (n,) is most of it explained by columns (n, k) with no positive sizes, and not so by others."""
    return _explained(-torque, motion) > MOST and _explained(torque, motion) < MOST


def _explained(torque: Array, motion: Array) -> float:
    """Part of a torque, by its root mean square, that columns with no negative sizes give."""
    if not len(torque):
        return 0.0
    length = np.maximum(np.linalg.norm(motion, axis=0), np.finfo(float).tiny)
    sizes, _ = nnls(motion / length, torque)
    return float(np.linalg.norm(motion / length @ sizes) / max(float(np.linalg.norm(torque)), np.finfo(float).tiny))
