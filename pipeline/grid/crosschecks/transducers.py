"""The two transducers of a campaign held against each other, by ratio and power."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.crosschecks.contradiction import (
    SIGMAS,
    Contradiction,
    accepted_rows,
    least_absolute,
    robust_scale,
)
from pmg.sim.grid import Configuration
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.grid.crosschecks.contradiction import Row
    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

FEWEST = 6
"""Engaged points from which the slope of one torque against the other is known."""
LIMIT = 0.1
"""How far the slope may be off the ratio of the gear, as part of it: losses that grow with load stay below."""
SHOWN = 4.0
"""And how many of its standard errors."""
ENOUGH = 12
"""Engaged points from which each is held against the line of the others."""
VOID = ", of the wrong sign or more than twice as large"
"""Said of a torque that tells nothing any more."""
OFF_OF_NOMINAL, OFF_OF_TORQUE = 0.01, 0.05
"""Limits of the distance from that line, as part of the nominal torque and of the expected one."""


def transducers_off_the_ratio(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    r"""Torques of the two shafts whose slope against each other is not the ratio of the gear.

    Notes
    -----
    In one gear, driven one way, :math:`T_\mathrm{sun} = g T_\mathrm{ring} / r + a\,\mathrm{sign}\,\omega + b\,\omega`
    with the speed ratio r: the losses that do not depend on load are in a and b, those that do in g, which stays near
    1. A gain error of either transducer, or the two taken for each other, moves g.
    """
    for gear, drive, _, torque, basis, ratio in _engaged(manifests, bench, FEWEST):
        found, _, rank, _ = np.linalg.lstsq(basis, torque, rcond=1e-6)
        if rank < basis.shape[1] or len(torque) <= basis.shape[1]:
            continue
        left = torque - basis @ found
        spread = float(left @ left) / (len(torque) - basis.shape[1])
        error = float(np.sqrt(spread * np.linalg.inv(basis.T @ basis)[0, 0]))
        off = abs(float(found[0]) - 1.0)
        if off > max(LIMIT, SHOWN * error):
            message = (
                f"engaged in gear {gear}, driven by the {drive}: the sun's torque grows by {found[0]:.3f} +- "
                f"{error:.3f} of what the ring's asks for by the ratio {ratio:.3f}, limit 1 +- {LIMIT:g}; a gain of "
                f"the sun's transducer off by the factor {found[0]:.2f}, or of the ring's by {1.0 / found[0]:.2f}, "
                "explains it"
            )
            do = "Check span and nominal torque of both calibrations, and that the two cables are not swapped."
            yield Contradiction(None, off, LIMIT, message, do)


def torques_off_the_other_shaft(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    """Torques of the sun that are off what the ring's asks for, unlike those of the campaign's other engaged points.

    A zero offset is common to all points and is left to the diagnosis; the doubt is about both means of a point. One of
    the wrong sign, or more than twice what is asked for, is void.
    """
    for gear, drive, rows, torque, basis, ratio in _engaged(manifests, bench, ENOUGH):
        line = np.column_stack((basis, np.ones(len(torque))))
        expected = line @ least_absolute(line, torque)
        off = torque - expected
        least = max(OFF_OF_NOMINAL * float(bench.transducer_sun.nominal_torque), SIGMAS * robust_scale(off))
        limits = np.maximum(least, OFF_OF_TORQUE * np.abs(expected))
        for row, distance, asked, limit in zip(rows, off.tolist(), expected.tolist(), limits.tolist(), strict=True):
            if abs(distance) > limit:
                void = abs(distance) > abs(asked) + least
                words = VOID if void else ""
                message = (
                    f"the torque of the sun is {row.window.means.sun.torque:.3f} N m, {distance:+.3f} N m off what the "
                    f"ring's asks for at the other points of gear {gear} driven by the {drive}, "
                    f"limit {limit:.3f} N m{words}"
                )
                do = "Find out which transducer is wrong (zero, gain, cable), and run the point once more."
                wider = abs(distance) * max(ratio, 1.0)
                yield Contradiction(row, abs(distance), limit, message, do, wider=wider, void=void)


def _engaged(
    manifests: Sequence[Manifest], bench: BenchParameters, fewest: int
) -> Iterator[tuple[int, str, list[Row], Array, Array, float]]:
    """Points by gear and drive: their rows, torques of the sun (n,), what those follow (n, 3), and the ratio."""
    engaged = [row for row in accepted_rows(manifests) if row.window.configuration == Configuration.ENGAGED]
    for gear, drive in sorted({(row.window.gear, row.window.drive) for row in engaged}):
        rows = [row for row in engaged if (row.window.gear, row.window.drive) == (gear, drive)]
        rows = [row for row in rows if not (row.window.rest_sun or row.window.rest_ring)]
        means = [row.window.means for row in rows]
        torque = np.array([[m.sun.torque, m.ring.torque] for m in means]).reshape(-1, 2)
        speed = np.array([m.sun.speed for m in means])
        known = np.isfinite(torque).all(axis=1) & np.isfinite(speed)
        if int(known.sum()) < fewest:
            continue
        torque, speed = torque[known], speed[known]
        ratio = float(bench.ratio(np.array([gear]))[0])
        basis = np.column_stack((torque[:, 1] / ratio, np.sign(speed), speed / np.max(np.abs(speed), initial=RPM)))
        yield gear, drive, [row for row, one in zip(rows, known, strict=True) if one], torque[:, 0], basis, ratio
