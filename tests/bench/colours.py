"""Noise of a window that is not of first order, or not only: fast and slow, of a power law, resonant, drifting."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import signal

if TYPE_CHECKING:
    from collections.abc import Callable

    Draw = Callable[[np.random.Generator, int, float], np.ndarray]

SPAN = 8
"""Windows over which noise of a power law has no mean; below the frequency of one cycle in them it has no power."""
LEAD = 6.0
"""Decay times of a resonance before the window begins."""


@dataclass(frozen=True)
class Colour:
    """Noise of standard deviation near one.

    Parameters
    ----------
    name : str
        What it is.
    draw : callable
        Samples from generator, number and rate [Hz].
    """

    name: str
    draw: Draw


def first_order(memory: float) -> Draw:
    """Noise of first order of this correlation time [s]; independent for 0."""

    def draw(rng: np.random.Generator, n: int, rate: float) -> np.ndarray:
        keep = math.exp(-1.0 / (memory * rate)) if memory else 0.0
        white = rng.standard_normal(n)
        start = np.array([keep * rng.standard_normal()])
        noise, _ = signal.lfilter([math.sqrt(1.0 - keep**2)], [1.0, -keep], white, zi=start)
        return np.asarray(noise)

    return draw


def together(*parts: tuple[float, Draw]) -> Draw:
    """Sum of noises, each with its share of the variance."""

    def draw(rng: np.random.Generator, n: int, rate: float) -> np.ndarray:
        return np.asarray(np.sum([math.sqrt(share) * noise(rng, n, rate) for share, noise in parts], axis=0))

    return draw


def power_law(power: float) -> Draw:
    """Noise of density 1/f^power from one cycle in `SPAN` windows up; the truth is the mean over these windows."""

    def draw(rng: np.random.Generator, n: int, rate: float) -> np.ndarray:
        k = np.arange(1, SPAN * n // 2)
        size = k ** (-power / 2.0)
        lines = np.zeros(SPAN * n // 2 + 1, dtype=np.complex128)
        lines[1:-1] = size * (rng.standard_normal(len(k)) + 1j * rng.standard_normal(len(k)))
        return np.asarray(np.fft.irfft(lines)[:n] * SPAN * n / (2.0 * math.sqrt(np.sum(size**2))))

    return draw


def resonance(hertz: float, damping: float) -> Draw:
    """A damped mode driven by independent noise."""

    def draw(rng: np.random.Generator, n: int, rate: float) -> np.ndarray:
        omega = 2.0 * math.pi * hertz
        pole = np.exp(omega * complex(-damping, math.sqrt(1.0 - damping**2)) / rate)
        one, two = 2.0 * pole.real, -(abs(pole) ** 2)
        lead = round(LEAD / (damping * omega) * rate)
        size = math.sqrt((1.0 + two) * ((1.0 - two) ** 2 - one**2) / (1.0 - two))
        return np.asarray(signal.lfilter([size], [1.0, -one, -two], rng.standard_normal(n + lead))[lead:])

    return draw


def drift(part: float) -> Draw:
    """Independent noise and a random walk from the truth on, which strays by `part` of it by the window's end."""

    def draw(rng: np.random.Generator, n: int, rate: float) -> np.ndarray:
        del rate
        return rng.standard_normal(n) + part / math.sqrt(n) * np.cumsum(rng.standard_normal(n))

    return draw


COLOURS = (
    Colour("first order, 1 s", first_order(1.0)),
    Colour("20 ms (80 %) and 500 ms (20 %)", together((0.8, first_order(0.02)), (0.2, first_order(0.5)))),
    Colour("100 ms (70 %) and 1 s (30 %)", together((0.7, first_order(0.1)), (0.3, first_order(1.0)))),
    Colour("1/f^0.5", power_law(0.5)),
    Colour("1/f", power_law(1.0)),
    Colour("mode of 0.5 Hz, damping 0.1", resonance(0.5, 0.1)),
    Colour("mode of 1 Hz, damping 0.1", resonance(1.0, 0.1)),
    Colour("mode of 3 Hz, damping 0.1", resonance(3.0, 0.1)),
    Colour("mode of 1 Hz (50 %) and independent", together((0.5, resonance(1.0, 0.05)), (0.5, first_order(0.0)))),
    Colour("independent, random walk of 5 %", drift(0.05)),
)
