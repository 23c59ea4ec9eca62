"""One recording held against the others of its campaign: calibration, repeats, simulated among measured."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import TYPE_CHECKING

import numpy as np

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
SAME = 1e-6
"""Relative difference of two numbers of a calibration that is none but rounding."""
REPEAT_OF_NOMINAL = 0.01
"""How far two repeats of a point may differ in any case, as part of the nominal torque."""
FEWEST_PAIRS = 3
"""Pairs of repeats from which their scatter is known."""


def calibrations_unlike_the_others(manifests: Sequence[Manifest], _: BenchParameters) -> Iterator[Contradiction]:
    """Recordings whose calibration of a transducer is not that of the others with its serial number."""
    for side in SIDES:
        by_serial: dict[str, list[Manifest]] = defaultdict(list)
        for manifest in manifests:
            if manifest.calibration[side].serial:
                by_serial[manifest.calibration[side].serial].append(manifest)
        for serial, carried in by_serial.items():
            usual, count = Counter(_numbers(m.calibration[side]) for m in carried).most_common(1)[0]
            if count < max(FEWEST_PAIRS, USUAL * len(carried)):
                continue
            for manifest in carried:
                transducer = manifest.calibration[side]
                if np.allclose(_numbers(transducer), usual, rtol=SAME, atol=0.0):
                    continue
                off = _off(transducer, usual)
                message = (
                    f"the calibration of the {side}'s transducer {serial} is {_shown(_numbers(transducer))}, in "
                    f"{counted(count, 'other recording')} {_shown(usual)}; the torque differs by up to {off:.3g} N m"
                )
                do = "Correct calibration.toml of this recording; one transducer has one calibration."
                yield Contradiction(manifest, off, 0.0, message, do)


def _numbers(transducer: Transducer) -> tuple[float, float, float]:
    """Zero [Hz], span [Hz] and nominal torque [N m], by which calibrations are compared."""
    return transducer.null_frequency_hz, transducer.span_hz, transducer.nominal_torque


def _shown(numbers: tuple[float, float, float]) -> str:
    return f"{numbers[0]:g} Hz at zero and {numbers[1]:g} Hz at {numbers[2]:g} N m"


def _off(transducer: Transducer, usual: tuple[float, float, float]) -> float:
    """Largest difference of the torque [N m] between two calibrations, over the nominal range of the usual one."""
    zero, span, nominal = usual
    torque = np.array([-1.0, 0.0, 1.0]) * nominal
    return float(np.max(np.abs(transducer.torque(zero + torque * span / nominal) - torque)))


def repeats_that_differ(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    """Repeats of one point whose mean torques differ by more than noise, drift and the other repeats let expect.

    Notes
    -----
    Of three or more, one that lies off the median of the others is doubted; of two, both, as nothing tells which.
    Shafts that are held are left out: their torque is a static reaction. A gradual drift of the bench is in the
    scatter of all repeats.
    """
    groups: dict[tuple[object, ...], list[Row]] = defaultdict(list)
    for row in accepted_rows(manifests):
        groups[_asked(row)].append(row)
    repeated = [rows for rows in groups.values() if len(rows) > 1]
    for side in SIDES:
        turning = [rows for rows in repeated if not any(getattr(row.window, f"rest_{side}") for row in rows)]
        steps = [np.diff([row.window.means[side].torque for row in rows]) for rows in turning]
        usual = (
            robust_scale(np.concatenate([*steps, *(-step for step in steps)])) if len(steps) >= FEWEST_PAIRS else 0.0
        )
        least = max(REPEAT_OF_NOMINAL * float(bench.transducers[side].nominal_torque), SIGMAS * usual)
        for rows in turning:
            torque = np.array([row.window.means[side].torque for row in rows])
            within = np.nan_to_num(np.array([row.window.means[side].within for row in rows]))
            for place, row in enumerate(rows):
                others = np.delete(torque, place)
                off = float(abs(torque[place] - np.median(others)))
                limit = max(least, SIGMAS * float(np.hypot(within[place], np.max(np.delete(within, place)))))
                doubted = off > limit and (len(rows) == 2 or off > 2.0 * float(np.ptp(others)))
                if doubted:
                    named = next(other.manifest.file for other in rows if other is not row)
                    message = (
                        f"the torque of the {side} is {torque[place]:.3f} N m, in {counted(len(others), 'repeat')} "
                        f"of it {np.median(others):.3f} N m ({named}); apart by {off:.3f} N m, "
                        f"limit {limit:.3f} N m"
                    )
                    do = "Find out which is wrong (zero, load, mounting), and run the point once more."
                    yield Contradiction(row, off, limit, message, do, side, off if len(rows) == 2 else 0.0)


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
    if not marked or measured < len(marked):
        return
    for manifest in marked:
        message = f"marked as simulated by its writer, in a campaign with {counted(measured, 'measured recording')}"
        do = "Give simulated recordings a campaign of their own."
        yield Contradiction(manifest, 1.0, 0.0, message, do)
