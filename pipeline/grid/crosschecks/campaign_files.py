"""One recording held against the others of its campaign: calibration, repeats, simulated among measured."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.copies import in_two_files, torque_apart
from pmg.pipeline.grid.crosschecks.contradiction import SIGMAS, Contradiction, accepted_rows, robust_scale
from pmg.pipeline.grid.window_facts import marked_as_simulated
from pmg.pipeline.wording.plurals import counted
from pmg.sim.shafts import SIDES
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.grid.crosschecks.contradiction import Row
    from pmg.pipeline.recording.calibration import Transducer
    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.bench import BenchParameters

USUAL = 0.8
"""Part of the recordings of a campaign that carry one calibration, from which another one is suspicious."""
CALIBRATION_OF_NOMINAL = 1e-3
"""How far the torques by two calibrations of one transducer may differ, as part of the nominal torque."""
REPEAT_OF_NOMINAL = 0.01
"""How far two repeats of a point may differ in any case, as part of the nominal torque."""
FEWEST_PAIRS = 3
"""Pairs of repeats from which their scatter is known."""


def calibrations_unlike_the_others(manifests: Sequence[Manifest], _: BenchParameters) -> Iterator[Contradiction]:
    """Recordings whose calibration of a transducer is not that of the others with its serial number.

    One without a serial number is held against most of the campaign all the same. Another transducer than in most
    recordings is named, and nothing is rejected for it.
    """
    for side in SIDES:
        by_serial: dict[str, list[Manifest]] = defaultdict(list)
        for manifest in manifests:
            by_serial[manifest.calibration[side].serial].append(manifest)
        usual, most = max(by_serial.items(), key=lambda item: len(item[1]), default=("", []))
        if len(most) < USUAL * len(manifests):
            usual, most = "", []
        for serial, carried in by_serial.items():
            if serial or serial == usual:
                yield from _unlike(side, f"transducer {serial or 'without serial number'}", carried)
                if most and serial != usual:
                    yield from _another(side, serial, carried, most)
            elif most:
                yield from _unlike(side, f"transducer ({usual} in most recordings)", [*most, *carried])


def _another(side: str, serial: str, carried: list[Manifest], most: list[Manifest]) -> Iterator[Contradiction]:
    """Another transducer than in most recordings, where the two calibrations differ."""
    usual, _, limit = _usual_calibration(side, most)
    off = max(_off(m.calibration[side], usual) for m in carried)
    if off > limit:
        files = carried[0].file + (", ..." if len(carried) > 1 else "")
        others = most[0].calibration[side].serial or "without serial number"
        message = (
            f"{counted(len(carried), 'recording')} ({files}) name another transducer of the {side}, {serial}, than the "
            f"{len(most)} others ({others}); the torque by the two calibrations differs by up to {off:.3g} N m, "
            f"limit {limit:.3g} N m"
        )
        do = "Nothing is to be done if the transducer was changed; else correct serial number and calibration."
        yield Contradiction(None, off, limit, message, do)


def _unlike(side: str, transducer: str, carried: list[Manifest]) -> Iterator[Contradiction]:
    """Of recordings that should carry one calibration those that carry another."""
    usual, count, limit = _usual_calibration(side, carried)
    others = [m for m in carried if _off(m.calibration[side], usual) > limit]
    if not others:
        return
    if count < USUAL * len(carried) or _since(others, carried):
        off = max(_off(m.calibration[side], usual) for m in others)
        message = (
            f"{counted(len(others), 'recording')} of {len(carried)} carry another calibration of the {side}'s "
            f"{transducer} than the others; the torque differs by up to {off:.3g} N m, limit {limit:.3g} N m"
        )
        do = "If the transducer was calibrated anew in between, give the runs before and after a campaign each."
        yield Contradiction(None, off, limit, message, do)
        return
    for manifest in others:
        here = _numbers(manifest.calibration[side])
        off = _off(manifest.calibration[side], usual)
        message = (
            f"the calibration of the {side}'s {transducer} is {_shown(here)}, in "
            f"{counted(count, 'other recording')} {_shown(usual)}; the torque differs by up to {off:.3g} N m, "
            f"limit {limit:.3g} N m"
        )
        do = "Correct calibration.toml of this recording; one transducer has one calibration."
        yield Contradiction(manifest, off, limit, message, do)


def _usual_calibration(side: str, carried: list[Manifest]) -> tuple[tuple[float, float, float], int, float]:
    """Calibration that most recordings carry, how many do, and how far off the torque by another may be [N m]."""
    usual, count = Counter(_numbers(m.calibration[side]) for m in carried).most_common(1)[0]
    return usual, count, CALIBRATION_OF_NOMINAL * usual[2]


def _since(others: list[Manifest], carried: list[Manifest]) -> bool:
    """Whether several recordings are the last of all, or the first: a calibration that was made in between."""
    ordered = sorted(carried, key=lambda manifest: manifest.started_at)
    files = {manifest.identifier for manifest in others}
    ends = {m.identifier for m in ordered[-len(files) :]}, {m.identifier for m in ordered[: len(files)]}
    return len(files) >= FEWEST_PAIRS and files in ends


def _numbers(transducer: Transducer) -> tuple[float, float, float]:
    """Zero [Hz], span [Hz] and nominal torque [N m], by which calibrations are compared."""
    return transducer.null_frequency_hz, transducer.span_hz, transducer.nominal_torque


def _shown(numbers: tuple[float, float, float]) -> str:
    return f"{numbers[0]:.8g} Hz at zero and {numbers[1]:.8g} Hz at {numbers[2]:.8g} N m"


def _off(transducer: Transducer, usual: tuple[float, float, float]) -> float:
    """Largest difference of the torque [N m] between two calibrations, over the nominal range of the usual one."""
    zero, span, nominal = usual
    torque = np.array([-1.0, 0.0, 1.0]) * nominal
    return float(np.max(np.abs(transducer.torque(zero + torque * span / nominal) - torque)))


def samples_of_another_run(manifests: Sequence[Manifest], _: BenchParameters) -> Iterator[Contradiction]:
    """Windows whose means are those of a window of another run to the last digit: noise never repeats itself."""
    first: dict[tuple[float, ...], Row] = {}
    for row in sorted(accepted_rows(manifests), key=lambda row: (row.manifest.started_at, row.manifest.identifier)):
        means = row.window.means
        numbers = [number for shaft in means for number in (shaft.torque, shaft.within, shaft.speed)]
        if not np.isfinite(numbers).all() or not all(shaft.within > 0.0 for shaft in means):
            continue
        same = first.setdefault((means.n, *numbers), row)
        if same.manifest.identifier != row.manifest.identifier:
            message = (
                f"torques, speeds and scatter are those of {same.manifest.file}: {same.window.point} to the last "
                "digit; expected noise that differs from run to run: the same samples came under another name or start"
            )
            do = "Find out which run they are of; a copy is no repeat, and may be left out of the folder."
            yield Contradiction(row, 0.0, 0.0, message, do)


def versions_of_one_run(manifests: Sequence[Manifest], _: BenchParameters) -> Iterator[Contradiction]:
    """Recordings of one run, by its start and its point, whose torques differ: one of them was corrected.

    Notes
    -----
    Nothing tells which is right. Points that nobody named are the same where name of the file or set-points are, and
    nothing else has this start; an import may give many runs one.
    """
    groups: dict[tuple[object, ...], list[Row]] = defaultdict(list)
    for row in accepted_rows(manifests):
        imported = row.manifest.origin is not None or row.manifest.supplied is not None
        if row.manifest.run.point or not imported:
            groups[row.manifest.started_at, row.window.point].append(row)
        if not (row.manifest.run.point or imported):
            groups[(row.manifest.started_at,)].append(row)
    told = set()
    for key, rows in groups.items():
        if len(key) == 1 and len({_asked(row) for row in rows}) > 1:
            continue
        for row in rows:
            off, limit, side, other = max(_versions(row, rows), key=lambda v: v[0] - v[1], default=(0.0, 0.0, "", ""))
            if off > limit and row.key not in told:
                told.add(row.key)
                message = (
                    f"{other} holds the same run, by its start and point, in another version: the torque of the {side} "
                    f"differs by {off:.3g} N m, limit {limit:.3g} N m"
                )
                do = "Put the right version in the place of the other, and ingest both folders again."
                yield Contradiction(row, off, limit, message, do)


def _versions(row: Row, rows: Sequence[Row]) -> Iterator[tuple[float, float, str, str]]:
    """How far the torques of a window are off those of the same samples in other files, by shaft and file [N m]."""
    for other in rows:
        if in_two_files(row.manifest, row.window, other.manifest, other.window):
            for side in SIDES:
                apart = torque_apart(row.manifest, row.window, other.manifest, other.window, side)
                yield (*apart, side, other.manifest.file)


def repeats_that_differ(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    """Repeats of one point whose mean torques differ by more than noise, drift and the other repeats let expect.

    Notes
    -----
    Of three or more, those that lie off the median by half the limit are doubted; of two, both, as nothing tells which.
    Shafts that are held are left out: their torque is a static reaction. A gradual drift of the bench is in the
    scatter of all repeats.
    """
    groups: dict[tuple[object, ...], list[Row]] = defaultdict(list)
    for row in accepted_rows(manifests):
        groups[_asked(row)].append(row)
    for side in SIDES:
        turning = [_turning(rows, side) for rows in groups.values()]
        repeated = [rows for rows in turning if len(rows) > 1]
        torques = [np.array([row.window.means[side].torque for row in rows]) for rows in repeated]
        steps = np.concatenate([np.diff(torque) for torque in torques]) if torques else np.zeros(0)
        usual = robust_scale(np.concatenate((steps, -steps))) if len(torques) >= FEWEST_PAIRS else 0.0
        least = max(REPEAT_OF_NOMINAL * float(bench.transducers[side].nominal_torque), SIGMAS * usual)
        for rows, torque in zip(repeated, torques, strict=True):
            within = np.nan_to_num(np.array([row.window.means[side].within for row in rows]))
            limit = max(least, SIGMAS * float(np.hypot(*np.sort(within)[-2:])))
            if np.ptp(torque) <= limit:
                continue
            off = np.abs(torque - np.median(torque))
            for place in np.flatnonzero(off > 0.5 * limit if len(rows) > 2 else off >= 0.0).tolist():
                farthest = int(np.argmax(np.abs(torque - torque[place])))
                apart = float(abs(torque[farthest] - torque[place]))
                message = (
                    f"the torque of the {side} is {torque[place]:.3f} N m, in {rows[farthest].manifest.file} at "
                    f"the same point {torque[farthest]:.3f} N m; apart by {apart:.3f} N m, limit {limit:.3f} N m"
                )
                do = "Find out which is wrong (zero, load, mounting), and run the point once more."
                yield Contradiction(rows[place], apart, limit, message, do, side, apart)


def _turning(rows: list[Row], side: str) -> list[Row]:
    """Those with a mean torque of the shaft in which it is not held."""
    known = (row for row in rows if np.isfinite(row.window.means[side].torque))
    return [row for row in known if not getattr(row.window, f"rest_{side}")]


def _asked(row: Row) -> tuple[object, ...]:
    """What was asked for at a point, by which repeats are known."""
    window, asked = row.window, row.window.setpoints
    speeds = [
        round((window.means[side].speed if value is None else value) / RPM)
        for side, value in (("sun", asked.speed_sun), ("ring", asked.speed_ring))
    ]
    load = None if asked.torque_ring is None else round(asked.torque_ring, 3)
    unknown = load is None and str(window.configuration) == "engaged"
    return (str(window.configuration), window.gear, window.drive, *speeds, row.key if unknown else load)


def simulated_among_measured(manifests: Sequence[Manifest], _: BenchParameters) -> Iterator[Contradiction]:
    """Recordings that their writer marked as simulated, in a campaign most of which is measured."""
    marked = [manifest for manifest in manifests if marked_as_simulated(manifest)]
    measured = len(manifests) - len(marked)
    if not marked or not measured:
        return
    if measured < len(marked):
        message = f"{counted(measured, 'measured recording')} among {len(marked)} that are marked as simulated"
        yield Contradiction(None, float(measured), 0.0, message, "Give simulated recordings a campaign of their own.")
        return
    for manifest in marked:
        message = f"marked as simulated by its writer, in a campaign with {counted(measured, 'measured recording')}"
        do = "Give simulated recordings a campaign of their own."
        yield Contradiction(manifest, 1.0, 0.0, message, do)
