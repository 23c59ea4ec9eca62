"""The neutral torques of both shafts together, over the speeds that the engaged gear runs at."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import names_of, sun_speed_label
from pmg.pipeline.grid.levels import APART_RPM
from pmg.pipeline.report.document import Chart, Figure, Series
from pmg.pipeline.wording import numerals
from pmg.sim.shafts import PerShaft
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.sim.grid import Grid

DRAWN = 41
"""Speeds at which the curves are drawn."""


def total_torque_figure(grid: Grid, fits: LossFits) -> tuple[Figure, ...]:
    r"""Sum of the neutral torques of sun and ring against the sun's speed; none without engaged points.

    Notes
    -----
    The ring's torque is taken at the ring's speed that goes with the sun's when engaged,
    :math:`T_b(n_s) = T_{bs}(n_s) + T_{br}(n_s/i)` (thesis, section 4.3.3): a plain sum of two torques on two shafts.
    The drag that the sun feels is :math:`T_{bs} + T_{br}/i`.
    """
    at = grid.points
    engaged = np.asarray(at.engaged & grid.accepted & (at.speed_ring != 0.0))
    if not engaged.any():
        return ()
    ratio = float(np.median(np.abs(at.speed_sun[engaged] / at.speed_ring[engaged])))
    speed = np.linspace(0.0, min(fits.sun.curve.speed_limit, ratio * fits.ring.curve.speed_limit), DRAWN)
    u = PerShaft(fits.sun.u_curve(speed), fits.ring.u_curve(speed / ratio))
    sun, ring = fits.sun.curve.torque(speed), fits.ring.curve.torque(speed / ratio)
    x = SPEED_SUN.display(speed)
    total = sun + ring
    chart = Chart(
        sun_speed_label(ratio),
        "neutral loss torque [N m]",
        (
            *_readings(grid, fits, ratio),
            Series("sun", x, sun, u.sun, "line", 0, "fit"),
            Series("ring", x, ring, u.ring, "line", 1, "fit"),
            Series("sun + ring", x, total, np.hypot(*u), "line", 2, "fit"),
            Series("referred to the sun", x, sun + ring / ratio, np.hypot(u.sun, u.ring / ratio), "line", 3, "fit"),
        ),
    )
    printed = " Figure 4.13 of the source." if grid.origin == "published" else ""
    return (
        Figure(
            "neutral-total",
            "Total neutral torque",
            f"At {x[-1]:.0f} rpm of the sun both shafts together take {numerals.number(float(total[-1]), 3)} N m: "
            f"{numerals.number(float(sun[-1]), 3)} on the sun and {numerals.number(float(ring[-1]), 3)} on the ring, "
            f"which the sun feels by 1/{ratio:.4g}. Lines: fits with U = 2u by their scatter; markers: points of the "
            f"neutral grid at this ratio of speeds.{printed}",
            (chart,),
        ),
    )


def _readings(grid: Grid, fits: LossFits, ratio: float) -> tuple[Series, ...]:
    """Readings of the neutral grid at the ratio of the engaged speeds; none where it has no such point."""
    at, both = grid.points, fits.sun.rows & fits.ring.rows
    apart = np.abs(SPEED_RING.display(np.abs(at.speed_sun) / ratio - np.abs(at.speed_ring)))
    rows = np.asarray(both & (apart <= APART_RPM))
    if not rows.any():
        return ()
    order = np.argsort(np.abs(at.speed_sun[rows]), kind="stable")
    x, points = SPEED_SUN.display(np.abs(at.speed_sun[rows]))[order], names_of(at.name[rows][order])
    drag = PerShaft(*(np.sign(w[rows]) * t[rows] for w, t in zip(at.speed, grid.torque, strict=True)))
    u = PerShaft(*(of[rows] for of in grid.u))
    shown = (
        ("sun", drag.sun, u.sun),
        ("ring", drag.ring, u.ring),
        ("sun + ring", drag.sun + drag.ring, np.hypot(*u)),
        ("referred to the sun", drag.sun + drag.ring / ratio, np.hypot(u.sun, u.ring / ratio)),
    )
    return tuple(
        Series(name, x, y[order], of[order], "markers", i, "read", points) for i, (name, y, of) in enumerate(shown)
    )
