"""Recordings that are not of the machine they are to be analysed as: ratio of speeds, gear, nominal torques."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from pmg.pipeline.grid.crosschecks.declared import RATIO_LIMIT, TURNS
from pmg.pipeline.recording.remark import Remark
from pmg.sim.grid import Configuration

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from pmg.pipeline.preflight.found import File
    from pmg.sim.bench import BenchParameters

ADVICE = "Name the file of the machine by --machine, or correct what the recordings say."
"""Advice for all of these."""


def unlike_the_machine(files: Iterable[File], bench: BenchParameters) -> Iterator[Remark]:
    """Remarks on recordings whose set-points, gear or calibration are those of another machine.

    Parameters
    ----------
    files : iterable of File
        Recordings, as far as they were looked at.
    bench : BenchParameters
        The machine.
    """
    looked = list(files)
    strays: Counter[tuple[int, str]] = Counter()
    for point in (point for file in looked for point in file.points):
        sun, ring = point.setpoints.speed_sun, point.setpoints.speed_ring
        if point.configuration != Configuration.ENGAGED or sun is None or ring is None:
            continue
        ratio, turn = bench.gear(point.gear).ratio, min(abs(sun), abs(ring)) > TURNS
        if point.gear not in bench.stages or (turn and abs(abs(sun / ring) / ratio - 1.0) > RATIO_LIMIT):
            strays[point.gear, f"{abs(sun / ring):.3f}" if turn else "not known"] += 1
    has = " and ".join(f"{bench.gear(stage).ratio:.3f} of gear {stage}" for stage in bench.stages)
    for (gear, found), count in strays.items():
        message = f"{count} engaged points in gear {gear} have speeds in the ratio {found}; expected {has}. {ADVICE}"
        yield Remark("warning", "gear", message)
    for side, transducer in bench.transducers.items():
        ours = float(transducer.nominal_torque)
        stated = Counter(file.nominal[side] for file in looked if file.nominal is not None)
        for value, count in stated.items():
            if value != ours:
                message = f"{count} recordings state a nominal torque of {value:g} N m; expected {ours:g} N m. {ADVICE}"
                yield Remark("warning", f"transducer of the {side}", message)
