"""Gear, configuration and driving side that runs declare held against speeds and powers, and the encoders at last."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.crosschecks.contradiction import Contradiction, accepted_rows, robust_scale
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, PerShaft, other_side
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.store.manifest import Manifest, StoredWindow
    from pmg.sim.bench import BenchParameters

TURNS = 25.0 * RPM
"""Speed above which a ratio of speeds tells a gear [rad/s]."""
RATIO_LIMIT = 0.01
"""How far the ratio of the speeds may be off that of the gear, as part of it; both carry one encoder's resolution."""
SAME_RATIO = 0.002
"""Ratio as close to that of a gear as coupled shafts have it."""
NORMAL_MEDIAN = 1.2533
"""Standard error of a median of normal numbers, over that of their mean."""
COUPLED = 2e-4
"""How far the ratio of coupled shafts may be off that of the gear over a campaign, as part of it: poles count exactly,
and so do encoders, whatever the torque."""
FEW_RUNS, SURE = 6, 5.0
"""Coupled runs from which their common ratio is known, and its standard errors from which it is off."""
CARRIED = 0.5
"""Part of the power that goes in at one shaft and comes out at the other, above which the shafts are coupled."""
LOADED = 0.05
"""Part of the nominal torque from which a load tells which side drives."""


def gears_by_speeds(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    """Engaged runs whose speeds are those of the other gear, or of none."""
    for row in accepted_rows(manifests):
        window = row.window
        if window.configuration != Configuration.ENGAGED or not _turns(window):
            continue
        found = -window.means.sun.speed / window.means.ring.speed
        declared = window.gear
        off = {gear: abs(found / _ratio(bench, gear) - 1.0) for gear in (declared, *bench.stages)}
        if declared not in bench.stages:
            has = " and ".join(f"gear {gear} ({_ratio(bench, gear):.3f})" for gear in bench.stages)
            message = f"declared engaged in gear {declared}; expected {has} of this machine; the speeds have the ratio "
            do = "Correct the gear in the run's metadata, or 'stage' in the machine file."
            yield Contradiction(row, off[bench.stages[0]], RATIO_LIMIT, f"{message}{found:.3f}", do)
            continue
        if off[declared] <= RATIO_LIMIT:
            continue
        others = [gear for gear in bench.stages if gear != declared and off[gear] <= RATIO_LIMIT]
        none = "neither gear" if len(bench.stages) > 1 else "no gear of this machine"
        other = f", that of gear {others[0]}" if others else f", that of {none}: neutral, or the poles slip"
        message = (
            f"declared engaged in gear {declared} ({_ratio(bench, declared):.3f}), but the speeds have the ratio "
            f"{found:.3f}{other}; off by {100 * off[declared]:.1f} %, limit {100 * RATIO_LIMIT:g} %"
        )
        do = (
            "Correct gear or configuration in the run's metadata, or run it again; recordings of another machine need "
            "its file (--machine) and a store of their own."
        )
        yield Contradiction(row, off[declared], RATIO_LIMIT, message, do)


def encoders_off_the_ratio(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    """Engaged runs of a gear whose speeds are all off its ratio by the same part: an encoder that counts wrongly."""
    engaged = [row.window for row in accepted_rows(manifests) if row.window.configuration == Configuration.ENGAGED]
    turning = [window for window in engaged if _turns(window)]
    for gear in sorted({window.gear for window in turning} & set(bench.stages)):
        own, ratio = [window for window in turning if window.gear == gear], _ratio(bench, gear)
        off = np.array([-window.means.sun.speed / window.means.ring.speed / ratio - 1.0 for window in own])
        usual = float(np.median(off)) if len(own) >= FEW_RUNS else 0.0
        scale = robust_scale(off)
        if abs(usual) > max(COUPLED, SURE * NORMAL_MEDIAN * scale / np.sqrt(len(own))):
            message = (
                f"engaged in gear {gear}: the ratio of the speeds is {100 * usual:+.3f} % off the gear's {ratio:.4g} "
                f"at {len(own)} points (they scatter by {100 * scale:.3f} %), limit {100 * COUPLED:g} %. Poles that "
                f"keep step have it exactly: the sun's encoder is out by {100 * usual:+.3f} %, or the ring's by "
                f"{-100 * usual:+.3f} %{_against_set(own)}"
            )
            do = "Check the counts per turn of both encoders, and the pole pairs of the gear in the machine file."
            yield Contradiction(None, abs(usual), COUPLED, message, do)


def _against_set(windows: Sequence[StoredWindow]) -> str:
    """How far the speeds of both shafts are off what was asked for, in words; empty where that is not recorded."""
    words = []
    for side in SIDES:
        pairs = [(window.means[side].speed, getattr(window.setpoints, f"speed_{side}")) for window in windows]
        parts = [found / asked - 1.0 for found, asked in pairs if asked]
        if parts:
            words.append(f"the {side}'s by {100 * float(np.median(parts)):+.3f} %")
    return f" (off their set-points: {', '.join(words)})" if words else ""


def coupled_in_neutral(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    """Runs declared neutral in which power goes in at one shaft and comes out at the other, at the gear's own ratio."""
    for row in accepted_rows(manifests):
        window = row.window
        if window.configuration != Configuration.NEUTRAL or not _turns(window):
            continue
        found = -window.means.sun.speed / window.means.ring.speed
        near = [gear for gear in bench.stages if abs(found / _ratio(bench, gear) - 1.0) <= SAME_RATIO]
        power = _powers(window)
        smaller = min(abs(power.sun), abs(power.ring))
        if not near or power.sun * power.ring >= 0.0 or not _loaded(window, bench):
            continue
        carried = smaller / max(abs(power.sun), abs(power.ring))
        if carried > CARRIED:
            message = (
                f"declared neutral, but the speeds have the ratio of gear {near[0]} and {100 * carried:.0f} % of the "
                f"power that goes in at one shaft comes out at the other, limit {100 * CARRIED:g} %"
            )
            do = "Correct the configuration in the run's metadata, or run it again."
            yield Contradiction(row, carried, CARRIED, message, do)


def driven_from_the_other_side(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    """Engaged runs under load in which the power goes in at the other shaft than the declared one."""
    for row in accepted_rows(manifests):
        window = row.window
        if window.configuration != Configuration.ENGAGED or not _turns(window) or not _loaded(window, bench):
            continue
        power = _powers(window)
        if power[window.drive] < 0.0 < power[other_side(window.drive)]:
            message = (
                f"declared as driven by the {window.drive}, but power of {abs(power[window.drive]):.1f} W comes out "
                f"there and goes in at the {other_side(window.drive)}"
            )
            do = "Correct 'drive' in the run's metadata; it decides which way efficiencies are taken."
            yield Contradiction(row, abs(power[window.drive]), 0.0, message, do)


def _ratio(bench: BenchParameters, gear: int) -> float:
    return float(bench.ratio(np.array([gear]))[0])


def _turns(window: StoredWindow) -> bool:
    """Whether both shafts turn fast enough for their ratio to tell."""
    return all(abs(shaft.speed) > TURNS for shaft in window.means)


def _powers(window: StoredWindow) -> PerShaft[float]:
    """Power that goes in at each shaft [W]."""
    return window.means.map(lambda shaft: shaft.torque * shaft.speed)


def _loaded(window: StoredWindow, bench: BenchParameters) -> bool:
    """Whether either torque is large enough for the powers to tell."""
    return any(
        abs(shaft.torque) > LOADED * bench.transducers[side].nominal_torque for side, shaft in window.means.items()
    )
