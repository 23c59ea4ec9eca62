"""Mechanisms of the calibrated baseline."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.sim.mechanisms import (
    EddyDamping,
    ExcessDamping,
    HysteresisDamping,
    NeutralRemainder,
    RelativeBearing,
    RingBearings,
    SunBearings,
)

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.mechanisms import Mechanism


def baseline_mechanisms(model: LossModel, bench: BenchParameters) -> tuple[Mechanism, ...]:
    """Mechanisms of the baseline with the numbers of a calibration, in the order of the power chain.

    Parameters
    ----------
    model : LossModel
        The numbers.
    bench : BenchParameters
        Shares of the bearings between the shafts.
    """
    s, r, k, share = model.curve_sun, model.curve_ring, model.correction, bench.bearings
    return (
        SunBearings(s, share.sun, k),
        RelativeBearing(s, r, share.share_sun_relative, share.share_ring_relative, k),
        RingBearings(r, share.ring, k),
        NeutralRemainder(s, r, 1.0 - k),
        HysteresisDamping(model.b),
        EddyDamping(model.c),
        ExcessDamping(model.d),
    )
