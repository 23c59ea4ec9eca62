"""Noise of several colours, for the bands of lines."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from pmg.sim.signals import Array

KINDS = ("white", "slow", "slower", "pink", "walk")
"""White; first order with 0.95 and 0.99 from sample to sample; 1/f; a random walk."""

LEAD = 1000
"""Samples before the noise is taken, so that a filter has settled."""


def coloured(kind: str, rng: np.random.Generator, signals: int, samples: int) -> Array:
    """Noise of standard deviation one."""
    noise = rng.standard_normal((signals, samples + LEAD))
    if kind == "pink":
        spectrum = np.fft.rfft(noise)
        spectrum[:, 1:] /= np.sqrt(np.arange(1, spectrum.shape[1]))
        noise = np.fft.irfft(spectrum, n=noise.shape[1])
    elif kind == "walk":
        noise = np.cumsum(noise, axis=1)
    elif kind != "white":
        noise = lfilter([1.0], [1.0, -{"slow": 0.95, "slower": 0.99}[kind]], noise)
    return np.asarray(noise[:, LEAD:] / noise[:, LEAD:].std(), dtype=np.float64)
