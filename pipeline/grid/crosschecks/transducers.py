"""The two transducers of a campaign held against each other, by ratio and power."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.crosschecks.contradiction import Contradiction, accepted_rows
from pmg.sim.grid import Configuration
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.bench import BenchParameters

FEWEST = 6
"""Engaged points from which the slope of one torque against the other is known."""
LIMIT = 0.1
"""How far the slope may be off the ratio of the gear, as part of it: losses that grow with load stay below."""
SHOWN = 4.0
"""And how many of its standard errors."""


def transducers_off_the_ratio(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    r"""Torques of the two shafts whose slope against each other is not the ratio of the gear.

    Notes
    -----
    In one gear, driven one way, :math:`T_\mathrm{sun} = g T_\mathrm{ring} / r + a\,\mathrm{sign}\,\omega + b\,\omega`
    with the speed ratio r: the losses that do not depend on load are in a and b, those that do in g, which stays near
    1. A gain error of either transducer, or the two taken for each other, moves g.
    """
    rows = [row for row in accepted_rows(manifests) if row.window.configuration == Configuration.ENGAGED]
    for gear, drive in sorted({(row.window.gear, row.window.drive) for row in rows}):
        windows = [r.window for r in rows if (r.window.gear, r.window.drive) == (gear, drive)]
        windows = [w for w in windows if not (w.rest_sun or w.rest_ring)]
        torque = np.array([[w.means.sun.torque, w.means.ring.torque] for w in windows]).reshape(-1, 2)
        speed = np.array([w.means.sun.speed for w in windows])
        known = np.isfinite(torque).all(axis=1) & np.isfinite(speed)
        if int(known.sum()) < FEWEST:
            continue
        torque, speed = torque[known], speed[known]
        ratio = float(bench.ratio(np.array([gear]))[0])
        basis = np.column_stack((torque[:, 1] / ratio, np.sign(speed), speed / np.max(np.abs(speed), initial=RPM)))
        found, _, rank, _ = np.linalg.lstsq(basis, torque[:, 0], rcond=1e-6)
        if rank < basis.shape[1] or len(speed) <= basis.shape[1]:
            continue
        left = torque[:, 0] - basis @ found
        spread = float(left @ left) / (len(speed) - basis.shape[1])
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
