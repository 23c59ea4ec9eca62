"""Faults that only a campaign shows: declarations, set-points, repeats, calibrations, clocks, copies, mixtures."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace

from mcap.writer import CompressionType

from tests.grid import checked_campaign
from tests.grid.checked_campaign import ENGAGED, NEUTRAL, Runs
from tests.recording.writer import CALIBRATION

from .case import Case, Desk
from .signals import changed


def run(name: str = NEUTRAL, **metadata: str | None) -> Callable[[Runs], None]:
    """Entries of the run of a recording changed."""

    def plant(runs: Runs) -> None:
        runs[name] = replace(runs[name], run=dict(runs[name].run) | metadata)

    return plant


def every(
    change: Callable[[str], Callable[[Runs], object]], names: Callable[[str], bool] = bool
) -> Callable[[Runs], None]:
    """The same change of many recordings."""

    def plant(runs: Runs) -> None:
        for name in list(runs):
            if names(name):
                change(name)(runs)

    return plant


def _gone(*names: str) -> Callable[[Runs], None]:
    def plant(runs: Runs) -> None:
        for name in names:
            del runs[name]

    return plant


def _again(**changes: object) -> Callable[[Runs], None]:
    """A copy of a run in a file of other bytes."""

    def plant(runs: Runs) -> None:
        runs["99.mcap"] = replace(runs[NEUTRAL], **changes)  # type: ignore[arg-type]

    return plant


def _unnamed_again(runs: Runs) -> None:
    first = replace(runs[NEUTRAL], run=dict(runs[NEUTRAL].run) | {"point": None})
    runs[NEUTRAL], runs["99.mcap"] = first, replace(first, calibration=CALIBRATION.replace("10003.2", "10007.2"))


def _copy(desk: Desk) -> None:
    shutil.copy(desk.recordings / NEUTRAL, desk.recordings / "copy.mcap")


def _swapped_names(runs: Runs) -> None:
    """The runs of two points exchanged, with their names left."""
    first, second = runs["15.mcap"], runs["17.mcap"]
    runs["15.mcap"] = replace(first, torque=second.torque)
    runs["17.mcap"] = replace(second, torque=first.torque)


def _older(text: str, new: str) -> Callable[[str], Callable[[Runs], object]]:
    return lambda name: changed(name, calibration=CALIBRATION.replace(text, new, 1))


PLANTED: tuple[tuple[str, Callable[[Runs], object]], ...] = (
    ("serial number of one calibration another", changed(calibration=CALIBRATION.replace("T-sun", "T-other"))),
    (
        "calibration without serial and another span",
        changed(calibration=CALIBRATION.replace('serial = "T-sun"\n', "").replace("5000.0", "6000.0")),
    ),
    (
        "calibrations of both shafts exchanged",
        changed(calibration=CALIBRATION.replace("sun", "?").replace("ring", "sun").replace("?", "ring")),
    ),
    ("calibration missing", changed(calibration=None)),
    ("same run in a second file of other bytes", _again(compression=CompressionType.LZ4)),
    ("corrected version of a run in a second file", _again(calibration=CALIBRATION.replace("10003.2", "10007.2"))),
    ("the same where nobody named the point", _unnamed_again),
    ("name of a point used twice", run(point="P04")),
    ("name of the campaign in capitals in one run", run(campaign="Made")),
    ("half of the recordings of another campaign", every(lambda n: run(n, campaign="other"), lambda n: n > "20.mcap")),
    ("recording of an engaged point gone", _gone(ENGAGED)),
    ("all zero checks gone", _gone("00.mcap", "01.mcap")),
    ("runs of two loads exchanged", _swapped_names),
    ("configuration that does not exist", run(configuration="enagaged")),
    ("configuration missing", run(configuration=None)),
    ("gear 3", run(ENGAGED, gear="3")),
    ("gear missing", run(ENGAGED, gear=None)),
    ("drive missing", run(ENGAGED, drive=None)),
    ("layout of another version", run(layout="pmg.v2")),
    ("start missing", run(started_at=None)),
    ("start without a time zone", run(started_at="2025-04-23T08:03:00")),
    ("start in local time, two hours on", run(started_at="2025-04-23T10:03:00Z")),
    ("start that is no time", run(started_at="yesterday")),
    ("start of another run", run(started_at="2025-04-23T08:16:00Z")),
    ("set load in mN m", run(ENGAGED, ring_torque_set_Nm="780")),
    ("set load that is no number", run(ENGAGED, ring_torque_set_Nm="nan")),
    ("set load missing", run(ENGAGED, ring_torque_set_Nm=None)),
    ("set speed in rad/s", run(sun_speed_set_rpm="31.4")),
    ("set speed of the wrong sign", run(sun_speed_set_rpm="-300")),
    ("set speed with a comma", run(sun_speed_set_rpm="300,0")),
    ("a key of the run misspelt", run(sun_speed_set_rpm=None, sun_sped_set_rpm="300")),
    ("calibration from half of the campaign on another", every(_older("10003.2", "10103.2"), lambda n: n > "20.mcap")),
)

ELSEWHERE = ("spikes",)
"""Cross-checks whose faults are signals, planted there."""

CASES = (
    *(
        Case("campaign", fault.what, fault.plant, says=f"{fault.check}:" if fault.check else "")
        for fault in (*checked_campaign.FAULTS, *checked_campaign.MORE_FAULTS)
        if fault.check and fault.check not in ELSEWHERE
    ),
    *(Case("campaign", what, plant) for what, plant in PLANTED),
    Case("campaign", "same file twice", spoil=_copy, says="same bytes"),
)
