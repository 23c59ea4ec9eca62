"""A drive on a slide, made here: its motion, its friction and its noise are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.sim.signals import Array

RATE = 200.0
"""Sample rate [Hz]."""
SECONDS = 12.0
"""Length of a recording [s]."""

CASE = """
schema = "pmg.terms/1"
title = "A slide made for a test"
library = "drive"
[record]
fit = "fit.csv"
withheld = "withheld.csv"
[channels]
time = {{ name = "t", unit = "s" }}
position = {{ name = "q", unit = "mm" }}
force = {{ name = "u", unit = "V", newton_per_unit = 40.0 }}
[prepare]
rate_Hz = 200
low_pass_Hz = 40
drop = 20
keep_every = 2
[baseline]
terms = {terms}
{more}
"""


@dataclass(frozen=True)
class Moving:
    """True motion: time, position, speed, acceleration."""

    t: Array
    q: Array
    v: Array
    a: Array


def motion(rng: np.random.Generator, seconds: float) -> Moving:
    """Three slow waves without a common period, so that speeds and places mix."""
    t = np.arange(0.0, seconds, 1.0 / RATE)
    q, v, a = np.full_like(t, 0.12), np.zeros_like(t), np.zeros_like(t)
    for size, frequency in ((0.06, 0.31), (0.03, 0.83), (0.008, 1.9)):
        w, phase = 2.0 * np.pi * frequency * rng.uniform(0.9, 1.1), rng.uniform(0.0, 2.0 * np.pi)
        q, v, a = (
            q + size * np.sin(w * t + phase),
            v + size * w * np.cos(w * t + phase),
            a - size * w * w * np.sin(w * t + phase),
        )
    return Moving(t, q, v, a)


def plain(m: Moving) -> Array:
    """Inertia of 80 kg and viscous friction of 150 N s/m [N]."""
    return 80.0 * m.a + 150.0 * m.v


def record(
    path: Path, m: Moving, force: Callable[[Moving], Array], rng: np.random.Generator, noise: float, blur: float = 0.0
) -> None:
    """A recording as CSV: noise of the force is correlated over some 20 ms, the encoder resolves 0.1 um.

    `blur` is white noise of the encoder [m].
    """
    white = rng.standard_normal(len(m.t) + 200)
    coloured = lfilter([np.sqrt(1.0 - 0.8**2)], [1.0, -0.8], white)[200:]
    u = (force(m) + noise * coloured) / 40.0
    q = np.round((m.q + blur * rng.standard_normal(len(m.q))) * 1e7) / 1e4
    rows = "\n".join(f"{t:.6f},{a:.5f},{b:.9f}" for t, a, b in zip(m.t, q, u, strict=True))
    path.write_text(f"t,q,u\n{rows}\n")


def make_case(
    folder: Path,
    force: Callable[[Moving], Array],
    seed: int,
    terms: str = '["inertia", "viscous"]',
    more: str = "",
    noise: float = 1.0,
    seconds: float = SECONDS,
    moves: Callable[[np.random.Generator, float], Moving] = motion,
    blur: float = 0.0,
) -> Path:
    """A case with two recordings of one machine."""
    rng = np.random.default_rng(seed)
    for name in ("fit.csv", "withheld.csv"):
        record(folder / name, moves(rng, seconds), force, rng, noise, blur)
    path = folder / "case.toml"
    path.write_text(CASE.format(terms=terms, more=more))
    return path
