"""The same run in two files: its windows counted once."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import TYPE_CHECKING

from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.store.manifest import Manifest, StoredWindow

COPY = "the same run is in"
"""Start of the reason by which a copy is rejected; the file that is kept follows."""
TORQUE_DIGITS = 9
"""Decimals [N m] to which mean torques of the same samples agree."""
COPY_OF_NOMINAL = 1e-4
"""How far the mean torques of a run in two files may differ, as part of the nominal torque; beyond, one was corrected.
It is more than single precision loses."""
COPY_SIGMAS = 10.0
"""The same where one file holds less of the window, in standard uncertainties of the two means."""


@dataclass(frozen=True)
class _Placed:
    """A window, the source it is from, and its place there."""

    manifest: Manifest
    place: int

    @property
    def window(self) -> StoredWindow:
        return self.manifest.windows[self.place]

    @property
    def fullness(self) -> tuple[bool, int, str]:
        """Accepted before rejected, more samples before fewer, then by name of the source: the least is kept."""
        window = self.window
        return not window.accepted, window.first_sample - window.stop_sample, self.manifest.identifier

    @property
    def key(self) -> tuple[str, ...]:
        """Start of the run and point; where nobody named the point, what its samples are in place of the point."""
        manifest, window = self.manifest, self.window
        if manifest.run.point or not window.point.startswith(PurePath(manifest.file).stem):
            return manifest.started_at, window.point
        torques = (mean.torque for mean in window.means)
        return manifest.started_at, "", *("" if math.isnan(t) else f"{t:.{TORQUE_DIGITS}f}" for t in torques)

    def overlaps(self, other: _Placed) -> bool:
        """Whether both are of the same samples, in part at least, in two files."""
        return in_two_files(self.manifest, self.window, other.manifest, other.window)

    def other_version(self, other: _Placed) -> bool:
        """Whether the numbers of one of the two were changed."""
        sides = (torque_apart(self.manifest, self.window, other.manifest, other.window, side) for side in SIDES)
        return any(apart > limit for apart, limit in sides)


def in_two_files(a: Manifest, of_a: StoredWindow, b: Manifest, of_b: StoredWindow) -> bool:
    """Whether two windows are of the same samples, in part at least, in two files."""
    apart = of_a.stop_sample <= of_b.first_sample or of_b.stop_sample <= of_a.first_sample
    return a.identifier != b.identifier and not apart


def torque_apart(a: Manifest, of_a: StoredWindow, b: Manifest, of_b: StoredWindow, side: str) -> tuple[float, float]:
    """How far two means of the torque of a shaft over the same samples are apart, and how far they may be [N m].

    Nothing where one of them is not known.
    """
    means = of_a.means[side], of_b.means[side]
    apart = abs(means[0].torque - means[1].torque)
    limit = COPY_OF_NOMINAL * max(a.calibration[side].nominal_torque, b.calibration[side].nominal_torque)
    if (of_a.first_sample, of_a.stop_sample) != (of_b.first_sample, of_b.stop_sample):
        limit += COPY_SIGMAS * math.hypot(*(mean.within for mean in means))
    return (0.0, limit) if math.isnan(apart) or math.isnan(limit) else (apart, limit)


def without_copies(manifests: Sequence[Manifest]) -> list[Manifest]:
    """These sources of one campaign, with windows rejected that another file holds too.

    Parameters
    ----------
    manifests : sequence of Manifest
        Ingested sources of one campaign.

    Returns
    -------
    list of Manifest
        The same, in the same order. Of copies of a window the accepted one with the most samples stays as it is;
        the others are rejected, with the name of the file that is kept.

    Notes
    -----
    A run has one start. Windows of the same point over the same samples, in two files that state the same start, are
    one window that was written twice: copied in other chunks, or cut short. Where the mean torques differ, they are
    two versions of it, one of them corrected, which a cross-check names. Where a file names no point, its name
    stands for it; its windows are copies where the mean torques agree too, as an import may give many runs one start.
    """
    groups: dict[tuple[str, ...], list[_Placed]] = defaultdict(list)
    for manifest in manifests:
        for place in range(len(manifest.windows)):
            placed = _Placed(manifest, place)
            groups[placed.key].append(placed)
    reasons: dict[tuple[str, int], str] = {}
    for group in groups.values():
        kept: list[_Placed] = []
        for placed in sorted(group, key=lambda each: each.fullness):
            original = next((o for o in kept if placed.overlaps(o) and not placed.other_version(o)), None)
            if original is None:
                kept.append(placed)
            else:
                reasons[placed.manifest.identifier, placed.place] = f"{COPY} {original.manifest.file}"
    return [_rejected(manifest, reasons) for manifest in manifests]


def _rejected(manifest: Manifest, reasons: Mapping[tuple[str, int], str]) -> Manifest:
    windows = tuple(
        replace(window, accepted=False, reasons=(*window.reasons, reasons[manifest.identifier, place]))
        if (manifest.identifier, place) in reasons
        else window
        for place, window in enumerate(manifest.windows)
    )
    return replace(manifest, windows=windows)
