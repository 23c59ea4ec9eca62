"""Facts of the windows behind a grid, in addition to their means."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.means import MEMORY_METHOD
from pmg.pipeline.windows.limits import LIMITS
from pmg.pipeline.windows.reduce import FLAGGED_BY_CHANCE
from pmg.pipeline.windows.remarks import REMARK
from pmg.pipeline.wording.probability import CONFIDENCE
from pmg.sim.bench import SourcedQuantity
from pmg.sim.shafts import SIDES, PerShaft, per_shaft
from pmg.sim.sources import Source

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.recording.calibration import Transducer
    from pmg.pipeline.recording.means import ShaftMeans
    from pmg.pipeline.store.manifest import Manifest, StoredWindow
    from pmg.sim.bench import BenchParameters, TransducerParameters
    from pmg.sim.signals import Array, Mask

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

    @property
    def correlated_by_chance(self) -> bool:
        """Whether flat noise would have as many windows flagged, in 5 of 100 campaigns or more."""
        flags = np.concatenate([self.sun.correlated, self.ring.correlated])
        return bool(stats.binom.sf(flags.sum() - 1, len(flags), FLAGGED_BY_CHANCE) > 1.0 - CONFIDENCE)


def sorted_windows(manifests: Sequence[Manifest]) -> list[StoredWindow]:
    """The windows of a campaign in the order in which they were run."""
    return [window for window, _ in _with_source(manifests)]


def _with_source(manifests: Sequence[Manifest]) -> list[tuple[StoredWindow, Manifest]]:
    """The same, each with the manifest of its recording."""
    return sorted(
        ((window, manifest) for manifest in manifests for window in manifest.windows),
        key=lambda pair: (pair[0].started_at_s, pair[0].point),
    )


def window_remarks(window: StoredWindow) -> tuple[str, ...]:
    """Reasons of a window as the store holds it; of an accepted one also that a torque's noise may be slow."""
    if not window.accepted:
        return window.reasons
    return window.reasons + tuple(
        f"{REMARK}: the noise of the torque of the {side} may not be flat at the lowest frequencies of the window; "
        "what goes on below them is not seen"
        for side in SIDES
        if window.means[side].correlated
    )


def window_facts(manifests: Sequence[Manifest]) -> WindowFacts:
    """Facts of the windows of `measured_grid` by the manifests; a number that an earlier version left out is NaN."""
    pairs = _with_source(manifests)
    sun, ring = (
        _of_shaft(
            [window.means[side] for window, _ in pairs],
            [source.calibration[side] for _, source in pairs],
        )
        for side in SIDES
    )
    simulated = [marked_as_simulated(source) for _, source in pairs]
    return WindowFacts(sun, ring, _limit_sets(manifests), np.array(simulated, dtype=bool))


def marked_as_simulated(manifest: Manifest) -> bool:
    """Whether the writer of a recording marked it as simulated."""
    return any(finding.code is Code.SIMULATED for finding in manifest.findings)


def _limit_sets(manifests: Sequence[Manifest]) -> tuple[LimitSet, ...]:
    """Every set of limits by which these recordings were judged, the one of most windows first.

    A manifest that names none was judged by the defaults.
    """
    found: dict[tuple[tuple[str, float], ...], LimitSet] = {}
    for manifest in manifests:
        limits = LIMITS.document() if manifest.limits is None else manifest.limits
        key = tuple(sorted(limits.items()))
        earlier = found.get(key, LimitSet(limits, 0, 0))
        windows = earlier.windows + len(manifest.windows)
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


def _of_shaft(means: Sequence[ShaftMeans], transducers: Sequence[Transducer]) -> ShaftFacts:
    return ShaftFacts(
        dof=np.array([mean.dof for mean in means], dtype=np.float64),
        correlation_time=np.array([mean.correlation_time for mean in means], dtype=np.float64),
        correlated=np.array([mean.correlated for mean in means], dtype=bool),
        remembered=np.array([mean.method == MEMORY_METHOD for mean in means], dtype=bool),
        resolution=np.array([mean.resolution for mean in means], dtype=np.float64),
        std=np.array([mean.std for mean in means], dtype=np.float64),
        nominal=np.array([transducer.nominal_torque for transducer in transducers], dtype=np.float64),
    )
