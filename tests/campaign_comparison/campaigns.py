"""Pairs of synthetic campaigns, analysed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from tests.points import joined, measured, points

from pmg.pipeline.campaign_comparison.side import CampaignSide, TransducerIdentity
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.transducer_uncertainty import common_uncertainty
from pmg.sim.bench import load_bench
from pmg.sim.grid import Grid
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.signals import Array
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

BENCH = load_bench()
OPTIONS = AnalysisOptions(powers_sun=(0.0, 0.5, 1.0), powers_ring=(0.0, 0.5, 1.0))
CURVE = LossCurve((0.0, 0.5, 1.0), np.array([0.02, 0.09, 0.03]), 150.0, 200.0)
MODEL = LossModel(CURVE, CURVE, 0.85, 2e-2, 2.2e-4, 0.0)
NOISE = 1e-3


def grid(seed: int, *, shift_sun: float = 0.0, off_rpm: float = 0.5, model: LossModel = MODEL) -> Grid:
    """A campaign in random order, each point somewhat off its set speeds; `shift_sun` is added to readings [N m]."""
    rng = np.random.default_rng(seed)
    sun, ring = (axis.ravel() for axis in np.meshgrid(np.linspace(150.0, 1850.0, 7), np.linspace(60.0, 700.0, 5)))
    speed, load = (axis.ravel() for axis in np.meshgrid(np.linspace(150.0, 1850.0, 7), [0.8, 1.4, 1.9]))
    sun, ring, speed = (axis + off_rpm * rng.uniform(-1.0, 1.0, len(axis)) for axis in (sun, ring, speed))
    neutral = points("neutral", sun, ring)
    at = joined(neutral, points("engaged", speed, -speed / BENCH.gear1.ratio, load, load_set=load))
    at = replace(at, started_at=1e9 + 45.0 * rng.permutation(len(at)).astype(np.float64))
    made = steady(Gearbox.calibrated(BENCH, model), at)
    noisy = [torque + NOISE * rng.standard_normal(len(at)) for torque in (made.torque_sun, made.torque_ring)]
    found = measured(at, noisy[0] + shift_sun, np.where(at.engaged, at.torque_ring, noisy[1]), NOISE)
    common = common_uncertainty(found.torque_sun, found.torque_ring, BENCH)
    return replace(found, common_sun=common[0], common_ring=common[1])


@cache
def side(label: str, seed: int, serial: str = "one", shift_sun: float = 0.0, off_rpm: float = 0.5) -> CampaignSide:
    """The same, analysed, measured with a transducer of that serial number on both shafts."""
    analysis = analyse(grid(seed, shift_sun=shift_sun, off_rpm=off_rpm), OPTIONS, BENCH)
    transducers = {
        shaft: TransducerIdentity(serial, nominal, 5000.0) for shaft, nominal in (("sun", 5.0), ("ring", 10.0))
    }
    return CampaignSide(label, analysis, BENCH, transducers)


def with_readings(of: CampaignSide, torque_sun: Array, torque_ring: Array) -> CampaignSide:
    """The same campaign, having read other torques."""
    at = replace(of.grid.points, torque_ring=torque_ring)
    found = replace(of.grid, points=at, torque_sun=torque_sun, torque_ring=torque_ring)
    return replace(of, analysis=replace(of.analysis, grid=found))


__all__ = ["BENCH", "MODEL", "NOISE", "OPTIONS", "grid", "side", "with_readings"]
