"""Flux density of the coils: Faraday's law order by order, without drift."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pmg.pipeline.orders.flux import flux_of_lines, linkage_area
from pmg.sim.bench import BenchParameters, load_bench
from pmg.sim.errors import BenchError
from pmg.sim.signals import REVOLUTION


@settings(max_examples=40)
@given(
    density=st.floats(0.01, 2.0),
    order=st.integers(1, 30),
    speed=st.floats(1.0, 200.0),
    phase=st.floats(-3.0, 3.0),
    offset=st.floats(-5.0, 5.0),
)
def test_both_ways_give_back_the_field_whatever_the_offset(
    density: float, order: int, speed: float, phase: float, offset: float
) -> None:
    area = linkage_area(load_bench(), "radial_1")
    angle = np.arange(256) * REVOLUTION / 256
    field = density * np.cos(order * angle + phase)
    voltage = offset + area * density * order * speed * np.sin(order * angle + phase)  # -NA dB/dt
    spectrum = np.fft.rfft(voltage)
    spectrum[1:] = flux_of_lines(spectrum[1:], np.arange(1, 129) * speed, area)
    spectrum[0] = 0.0
    assert np.allclose(np.fft.irfft(spectrum), field, atol=1e-9)
    amplitude = area * density * order * speed * np.exp(1j * (phase - np.pi / 2))
    assert flux_of_lines(amplitude, order * speed, area) == pytest.approx(density * np.exp(1j * phase), rel=1e-9)


def test_an_unknown_coil_is_named(bench: BenchParameters) -> None:
    assert linkage_area(bench, "tangential_3") == pytest.approx(18 * 73.59e-6)
    with pytest.raises(BenchError, match="kind 'axial'; expected radial or tangential"):
        linkage_area(bench, "axial_1")
