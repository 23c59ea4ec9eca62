"""Test points that a recording should have held and of which it has not even a step: judged by what other files ran."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from pmg.pipeline.recording.codes import Severity
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.windows.gaps import GAP, LOSSES
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.recording.run_records import Setpoints
    from pmg.pipeline.store.manifest import Manifest, StoredWindow

HOLLOW = (GAP, "not measured", "window not closed")
"""Starts of reasons of windows with or after which points may be lost; one that has its END lost none with samples."""
CUT_REASONS = ("window not closed", "window too short", "not measured")
"""Reasons of the last window of a sequence that was broken off."""
SETPOINT_DIGITS = 6
"""Decimals, in SI, to which the set-points of two files agree."""

Key = tuple[str, ...]


@dataclass(frozen=True)
class Unreached:
    """A test point that a recording lost with its steps.

    Parameters
    ----------
    file : str
        The recording that lost it.
    point : str
        Its name in the other file.
    asked : str
        Its set-points, in words.
    like : str
        The file of the same sequence that holds it.
    why : str
        Where the recording lost it.
    instead : str
        Another file that holds an accepted window at these set-points; empty where none does.
    without : str
        A whole file of a sequence that begins as the broken one does too, and does not run the point: it may not have
        been meant. Empty where there is none.
    """

    file: str
    point: str
    asked: str
    like: str
    why: str
    instead: str
    without: str = ""

    def finding(self) -> Remark:
        """The point as a finding of a stage."""
        words = f"{self.instead} holds an accepted point there" if self.instead else "no other file holds it instead"
        message = f"not reached: {self.why}; {self.like}, which begins as it does, runs it at {self.asked}; {words}"
        if self.without:
            message += f"; {self.without} begins so too and does not run it, so that it may not have been meant"
        return Remark("info" if self.instead else "warning", f"{self.file}: {self.point}", message)


@dataclass(frozen=True)
class _Sequence:
    """The points of one recording in their order, without stretches that nobody named."""

    manifest: Manifest
    windows: tuple[StoredWindow, ...]
    gaps: int

    @property
    def file(self) -> str:
        return self.manifest.file

    @property
    def keys(self) -> tuple[Key, ...]:
        return tuple(_key(window) for window in self.windows)

    @property
    def whole(self) -> bool:
        """Whether nothing tells that it lost anything."""
        return not self.gaps and not _broken_off(self)

    def places_of(self, broken: _Sequence) -> tuple[int, ...] | None:
        """Places of the points of a broken sequence in this one; None where it is another sequence.

        The broken one begins as this one does, and leaves points out only where it has a gap.
        """
        places, at, keys = [], 0, self.keys
        for key in broken.keys:
            at = next((place for place in range(at, len(keys)) if keys[place] == key), -1) + 1
            if not at:
                return None
            places.append(at - 1)
        skips = sum(b > a + 1 for a, b in pairwise((-1, *places)))
        late = broken.manifest.first_sample > self.manifest.first_sample
        return tuple(places) if skips <= broken.gaps + late else None


def missing_points(manifests: Sequence[Manifest]) -> tuple[Unreached, ...]:
    """Points that recordings of one campaign should have held, and of which they have not even a step.

    Parameters
    ----------
    manifests : sequence of Manifest
        Ingested sources of one campaign.

    Notes
    -----
    A recording that lost data, has a gap, or broke off in its last point is compared with the sequences of the other
    files of its campaign: one that begins as it does and runs the same set-points in the same order, and more of them,
    says what is missing. Of several the one that runs most is taken; where a whole one that begins so too does not run
    a point, that is said with it. A file of the same start is the same run, and holds them.
    """
    sequences = [found for manifest in manifests if (found := _sequence(manifest)) is not None]
    files = defaultdict(list)
    for manifest in manifests:
        for window in manifest.windows:
            if window.accepted:
                files[_key(window)].append(manifest.file)
    lost: list[Unreached] = []
    for broken in sequences:
        why = _broken_off(broken)
        if not why and not broken.gaps:
            continue
        others = [
            (other, places)
            for other in sequences
            if len(other.windows) > len(broken.windows) and (places := other.places_of(broken)) is not None
        ]
        start = broken.manifest.started_at
        if not others or any(other.manifest.started_at == start for other, _ in others):
            continue
        like, places = max(others, key=lambda pair: (len(pair[0].windows), pair[0].file))
        alike = [each for each in sequences if each.whole and each.places_of(broken) is not None]
        for place in sorted(set(range(len(like.windows))) - set(places)):
            window = like.windows[place]
            before = [i for i, at in enumerate(places) if at < place]
            inside = len(before) < len(places)
            if not inside and not why:
                continue
            last = f"after {broken.windows[before[-1]].point}" if before else "before its first point"
            where = f"lost {last}, with samples that are missing" if inside else f"{why}, {last}"
            key = _key(window)
            instead = next((file for file in files[key] if file not in (broken.file, like.file)), "")
            without = next((each.file for each in alike if each.keys.count(key) < like.keys.count(key)), "")
            lost.append(
                Unreached(
                    broken.file,
                    window.point,
                    _asked(window.configuration, window.setpoints),
                    like.file,
                    where,
                    instead,
                    without,
                )
            )
    return tuple(lost)


def _sequence(manifest: Manifest) -> _Sequence | None:
    """The sequence of a source; None where its file is one point, or is cut into plateaus."""
    windows = sorted(manifest.windows, key=lambda window: window.first_sample)
    named = tuple(w for w in windows if not any(reason.startswith(GAP) for reason in w.reasons))
    stem = manifest.file.rsplit("/", 1)[-1].removesuffix(".mcap")
    alone = [window.point for window in named] == [manifest.run.point]
    if not named or alone or any(window.point.startswith(stem) for window in named):
        return None
    hollow = sum(any(reason.startswith(HOLLOW) for reason in window.reasons) for window in windows)
    return _Sequence(manifest, named, hollow)


def _key(window: StoredWindow) -> Key:
    """Key of a point in another file: its set-points, or its name where none is stated."""
    asked = asdict(window.setpoints)
    stated = [f"{name} {value:.{SETPOINT_DIGITS}f}" for name, value in sorted(asked.items()) if value is not None]
    return (str(window.configuration), str(window.gear), window.drive, *(stated or [window.point]))


def lost_data(manifest: Manifest) -> str:
    """Where the container of a source lost data; empty where it did not."""
    found = (f for f in manifest.findings if f.severity is Severity.ERROR and f.code in LOSSES)
    return next((f"{finding.code} at {finding.where}" for finding in found), "")


def _broken_off(sequence: _Sequence) -> str:
    """Where a recording lost data or was broken off; empty where it is whole."""
    manifest = sequence.manifest
    end = f"the recording ends at sample {manifest.first_sample + (manifest.samples or 0)}"
    if lost := lost_data(manifest):
        return f"{end} ({lost})"
    last = next(iter(sequence.windows[-1].reasons), "")
    return f"{end} ({last})" if last.startswith(CUT_REASONS) else ""


def _asked(configuration: str, setpoints: Setpoints) -> str:
    """Configuration and the set-points that are stated, in words."""
    words = [
        f"{name} {display(value):.5g} {unit}"
        for key, name, display, unit in (
            ("speed_sun", "sun", SPEED_SUN.display, "rpm"),
            ("speed_ring", "ring", SPEED_RING.display, "rpm"),
            ("torque_ring", "load", float, "N m"),
        )
        if (value := getattr(setpoints, key)) is not None
    ]
    return ", ".join([*([configuration] if configuration else []), *words])


def unreached_findings(manifests: Sequence[Manifest]) -> Iterator[Remark]:
    """Points not reached in these sources of one campaign, as findings of a stage."""
    return (point.finding() for point in missing_points(manifests))
