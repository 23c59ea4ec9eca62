"""The published run in time under the choices that the source leaves open."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.thesis_figures.figures import FIGURES
from pmg.pipeline.thesis_figures.rounding import RoundingSpread
from pmg.pipeline.thesis_figures.transient import (
    FIGURES_OF_THE_RUN,
    RotorsCounted,
    RunLosses,
    TransientResult,
    transient_lines,
    transient_options,
)
from pmg.pipeline.thesis_figures.verdict import _judge
from pmg.sim.bench import BenchParameters
from pmg.sim.signals import RPM


@pytest.fixture(scope="module")
def results(published_folder: Path, bench: BenchParameters) -> tuple[TransientResult, ...]:
    known = {figure.id: figure for figure in FIGURES}
    spread = RoundingSpread(490.0 * RPM, 485.0 * RPM, 495.0 * RPM)
    judged = [_judge(known[id_], spread) for id_ in FIGURES_OF_THE_RUN.values()]
    return transient_options(read_published(published_folder, bench), bench, judged, np.random.default_rng(1))


def test_each_choice_moves_the_run_the_way_it_must(results: tuple[TransientResult, ...]) -> None:
    by = {(r.losses, r.rotors, r.signed): r for r in results}
    assert len(by) == len(results) == 18
    for losses in RunLosses:
        for signed in (True, False):
            speeds = [by[losses, rotors, signed].speed_sun / RPM for rotors in RotorsCounted]
            assert 3.0 < speeds[0] - speeds[1] < 6.0
            assert 0.3 < speeds[1] - speeds[2] < 1.5
    for r in results:
        assert (r.lowest < 0.0) is not r.signed
        assert r.power_in > r.power_out > 0.0
        assert r.speed_sun / r.speed_ring == pytest.approx(-2.6, rel=1e-4)


def test_the_printed_run_comes_out_with_the_rotor_in_the_suns_shaft(results: tuple[TransientResult, ...]) -> None:
    """Printed: 485 and -187 rpm, 48.4 and 47.7 W, engaged between 0.4 and 0.6 s."""
    drawn = next(r for r in results if (r.losses, r.rotors, r.signed) == (RunLosses.TORQUES, RotorsCounted.SUN, False))
    assert drawn.speed_sun / RPM == pytest.approx(485.0, abs=0.6)
    assert drawn.speed_ring / RPM == pytest.approx(-187.0, abs=0.7)
    assert drawn.power_in == pytest.approx(48.4, abs=0.05)
    assert drawn.power_out == pytest.approx(47.7, abs=0.05)
    assert 0.4 < drawn.engaged_from < 0.6
    assert any("-3.8" in line and "0.415 s" in line for line in transient_lines(results))
