"""Losses corrected for a fault of a torque reading that the diagnosis found.

Losses and efficiencies are reported as they were read; a fault of a transducer is in them, and no uncertainty of a
sound transducer covers it. Beside them stand the losses under each explanation that has such a fault.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.losses import total_loss_and_efficiency
from pmg.pipeline.model.apply_model import fit_together
from pmg.pipeline.model.model_file import fitted_model
from pmg.pipeline.wording import numerals
from pmg.pipeline.wording.units import displayed
from pmg.sim import signals
from pmg.sim.mechanisms.base import Instrument, Torques
from pmg.sim.mechanisms.instruments import distorted

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.model.model_file import Part
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.signals import Array

STEPS = 8
"""Steps from a reading to the torque behind it; the error falls by the size of the fault with each."""


@dataclass(frozen=True)
class CorrectedLosses:
    """One explanation with a fault of a reading in it, and the n engaged points of the balance without that fault.

    Parameters
    ----------
    parts : tuple of Part
        The faults, fitted together with baseline and whatever else explains the mismatch.
    torque_sun, torque_ring : (n,) array
        Torques without the faults [N m].
    values, spread : dict of str to (n,) array
        Total loss [W] and total efficiency from them by signal name, and what the standard errors of the faults make
        of each; NaN where they have none.
    doubtful : bool
        Whether another explanation has no fault of a reading.
    """

    parts: tuple[Part, ...]
    torque_sun: Array
    torque_ring: Array
    values: dict[str, Array]
    spread: dict[str, Array]
    doubtful: bool = False

    @property
    def description(self) -> str:
        """The faults in words."""
        words = []
        for part in self.parts:
            known = {parameter.name: parameter for parameter in part.kind.parameters()}
            for name, value in part.values.items():
                parameter = known[name]
                factor, unit = displayed(parameter.unit, value, share=True)
                words.append(f"{parameter.meaning} {numerals.number(factor * value, spec='.2g')}{unit}")
        return "; ".join(words)


def correct_sensor_fault(
    diagnosis: Diagnosis | None, analysis: Analysis, bench: BenchParameters, parts: tuple[Part, ...] = ()
) -> tuple[CorrectedLosses, ...]:
    """Losses without the faults of readings, under each explanation that has any.

    Parameters
    ----------
    diagnosis : Diagnosis or None
        What explains the mismatch; explanations that these data cannot tell apart each count, and a fault whose shaft
        cannot be determined counts once a shaft.
    analysis : Analysis
        Of the same campaign, with its balance.
    bench : BenchParameters
        The bench.
    parts : tuple of Part
        Mechanisms of a model that was carried to the campaign, which the diagnosis took as given.
    """
    if diagnosis is None or analysis.balance is None or analysis.calibration is None or analysis.floor is None:
        return ()
    found = []
    explanations = list(_explanations(diagnosis)) or [()]
    for fits in explanations:
        kinds = [*(part.kind for part in parts), *(fit.candidate.kind for fit in fits)]
        if not any(issubclass(kind, Instrument) for kind in kinds):
            continue
        model = fitted_model(fit_together(parts, fits, analysis, bench), {})
        faults = tuple(part for part in model.parts if issubclass(part.kind, Instrument))
        found.append(_without(faults, analysis, bench))
    given = any(issubclass(part.kind, Instrument) for part in parts)
    doubtful = not given and (diagnosis.weak or len(found) < len(explanations))
    return tuple(replace(each, doubtful=doubtful) for each in found)


def _explanations(diagnosis: Diagnosis) -> Iterator[tuple[CandidateFit, ...]]:
    """The best, the same with a fault on the other shaft where that cannot be determined, and every rival."""
    naming = diagnosis.naming
    if naming is None or not diagnosis.verdict.names:
        return
    best = naming.best.fits
    yield best
    for place, fit in enumerate(best):
        other = naming.on_the_other_shaft(fit)
        if other is not None:
            yield (*best[:place], other, *best[place + 1 :])
    for rival in diagnosis.rivals:
        yield rival.explanation.fits


def _without(faults: tuple[Part, ...], analysis: Analysis, bench: BenchParameters) -> CorrectedLosses:
    balance = analysis.balance
    assert balance is not None
    assert analysis.calibration is not None
    grid, baseline = balance.grid, analysis.calibration.model
    at = grid.points

    def taken(parts: Sequence[Part]) -> tuple[Array, Array]:
        kinds = [part.mechanism(bench, baseline) for part in parts]
        return _torques_behind(
            [kind for kind in kinds if isinstance(kind, Instrument)], at, grid.torque_sun, grid.torque_ring
        )

    torques = taken(faults)
    values = total_loss_and_efficiency(at, *torques)
    variance = np.zeros_like(values)
    for place, part in enumerate(faults):
        for name, value in part.values.items():
            error = part.errors.get(name, np.nan)
            moved = replace(part, values={**part.values, name: value + error})
            other = taken((*faults[:place], moved, *faults[place + 1 :])) if np.isfinite(error) else None
            variance += np.nan if other is None else (total_loss_and_efficiency(at, *other) - values) ** 2
    names = (signals.LOSS_TOTAL.name, signals.EFFICIENCY_TOTAL.name)
    return CorrectedLosses(
        faults, *torques, dict(zip(names, values, strict=True)), dict(zip(names, np.sqrt(variance), strict=True))
    )


def _torques_behind(
    faults: Sequence[Instrument], at: OperatingPoints, torque_sun: Array, torque_ring: Array
) -> tuple[Array, Array]:
    """Torques of sun and ring [N m] (n,) that faulty transducers show as the given readings.

    Notes
    -----
    A transducer shows the torque and the distortion that belongs to it. From the reading, the torque follows by
    ``torque = reading - distortion(torque)``, step by step.
    """
    sun, ring = torque_sun, torque_ring
    for _ in range(STEPS):
        wrong = distorted(tuple(faults), replace(at, torque_ring=ring), Torques(sun, ring))
        sun, ring = torque_sun - wrong[0], torque_ring - wrong[1]
    return sun, ring
