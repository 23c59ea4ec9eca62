"""What the store knows of the windows behind a grid, beside their means."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.windows.limits import LIMITS
from pmg.sim.bench import SourcedQuantity
from pmg.sim.shafts import SIDES, PerShaft, per_shaft
from pmg.sim.sources import Source

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.store.store import Manifest
    from pmg.sim.bench import BenchParameters, TransducerParameters
    from pmg.sim.signals import Array, Mask

SIMULATED = "samples.simulated"
"""Code of the finding that a recording is marked as simulated."""
CALIBRATION = Source("calibration", "the calibration that the recordings carry")
"""Where the nominal torque of another transducer is from."""


@dataclass(frozen=True)
class ShaftFacts:
    """One shaft over n windows.

    Parameters
    ----------
    dof : (n,) array
        Degrees of freedom of the uncertainty from within the window; NaN where it is not known.
    correlation_time : (n,) array
        Of the torque noise [s].
    correlated : (n,) array of bool
        Flagged: the noise is not flat at the lowest frequencies of the window.
    remembered : (n,) array of bool
        Uncertainty from the kinds of noise that may be instead of batches.
    resolution : (n,) array
        Step between neighbouring values of the torque [N m]; NaN where it is not known.
    std : (n,) array
        Standard deviation of the torque [N m].
    nominal : (n,) array
        Nominal torque of the transducer, as the calibration of the recording states it [N m]; NaN where it does not.
    """

    dof: Array
    correlation_time: Array
    correlated: Mask
    remembered: Mask
    resolution: Array
    std: Array
    nominal: Array


@dataclass(frozen=True)
class LimitSet:
    """Limits by which windows were judged, and how many windows and recordings were judged by them."""

    limits: Mapping[str, float]
    windows: int
    recordings: int


@dataclass(frozen=True)
class WindowFacts(PerShaft[ShaftFacts]):
    """Both shafts, windows in the order of the grid, and every set of limits by which they were judged.

    `simulated` says which windows (n,) are of recordings that their writer marked as simulated.
    """

    limits: tuple[LimitSet, ...]
    simulated: Mask

    @property
    def correlated(self) -> Mask:
        """Windows flagged on either shaft (n,)."""
        return self.sun.correlated | self.ring.correlated


def sorted_windows(manifests: Sequence[Manifest]) -> list[dict[str, Any]]:
    """The windows of a campaign in the order in which they were run."""
    return [window for window, _ in _with_source(manifests)]


def _with_source(manifests: Sequence[Manifest]) -> list[tuple[dict[str, Any], Mapping[str, Any]]]:
    """The same, each with the document of its recording."""
    return sorted(
        ((window, manifest.document) for manifest in manifests for window in manifest.document["windows"]),
        key=lambda pair: (pair[0]["started_at_s"], pair[0]["point"]),
    )


def window_facts(manifests: Sequence[Manifest]) -> WindowFacts:
    """What the manifests say of the windows of `measured_grid`; a number that an earlier version left out is NaN."""
    pairs = _with_source(manifests)
    sun, ring = (
        _of_shaft(
            [window["means"][side] for window, _ in pairs],
            [source.get("calibration", {}).get(side, {}) for _, source in pairs],
        )
        for side in SIDES
    )
    simulated = [any(plain["code"] == SIMULATED for plain in source.get("findings", ())) for _, source in pairs]
    return WindowFacts(sun, ring, limit_sets(manifests), np.array(simulated, dtype=bool))


def limit_sets(manifests: Sequence[Manifest]) -> tuple[LimitSet, ...]:
    """Every set of limits by which these recordings were judged, the one of most windows first.

    A manifest that names none was judged by the defaults.
    """
    found: dict[tuple[tuple[str, float], ...], LimitSet] = {}
    for manifest in manifests:
        limits = manifest.document.get("limits", LIMITS.document())
        key = tuple(sorted(limits.items()))
        earlier = found.get(key, LimitSet(limits, 0, 0))
        windows = earlier.windows + len(manifest.document["windows"])
        found[key] = LimitSet(limits, windows, earlier.recordings + 1)
    return tuple(found[key] for key in sorted(found, key=lambda key: (-found[key].windows, key)))


def rated(bench: BenchParameters, facts: WindowFacts | None) -> BenchParameters:
    """The bench with the transducers that the recordings name: the largest nominal torque of each shaft.

    Where none is stated, or the bench's own, the bench itself.
    """
    if facts is None:
        return bench
    sun, ring = per_shaft(lambda side: _rated(bench.transducers[side], facts[side]))
    if sun is bench.transducer_sun and ring is bench.transducer_ring:
        return bench
    return replace(bench, transducer_sun=sun, transducer_ring=ring)


def _rated(of: TransducerParameters, shaft: ShaftFacts) -> TransducerParameters:
    """A transducer with the largest nominal torque that is stated, the same where that is its own."""
    stated = float(np.max(shaft.nominal, initial=0.0, where=np.isfinite(shaft.nominal)))
    if stated in (0.0, float(of.nominal_torque)):
        return of
    return replace(of, nominal_torque=SourcedQuantity(stated, "N m", None, CALIBRATION))


def _of_shaft(means: Sequence[Mapping[str, Any]], transducers: Sequence[Mapping[str, Any]]) -> ShaftFacts:
    def numbers(key: str, of: Sequence[Mapping[str, Any]] = means) -> Array:
        values = [each.get(key) for each in of]
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)

    return ShaftFacts(
        dof=numbers("dof"),
        correlation_time=numbers("correlation_time"),
        correlated=np.array([bool(mean.get("correlated")) for mean in means], dtype=bool),
        remembered=np.array([mean.get("method") == "memory" for mean in means], dtype=bool),
        resolution=numbers("resolution"),
        std=numbers("std"),
        nominal=numbers("nominal_torque", transducers),
    )
