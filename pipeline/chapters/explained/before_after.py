"""One picture of the readings before and after the cause is in the model, for the first screen of a report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.statement import shaft_of
from pmg.pipeline.report.document import Chart, Figure, Series
from pmg.pipeline.wording.plurals import counted
from pmg.sim.shafts import SIDES
from pmg.sim.signals import MINUTE, RESIDUAL, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.sim.signals import Array


def before_and_after(diagnosis: Diagnosis, residual: Array) -> Figure | None:
    """Residual with the plain model and with the cause, where the cause acts or the difference sits."""
    naming, found, readings = diagnosis.naming, diagnosis.refit, diagnosis.mismatch.readings
    places = diagnosis.mismatch.locations
    if naming is not None and found is not None:
        effect = np.sum([fit.effect for fit in naming.best.fits], axis=0)
        shaft = shaft_of(diagnosis, naming.best.fits[0])
    else:
        effect = places[0].effect if places else residual
        shaft = max(SIDES, key=lambda side: float(np.sum(effect[readings.of_shaft[side]] ** 2)))
    rows = np.flatnonzero(readings.of_shaft[shaft] & (effect != 0.0))
    if not len(rows):
        return None
    x, label = _abscissa(diagnosis, rows, effect)
    order = np.argsort(x, kind="stable")
    u = float(np.median(readings.u[rows])) / RESIDUAL.scale
    ends = x[order][[0, -1]]
    series = [Series("repeatability, 95 %", ends, 0.0 * ends, np.array([u, u]), "band", 7)]
    stages = [("plain model", residual, 1)]
    if found is not None:
        sure = "with the cause" if diagnosis.verdict is Verdict.NAMED else "with the first possible cause"
        stages.append((sure, readings.torque - found.prediction, 0))
    for name, part, colour in stages:
        series.append(Series(name, x[order], RESIDUAL.display(part[rows])[order], None, "markers", colour))
    return Figure(
        "before-and-after",
        "Measured less simulated torque",
        f"{shaft.capitalize()} torque, {counted(len(rows), 'reading')}{' where it acts' if found else ''}.",
        (Chart(label, "torque [mN m]", tuple(series), references=(("", 0.0),)),),
        narrow=True,
    )


def _abscissa(diagnosis: Diagnosis, rows: npt.NDArray[np.intp], effect: Array) -> tuple[Array, str]:
    """What the readings are drawn over: time where the cause remembers, load where it acts under load, else speed."""
    readings, naming = diagnosis.mismatch.readings, diagnosis.naming
    points = readings.grid.points
    at = points[readings.row[rows]]
    places = diagnosis.mismatch.locations
    follows = places[0].depends_on[0] if places and places[0].depends_on else ""
    if diagnosis.refit is not None and naming is not None:
        remembers = any(fit.candidate.kind.memory for fit in naming.best.fits)
        under_load = 2.0 * float(np.sum(effect[rows][at.engaged] ** 2)) > float(np.sum(effect[rows] ** 2))
        follows = "run_history" if remembers else "load" if under_load else "speed_sun"
    if follows in ("load", "power_flow"):
        return at.torque_ring, "load: ring torque [N m]"
    if follows == "speed_ring":
        return np.asarray(SPEED_RING.display(np.abs(at.speed_ring))), SPEED_RING.label
    if follows in ("speed_sun", "") or not points.ordered:
        return np.asarray(SPEED_SUN.display(np.abs(at.speed_sun))), SPEED_SUN.label
    return np.asarray((at.started_at - points.started_at.min()) / MINUTE), "time since the first point [min]"
