"""What a difference between model and recordings costs where nothing is done: watts, and points of efficiency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.fit.losses import total_loss_and_efficiency
from pmg.sim.mechanisms.base import Instrument

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.signals import Array

LOADED = 0.2
"""Part of the largest power carried from which on a point counts as loaded."""


def cost_of_cause(diagnosis: Diagnosis, residual: Array, as_read: str) -> Iterator[str]:
    """Loss by which a model without the cause is wrong, or the readings with it, and the same in efficiency.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of a campaign whose causes were fitted.
    residual : (m,) array
        Measured minus simulated at the readings of the test [N m].
    as_read : str
        What a fault of a reading makes of the losses, as a sentence; may be empty.
    """
    naming, found, readings = diagnosis.naming, diagnosis.refit, diagnosis.mismatch.readings
    assert naming is not None
    assert found is not None
    faults = [fit for fit in naming.best.fits if issubclass(fit.candidate.kind, Instrument)]
    of_readings = np.sum([fit.effect for fit in faults], axis=0) if faults else np.zeros(len(residual))
    acting = np.sum([fit.effect for fit in naming.best.fits], axis=0) != 0.0
    first = "If the first is the cause, a" if diagnosis.verdict is Verdict.AMBIGUOUS else "A"
    if len(faults) < len(naming.best.fits):
        missing = residual - (readings.torque - found.prediction) - of_readings
        yield from _power(diagnosis, f"{first} model without it is wrong", np.where(acting, missing, 0.0))
    if as_read:
        yield as_read
    else:
        yield from _power(diagnosis, "Losses from these readings are wrong", of_readings)


def _power(diagnosis: Diagnosis, what: str, wrong: Array) -> Iterator[str]:
    """What an error of the torques (m,) [N m] makes of the losses, and of the efficiency; nothing without one."""
    readings, at = diagnosis.mismatch.readings, diagnosis.mismatch.readings.grid.points
    acting = (readings.configuration != "zero") & (wrong != 0.0)
    if not acting.any():
        return
    loss = np.bincount(readings.row[acting], (wrong * readings.speed_own)[acting], len(at))
    of = np.unique(readings.row[acting])
    most = float(np.abs(loss[of]).max())
    carried = np.abs(at.torque_ring * at.speed_ring)[of]
    loaded = at.engaged[of] & (carried > LOADED * np.max(carried, where=at.engaged[of], initial=0.0))
    points = _efficiency(readings, wrong, of[loaded]) if loaded.any() else 0.0
    share = f", and {points:.2g} points of efficiency under load" if loaded.any() else ""
    yield f"{what} by up to {most:.2g} W{share}."


def _efficiency(readings: Readings, wrong: Array, rows: npt.NDArray[np.int64]) -> float:
    """Largest change of the efficiency, in points, at engaged rows of the grid that an error of the torques (m,) makes.

    Engaged, the ring torque is the input: the whole error is one of the sun torque.
    """
    grid = readings.grid
    of_sun = np.bincount(readings.row, np.where(readings.sun, wrong, 0.0), len(grid))
    at, read, ring = grid.points[rows], grid.torque_sun[rows], grid.torque_ring[rows]
    _, with_it = total_loss_and_efficiency(at, read, ring)
    _, without = total_loss_and_efficiency(at, read - of_sun[rows], ring)
    return float(100.0 * np.abs(with_it - without).max())


def cost_of_places(diagnosis: Diagnosis) -> Iterator[str]:
    """Loss by which a model is wrong where a difference was found and no cause; nothing to pay where none was."""
    mismatch, readings = diagnosis.mismatch, diagnosis.mismatch.readings
    if diagnosis.verdict is Verdict.CONFOUNDED:
        yield "Unknown: a drift would count as losses of the gear."
    elif mismatch.locations:
        effect = np.sum([place.effect for place in mismatch.locations], axis=0)
        moving = (readings.configuration != "zero") & (effect != 0.0)
        if not moving.any():
            yield "Nothing but the reading at rest."
            return
        loss = np.bincount(readings.row[moving], (effect * readings.speed_own)[moving], len(readings.grid))
        of = loss[np.unique(readings.row[moving])]
        yield f"The model is wrong by up to {np.abs(of).max():.2g} W at the points where it differs."
    elif not mismatch.found:
        yield "Nothing: no difference beyond repeatability."
