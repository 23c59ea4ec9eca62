"""Contradictions within one recording, found when it was read: clocks, channels of one quantity, spikes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.crosschecks.contradiction import Contradiction, accepted_rows
from pmg.pipeline.recording.codes import Code
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.bench import BenchParameters

SPIKES_OF_NOMINAL, SPIKES_OF_NOISE = 5e-4, 1.0
"""How far spikes may move a mean: as part of the nominal torque, and in standard uncertainties of the mean."""


def sample_rates_off_the_host(manifests: Sequence[Manifest], _: BenchParameters) -> Iterator[Contradiction]:
    """Recordings whose blocks came at another rate than their samples say."""
    return _found_when_read(manifests, Code.RATE_DISAGREES)


def starts_off_the_host(manifests: Sequence[Manifest], _: BenchParameters) -> Iterator[Contradiction]:
    """Recordings that began at another time than the host wrote their blocks."""
    return _found_when_read(manifests, Code.START_DISAGREES)


def encodings_that_differ(manifests: Sequence[Manifest], _: BenchParameters) -> Iterator[Contradiction]:
    """Recordings in which edges and frequency of one transducer do not give one torque."""
    return _found_when_read(manifests, Code.TORQUES_DISAGREE)


def _found_when_read(manifests: Sequence[Manifest], code: Code) -> Iterator[Contradiction]:
    for manifest in manifests:
        for finding in manifest.findings:
            if finding.code is code:
                yield Contradiction(manifest, 1.0, 0.0, f"{finding.where}: {finding.message}", finding.do)


def means_moved_by_spikes(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    """Mean torques that single samples far off the others move."""
    for row in accepted_rows(manifests):
        for side in SIDES:
            shaft = row.window.means[side]
            moved = abs(shaft.spikes)
            noise = SPIKES_OF_NOISE * np.nan_to_num(shaft.within)
            limit = max(SPIKES_OF_NOMINAL * float(bench.transducers[side].nominal_torque), float(noise))
            if moved > limit:
                message = (
                    f"samples far off the others move the mean torque of the {side} by {1e3 * shaft.spikes:+.1f} mN m, "
                    f"limit {1e3 * limit:.1f} mN m"
                )
                do = "Look at the trace: spikes come from cables, relays or the drive's switching."
                yield Contradiction(row, moved, limit, message, do, side, moved)
