"""False alarms and coverage of the lines of both shafts, over noise of several colours and the bench's speeds."""

from __future__ import annotations

import math

import numpy as np

from pmg.pipeline.orders.fit import fit_orders
from pmg.pipeline.orders.lines import lines_of, resolve
from pmg.sim.bench import load_bench
from pmg.sim.signals import RPM
from tests.orders.coloured import KINDS, coloured
from tests.orders.rows import row_of

SEED = 20261121
RATE, SAMPLES = 500.0, 2500
WINDOWS, SIGNALS = 60, 8
LARGEST = 0.3
"""Largest planted amplitude, for noise of standard deviation one."""


def speeds(kind: str, rng: np.random.Generator) -> tuple[float, float]:
    """Speeds of sun and ring [rpm]."""
    if kind == "engaged":
        sun = rng.uniform(150.0, 1900.0)
        return sun, -sun / 2.6
    if kind == "slow":
        return 90.0, -60.0
    return rng.uniform(60.0, 1900.0), -rng.uniform(30.0, 700.0)


def main() -> None:
    """Print, for each noise and kind of point, false alarms at 5 % and coverage of 95 % intervals."""
    bench, rng = load_bench(), np.random.default_rng(SEED)
    lines = lines_of(bench, 1)
    time = np.arange(SAMPLES) / RATE
    heads = ("noise", "points", "lines", "beyond 5 % band", "amplitude covered", "phase covered")
    print("{:8s} {:8s} {:>6s} {:>16s} {:>18s} {:>14s}".format(*heads))
    for noise in KINDS:
        for kind in ("neutral", "slow", "engaged"):
            beyond, covered, phased = [], [], []
            for _ in range(WINDOWS):
                sun_rpm, ring_rpm = speeds(kind, rng)
                sun, ring = sun_rpm * RPM * time + rng.uniform(0.0, 6.0), ring_rpm * RPM * time
                of_shafts = {"sun": sun_rpm * RPM, "ring": ring_rpm * RPM}
                groups, _ = resolve(lines, of_shafts, SAMPLES / RATE, RATE)
                quiet = coloured(noise, rng, SIGNALS, SAMPLES)
                found = fit_orders(quiet, sun, ring, groups, RATE)
                beyond.append(found.beyond[np.isfinite(found.band)])
                amplitude = rng.uniform(0.0, LARGEST, len(groups))
                phase = rng.uniform(-math.pi, math.pi, len(groups))
                waves = [
                    a * np.cos(g.lines[0].phase(sun, ring) + p)
                    for a, p, g in zip(amplitude, phase, groups, strict=True)
                ]
                found = fit_orders(quiet + np.sum(waves, axis=0), sun, ring, groups, RATE)
                low, high = found.interval
                known = np.isfinite(low)
                covered.append(((low <= amplitude) & (amplitude <= high))[known])
                lines_told = [(row_of(found, i, at), phase[i]) for at in range(SIGNALS) for i in range(len(groups))]
                off = np.array([abs(math.remainder(row.phase - p, math.tau)) / row.u_phase for row, p in lines_told])
                phased.append(off[np.isfinite(off)] < 1.96)
            lots = [np.concatenate(part) for part in (beyond, covered, phased)]
            rates = [lot.mean() for lot in lots]
            print("{:8s} {:8s} {:6d} {:16.1%} {:18.1%} {:14.1%}".format(noise, kind, len(lots[0]), *rates))


if __name__ == "__main__":
    main()
