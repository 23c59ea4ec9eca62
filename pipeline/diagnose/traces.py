"""What each mechanism of the catalogue would leave on the readings, for one value of its shape after another."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnose.candidates import candidates, set_stage, shapes, signature

if TYPE_CHECKING:
    from pmg.pipeline.diagnose.whiten import Whitener
    from pmg.pipeline.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array


def traces(readings: Readings, bench: BenchParameters, model: LossModel, white: Whitener) -> list[Array]:
    """Whitened columns (m, sizes) of every mechanism on every shaft and in every shape from which a fit starts.

    A smooth family spreads a test over several columns; a mechanism's own trace takes one, so that small effects of
    the catalogue are seen earlier.
    """
    stage = set_stage(readings, bench, model, white)
    return [
        white(signature(stage, candidate, shape))
        for candidate in candidates()
        if candidate.shaft != "both" or not candidate.kind.both_at_once
        for shape in shapes(candidate)
    ]
