"""Runs in motion of a campaign, from a store."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.campaign import choose_campaign
from pmg.pipeline.motion.faults import stand_outs
from pmg.pipeline.motion.run import MovingRun
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.pipeline.recording.tracks import COLUMNS
from pmg.pipeline.store.moving_record import Extremes, MovingRecord, Phase
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, PerShaft, per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.pipeline.store.manifest import Manifest, StoredWindow
    from pmg.pipeline.store.store import Store
    from pmg.sim.signals import Array

AT_REST = Extremes(0.0, 0.0)


@dataclass(frozen=True)
class JudgedRun:
    """A run in motion, or a zero check, without its samples.

    Parameters
    ----------
    configuration : Configuration
        Neutral, engaged or zero.
    drive : str
        Side that drives when engaged.
    manoeuvre : Manoeuvre
        What it does.
    record : MovingRecord
        Its phases, shafts, speeds.
    """

    configuration: Configuration
    drive: str
    manoeuvre: Manoeuvre
    record: MovingRecord


def moving_runs(store: Store, campaign: str | None = None) -> tuple[MovingRun, ...]:
    """The runs in motion of a campaign and its zero checks, in the order in which they were run.

    Parameters
    ----------
    store : Store
        Holds the recordings.
    campaign : str, optional
        Which campaign; the only one by default.

    Raises
    ------
    StoreError
        As `choose_campaign` says; or the samples of a run are not those that were written.
    """
    kept = _in_order(choose_campaign(store, campaign)[1])
    return tuple(_run(store, manifest, run) for manifest, run in kept if run.record.sound)


def judged_runs(manifests: Iterable[Manifest]) -> tuple[JudgedRun, ...]:
    """Runs in motion and zero checks of some recordings, in the order in which they were run."""
    return tuple(run for _, run in _in_order(manifests))


def only_in_motion(manifests: Iterable[Manifest]) -> bool:
    """Whether some recordings hold runs in motion and no steady point, so that they give no grid."""
    listed = list(manifests)
    steady = any(w.configuration is not Configuration.ZERO for manifest in listed for w in manifest.windows)
    return not steady and any(manifest.moving for manifest in listed)


def _in_order(manifests: Iterable[Manifest]) -> list[tuple[Manifest, JudgedRun]]:
    """Runs with their recordings; one in two files counts once."""
    found: dict[tuple[float, str], tuple[Manifest, JudgedRun]] = {}
    for manifest in manifests:
        run = manifest.run
        moving = [
            JudgedRun(Configuration(str(run.configuration)), run.drive or "sun", Manoeuvre(str(run.manoeuvre)), record)
            for record in manifest.moving
        ]
        for each in (*moving, *map(_zero_check, _zeros(manifest))):
            found.setdefault((each.record.started_at_s, each.record.point), (manifest, each))
    return [found[key] for key in sorted(found)]


def _zeros(manifest: Manifest) -> list[StoredWindow]:
    return [w for w in manifest.windows if w.accepted and w.configuration is Configuration.ZERO]


def _zero_check(window: StoredWindow) -> JudgedRun:
    """An accepted zero check as a run in which neither shaft turns."""
    first, stop = window.first_sample, window.stop_sample
    phases, rest = (Phase(Manoeuvre.ZERO.phase, first, stop),), PerShaft(AT_REST, AT_REST)
    record = MovingRecord(window.point, window.started_at_s, first, stop, phases, PerShaft(False, False), rest, rest)
    return JudgedRun(window.configuration, window.drive, Manoeuvre.ZERO, record)


def _run(store: Store, manifest: Manifest, judged: JudgedRun) -> MovingRun:
    """A run with its samples; NaN where they are no measurement, straight lines where its torques spike."""
    record = judged.record
    first = record.first_sample
    part = store.samples(manifest).slice(first - manifest.first_sample, record.stop_sample - first)
    signals = {name: part[name].to_numpy().astype(np.float64) for name in COLUMNS}
    for masked in record.masked:
        start, stop = masked.first_sample - first, masked.stop_sample - first
        signals[masked.column][start:stop] = np.nan
        if masked.why == Code.SPIKES.value:
            _bridge(signals[masked.column], start, stop)
    if judged.manoeuvre is Manoeuvre.ZERO:
        for torque in (signals[f"torque_{side}"] for side in SIDES):
            for start, stop in stand_outs(torque, manifest.rate_hz).tolist():
                _bridge(torque, start, stop)
    return MovingRun(
        file=manifest.file,
        point=record.point,
        configuration=judged.configuration,
        gear=manifest.run.gear or 1,
        drive=judged.drive,
        manoeuvre=judged.manoeuvre,
        started_at=datetime.fromtimestamp(record.started_at_s, UTC),
        rate=manifest.rate_hz,
        torque=per_shaft(lambda side: signals[f"torque_{side}"]),
        angle=per_shaft(lambda side: signals[f"angle_{side}"]),
        count=per_shaft(lambda side: REVOLUTION / manifest.calibration.counts_per_rev[side]),
        turns=record.turns,
        phases=tuple(
            replace(p, first_sample=p.first_sample - first, stop_sample=p.stop_sample - first) for p in record.phases
        ),
    )


def _bridge(signal: Array, start: int, stop: int) -> None:
    """Put a straight line in place of samples inside a signal (n,)."""
    signal[start - 1 : stop + 1] = np.linspace(signal[start - 1], signal[stop], stop - start + 2)
