"""From the manifests of a store to the measured grid of one campaign."""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.copies import without_copies
from pmg.pipeline.grid.transducer_remarks import transducer_remarks
from pmg.pipeline.grid.transducer_uncertainty import common_uncertainty, tare_uncertainty, undithered
from pmg.pipeline.grid.window_facts import rated, sorted_windows, window_facts, window_remarks
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.store.store import Store
from pmg.sim.errors import StoreError, near_miss
from pmg.sim.grid import Configuration, Grid, OperatingPoints
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.grid.window_facts import ShaftFacts
    from pmg.pipeline.store.manifest import Manifest, StoredWindow
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array, Mask

STILL_SCATTER = 1e-12
"""Scatter [N m] below which a torque shows nothing but the rounding of numbers."""


def campaigns(manifests: list[Manifest]) -> list[str]:
    """Names of the campaigns that a store holds."""
    return sorted({manifest.campaign for manifest in manifests if manifest.ingested})


def failed_sources(store: Path) -> tuple[Manifest, ...]:
    """Sources of a store that are not usable; of which campaign they are is not known."""
    return tuple(manifest for manifest in Store(store).manifests() if not manifest.ingested)


def choose_campaign(store: Store, name: str | None) -> tuple[str, list[Manifest]]:
    """The campaign of that name, or the only one, with the manifests of its sources, copies of a window rejected.

    Raises
    ------
    StoreError
        There is none, there are several and none was named, or there is none of that name.
    """
    manifests = store.manifests()
    known = campaigns(manifests)
    if not known:
        why = "".join(f"; {finding}" for manifest in manifests[:1] for finding in manifest.findings[-1:])
        came = f"{len(manifests)} sources, none usable{why}" if manifests else "no sources"
        raise StoreError(str(store.path), came, "at least one ingested recording", "Ingest recordings first.")
    if name is None and len(known) > 1:
        raise StoreError(
            str(store.path), f"{len(known)} campaigns: {', '.join(known)}", "one", "Name it by --campaign."
        )
    if name is not None and name not in known:
        raise StoreError(str(store.path), f"no campaign '{name}'", "one of the store's", near_miss(name, known))
    chosen = name or known[0]
    return chosen, without_copies([m for m in manifests if m.ingested and m.campaign == chosen])


def recorded_bench(store: Path, grid: Grid, bench: BenchParameters) -> tuple[BenchParameters, tuple[Remark, ...]]:
    """The bench with the nominal torques that the recordings behind an analysed grid state, and where they differ.

    Parameters
    ----------
    store : Path
        Holds the analysis.
    grid : Grid
        Of that analysis.
    bench : BenchParameters
        As it ships.

    Returns
    -------
    BenchParameters, tuple of dict
        The bench itself and no finding where the grid is of tables, or the store no longer holds its recordings.
    """
    if grid.origin == "published":
        return bench, ()
    known = [m for m in Store(store).manifests() if m.ingested and m.campaign == grid.campaign]
    if not known:
        return bench, ()
    facts = window_facts(known)
    return rated(bench, facts), tuple(transducer_remarks(facts, bench))


def measured_grid(name: str, manifests: list[Manifest], bench: BenchParameters) -> Grid:
    """The windows of a campaign as a grid, in the order in which they were run.

    The uncertainty from within a window holds the step of its readings where their scatter does not average it out;
    what all points share holds the tare, as far as zero checks tell, and the non-linearity of the transducers that the
    calibrations name. Of a rejected window without its angle, or its load, the point has what was asked for, as the
    bench was there all the same; NaN where nobody said.
    """
    windows, facts = sorted_windows(manifests), window_facts(manifests)
    if not windows:
        raise StoreError(
            f"campaign {name}",
            f"{len(manifests)} sources without a test window",
            "one window at least",
            "Check that the sequence holds MEASURE steps.",
        )

    torque_sun, torque_ring = (_numbers(windows, f"means.{side}.torque") for side in SIDES)
    speed_sun, speed_ring = (_numbers(windows, f"means.{side}.speed") for side in SIDES)
    within_sun, within_ring = (
        np.hypot(
            _known(_numbers(windows, f"means.{side}.within"), shaft, facts.simulated),
            undithered(shaft.resolution, shaft.std),
        )
        for side, shaft in facts.items()
    )
    complete = np.isfinite(torque_sun + torque_ring + speed_sun + speed_ring + within_sun + within_ring)
    accepted = _flags(windows, "accepted") & complete
    points = _points(windows, torque_ring, speed_sun, speed_ring)
    zeros = accepted & points.zero
    tares = tare_uncertainty(torque_sun[zeros])[0], tare_uncertainty(torque_ring[zeros])[0]
    nominal = facts.sun.nominal, facts.ring.nominal
    common_sun, common_ring = common_uncertainty(torque_sun, torque_ring, bench, tares, nominal)
    reasons = [_reason(window, bool(whole)) for window, whole in zip(windows, complete, strict=True)]
    return Grid(
        origin="measured",
        campaign=name,
        points=points,
        torque_sun=torque_sun,
        torque_ring=torque_ring,
        within_sun=within_sun,
        within_ring=within_ring,
        u_sun=within_sun,
        u_ring=within_ring,
        common_sun=common_sun,
        common_ring=common_ring,
        accepted=accepted,
        reason=np.array(reasons, dtype=np.str_),
    )


def _points(windows: list[StoredWindow], torque_ring: Array, speed_sun: Array, speed_ring: Array) -> OperatingPoints:
    """Points of windows in their order; what was asked for where a torque [N m] or speed [rad/s] is not known."""
    configuration = _words(windows, "configuration")
    engaged = configuration == Configuration.ENGAGED
    load = _numbers(windows, "setpoints.torque_ring")
    return OperatingPoints(
        name=_words(windows, "point"),
        configuration=configuration,
        gear=np.array([window.gear for window in windows], dtype=np.int64),
        drive=_words(windows, "drive"),
        speed_sun=np.where(np.isfinite(speed_sun), speed_sun, _numbers(windows, "setpoints.speed_sun")),
        speed_ring=np.where(np.isfinite(speed_ring), speed_ring, _numbers(windows, "setpoints.speed_ring")),
        torque_ring=np.where(engaged & np.isnan(torque_ring), load, torque_ring),
        load_set=np.where(engaged, np.where(np.isfinite(load), load, np.round(torque_ring, 1)), 0.0),
        started_at=np.array([window.started_at_s for window in windows], dtype=np.float64),
        rest_sun=_flags(windows, "rest_sun"),
        rest_ring=_flags(windows, "rest_ring"),
    )


def _numbers(windows: list[StoredWindow], path: str) -> Array:
    """A number of each window (n,); NaN where it was not stated."""
    values = map(attrgetter(path), windows)
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _flags(windows: list[StoredWindow], name: str) -> Mask:
    return np.array([getattr(window, name) for window in windows], dtype=bool)


def _words(windows: list[StoredWindow], name: str) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    return np.array([str(getattr(window, name)) for window in windows], dtype=np.str_)


def _known(within: Array, shaft: ShaftFacts, simulated: Mask) -> Array:
    """Uncertainty from within the windows [N m] (n,): none of a simulated torque that stands still, as it has none."""
    return np.where(simulated & np.isnan(within) & (shaft.std < STILL_SCATTER), 0.0, within)


def _reason(window: StoredWindow, complete: bool) -> str:
    reasons = list(window_remarks(window))
    if not complete and (window.accepted or not reasons):
        reasons.append("no mean can be formed")
    return "; ".join(reasons)
