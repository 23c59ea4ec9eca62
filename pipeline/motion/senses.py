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
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array

MOST = 0.5
"""Part of a torque that an explanation gives from which on it counts. Of sound campaigns inertia and drag give 0.97 and
more of what a torque changes by in neutral, and their opposites nothing; the other torque 0.95 of it engaged."""

LOADED = 0.02
"""Part of the nominal torque by which the ring's changes, beyond what its motion asks for, where the gear is loaded."""

TORQUE = "the torque (`span_Hz` of its calibration)"
ANGLE = "the angle (`sign` in the map of its import, or its two tracks exchanged)"
"""What counts in a sense, and where that is settled."""


def check_senses(runs: Sequence[SmoothRun], nominal: PerShaft[float]) -> None:
    """Refuse a campaign in which a torque or an angle counts backwards, which no constant of a bench explains.

    Parameters
    ----------
    runs : sequence of SmoothRun
        Of one campaign.
    nominal : PerShaft of float
        Nominal torques of the transducers [N m].

    Notes
    -----
    In neutral, a torque accelerates its rotor and overcomes its drag, so that it is a sum of acceleration, speed and
    sense of rotation, none of which it holds with less than nothing; a zero error is taken out run by run. Engaged and
    loaded, both torques go together beyond what motion asks of each, as the magnetic gear turns both rotors to larger
    pole angles by the same torque for each pole pair.

    Raises
    ------
    FitError
        A torque goes against its shaft, or against the other torque.
    """
    against = [side for side in SIDES if _goes(*_in_neutral(runs, side)) < 0]
    together = _goes(*_under_load(runs, nominal))
    if against:
        tells = len(against) == 1 and together != 0
        which = (TORQUE if together < 0 else ANGLE) if tells else f"{TORQUE}, or {ANGLE}"
        raise FitError(
            f"torque of the {' and of the '.join(against)}",
            "in neutral it brakes where its shaft speeds up, and drives where that is dragged",
            "torque and angle that count in the same sense of rotation",
            f"Turn the sign of {which} of that shaft, and ingest anew.",
        )
    if together < 0:
        raise FitError(
            "torques of the sun and of the ring",
            "engaged, one falls where the other rises",
            "torques that the magnetic gear moves in the same sense",
            f"Turn the sign of one of them, whichever is not as the layout has it: {TORQUE}; and ingest anew.",
        )


def _in_neutral(runs: Sequence[SmoothRun], side: str) -> tuple[Array, Array]:
    """Torque of a shaft that turns in neutral [N m], (n,), and its motion (n, 3), without the means of each run."""
    torques, motions = [np.zeros(0)], [np.zeros((0, 3))]
    for run in runs:
        known = np.isfinite(run.measured[side])
        if run.run.manoeuvre.moves and run.run.turns[side] and not run.run.coupled and known.any():
            torque, motion = run.measured[side][known], run.rows(_motion(run, side))[known]
            torques.append(torque - torque.mean())
            motions.append(motion - motion.mean(axis=0))
    return np.concatenate(torques), np.concatenate(motions)


def _under_load(runs: Sequence[SmoothRun], nominal: PerShaft[float]) -> tuple[Array, Array]:
    """Engaged torque of the sun beyond what its motion asks for (n,), and of the ring (n, 1); none without load."""
    beyond: dict[str, Array] = {}
    engaged = [(run, np.isfinite(run.measured.sun) & np.isfinite(run.measured.ring)) for run in runs if run.run.coupled]
    for side in SIDES:
        torque = np.concatenate([np.zeros(0), *(run.measured[side][known] for run, known in engaged)])
        motion = np.concatenate([np.zeros((0, 3)), *(run.rows(_motion(run, side))[known] for run, known in engaged)])
        columns = np.column_stack([motion, np.ones(len(motion))])
        beyond[side] = torque - columns @ np.linalg.lstsq(columns, torque, rcond=None)[0]
    if not np.any(np.abs(beyond["ring"])) or np.std(beyond["ring"]) < LOADED * nominal.ring:
        return np.zeros(0), np.zeros((0, 1))
    return beyond["sun"], beyond["ring"][:, None]


def _motion(run: SmoothRun, side: str) -> Array:
    """Acceleration, speed and sense of rotation of a shaft at the fine samples (n, 3)."""
    shaft = run.shafts[side]
    return np.stack([shaft.acceleration, shaft.speed, np.sign(shaft.speed)], axis=1)


def _goes(torque: Array, motion: Array) -> int:
    """1 where columns (n, k) give most of a torque with no negative sizes, -1 with no positive ones, 0 where none."""
    return int(_explained(torque, motion) > MOST) or -int(_explained(-torque, motion) > MOST)


def _explained(torque: Array, motion: Array) -> float:
    """Part of a torque, by its root mean square, that columns with no negative sizes give."""
    if not len(torque):
        return 0.0
    length = np.maximum(np.linalg.norm(motion, axis=0), np.finfo(float).tiny)
    sizes, _ = nnls(motion / length, torque)
    return float(np.linalg.norm(motion / length @ sizes) / max(float(np.linalg.norm(torque)), np.finfo(float).tiny))
