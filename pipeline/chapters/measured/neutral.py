"""The chapter on the neutral losses: curves, their terms, what the other shaft does, repeats and order."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import in_relief, iso_levels, lay_out, names_in_cells, names_of
from pmg.pipeline.chapters.measured.neutral_total import total_torque_figure
from pmg.pipeline.grid.levels import forward_neutral, speed_levels
from pmg.pipeline.report.document import Chart, Column, Figure, Measured, Section, Series, SpeedMap, Table, Text
from pmg.pipeline.wording import numerals
from pmg.pipeline.wording.probability import nominal_p_text
from pmg.sim import signals, sources
from pmg.sim.signals import HOUR, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.drift import Drift
    from pmg.pipeline.fit.loss_fit import LossFit, LossFits
    from pmg.pipeline.fit.plane_fit import PlaneFits
    from pmg.pipeline.fit.term_choice import TermChoice
    from pmg.sim.grid import Grid

SHOWN = 10
"""Candidates of a ranking that are shown."""

PER_MILLI = 1e3
"""Torques of this chapter's tables are shown in thousandths."""


def neutral_section(analysis: Analysis, fits: LossFits) -> Section:
    """Neutral losses: maps over the speed grid, fitted curves and their terms, the other shaft, repeats and order."""
    grid = analysis.grid
    rows = forward_neutral(grid)
    if not rows.any():
        rows = np.asarray(grid.points.neutral & grid.accepted)
    sun, ring = speed_levels(grid.points[rows])
    names = names_in_cells(ring, sun, grid.points.name[rows])
    maps = []
    for signal, torque in zip(signals.TORQUES, grid.torque, strict=True):
        x, y, z = lay_out(ring, sun, torque[rows])
        labels = SPEED_RING.label, SPEED_SUN.label, signal.label
        maps.append(SpeedMap(x, y, z, *labels, contours=iso_levels(z), title=signal.meaning, points=names))
    charts = tuple(_curve_chart(grid, fit) for fit in fits)
    over_grid = Figure(
        "neutral-maps",
        "Torque over the neutral grid",
        f"Loss torque of the sun {_range(grid.torque_sun[rows])} N m and of the ring "
        f"{_range(grid.torque_ring[rows])} N m over {len(np.unique(sun))} × {len(np.unique(ring))} speeds. "
        "A shaft at 0 rpm is held by its motor: its reading is a static reaction.",
        tuple(maps),
        columns=2,
    )
    return Section(
        "neutral",
        "Neutral losses",
        (
            over_grid,
            *in_relief(over_grid, "The same torques as height: a point at each reading of the grid."),
            Figure(
                "loss-curves",
                "Loss curves",
                f"Fitted loss torque against the shaft's own speed: scatter about the curve {fits.sun.rmse * 1e3:.2f} "
                f"mN m (sun) and {fits.ring.rmse * 1e3:.2f} mN m (ring).",
                charts,
                columns=2,
            ),
            *total_torque_figure(grid, fits),
            _coefficients(fits),
            *(_ranking(choice) for choice in analysis.choices),
            *(() if analysis.plane is None else _plane(analysis.plane)),
            *(() if analysis.drift is None else _drift(analysis.drift)),
        ),
        (
            sources.THESIS.at("section 4.2.3"),
            sources.BURNHAM_ANDERSON,
            *((sources.BREIMAN,) if analysis.choices else ()),
            *((sources.HUBER,) if fits.sun.robust else ()),
            sources.HOLM,
        ),
    )


def _range(values: signals.Array) -> str:
    return f"{numerals.number(float(np.nanmin(values)), 3)} to {numerals.number(float(np.nanmax(values)), 3)}"


def _curve_chart(grid: Grid, fit: LossFit) -> Chart:
    own, speed = signals.SPEEDS[fit.shaft], grid.points.speed[fit.shaft]
    drag = fit.residuals + fit.curve.torque(speed[fit.rows])
    u = grid.u[fit.shaft][fit.rows]
    fine = np.linspace(0.0, fit.curve.speed_limit, 200)
    label = signals.LOSS_TORQUES[fit.shaft].label
    return Chart(
        own.label,
        label,
        (
            Series(
                "measured, U = 2u",
                own.display(np.abs(speed[fit.rows])),
                drag,
                u,
                "markers",
                0,
                points=names_of(grid.points.name[fit.rows]),
            ),
            Series("fit", own.display(fine), fit.curve.torque(fine), None, "line", 1),
        ),
        title=f"{fit.shaft} shaft",
    )


def _coefficients(fits: LossFits) -> Table:
    rows = []
    for fit in fits:
        for power, value, error in zip(fit.curve.powers, fit.curve.coefficients, fit.standard_errors, strict=True):
            unit = float(signals.SPEEDS[fit.shaft].display(fit.curve.speed_reference))
            rows.append(
                (
                    fit.shaft,
                    f"(n / {unit:.0f} rpm)^{power:g}" if power else "constant",
                    Measured(float(value), float(error)),
                    fit.r_squared,
                    fit.rmse * 1e3,
                    fit.error_thesis * 1e3,
                    fit.aicc if math.isfinite(fit.aicc) else None,
                )
            )
    return Table(
        "loss-fit",
        "Coefficients of the loss curves",
        f"{_manner(fits)} of the neutral torques; the coefficients have no bounds. The thesis's own error measure "
        "divides the root of the sum of squares by n, so it shrinks with the number of points; the scatter (RMSE) does "
        "not.",
        (
            Column("shaft", "Shaft"),
            Column("term", "Term"),
            Column("coefficient", "Coefficient", "N m", uncertain=True),
            Column("r_squared", "R²", "", digits=4),
            Column("rmse", "RMSE", "mN m", digits=2),
            Column("error_thesis", "thesis's error", "mN m", digits=3),
            Column("aicc", "AICc", "", digits=1),
        ),
        tuple(rows),
    )


def _manner(fits: LossFits) -> str:
    weighted = ", weighted by the uncertainty of the points," if fits.sun.weighted or fits.ring.weighted else ""
    if not fits.sun.robust:
        return f"Least squares{weighted}"
    return (
        f"Huber's M-estimate{weighted} with {fits.sun.down_weighted} readings of the sun and {fits.ring.down_weighted} "
        "of the ring down-weighted, errors from the sandwich covariance,"
    )


def _powers_text(powers: tuple[float, ...]) -> str:
    return ", ".join(f"{power:g}" for power in powers)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _ranking(choice: TermChoice) -> Table:
    best = choice.ranking[0]
    eligible = sum(rank.eligible for rank in choice.ranking)
    return Table(
        f"terms-{choice.shaft}",
        f"Terms of the {choice.shaft}'s curve, chosen by the data",
        f"Powers {_powers_text(best.powers)}: the smallest AICc among the {eligible} of {len(choice.ranking)} "
        f"candidates whose error at withheld speeds ({choice.levels} in turn) is within one standard error of the "
        f"smallest. The first {min(SHOWN, len(choice.ranking))} are shown.",
        (
            Column("powers", "Powers"),
            Column("aicc", "AICc", "", digits=1),
            Column("weight", "Akaike weight", "", digits=3),
            Column("withheld", "error at withheld speeds", "mN m", uncertain=True),
            Column("eligible", "within one standard error"),
        ),
        tuple(
            (
                _powers_text(rank.powers),
                rank.aicc,
                rank.weight,
                Measured(rank.cv_rmse * PER_MILLI, rank.cv_se * PER_MILLI),
                rank.eligible,
            )
            for rank in choice.ranking[:SHOWN]
        ),
    )


def _plane(plane: PlaneFits) -> tuple[Table, Text]:
    rows = tuple(
        (
            fit.shaft,
            term.name,
            Measured(term.size * PER_MILLI, term.size_u * PER_MILLI) if term.tested else None,
            term.share * PER_MILLI if term.tested else None,
            term.f if term.tested else None,
            _known(term.p),
            _known(term.p_holm),
            ("yes" if term.found else "no") if term.tested else f"cannot be distinguished from: {term.alike}",
        )
        for fit in plane
        for term in fit.terms
    )
    found = len(plane.found)
    tested = sum(term.tested for fit in plane for term in fit.terms)
    table = Table(
        "other-shaft",
        "What the other shaft does",
        f"Each term alone beside the curve of the shaft's own speed, as drag; {found} of {tested} are there at 1 % "
        "after Holm's correction over both shafts. The size is the drag where the term is largest on this grid; a term "
        "found alone may stand for another one that resembles it.",
        (
            Column("shaft", "Shaft"),
            Column("term", "Drag follows"),
            Column("size", "Size", "mN m", uncertain=True),
            Column("share", "RMS beyond the curve", "mN m", digits=2),
            Column("f", "F", "", digits=1),
            Column("p", "p", format=".2g"),
            Column("p_holm", "p, corrected", format=".2g"),
            Column("found", "Found"),
        ),
        rows,
    )
    lines = [
        f"The {fit.shaft}'s scatter is {fit.rmse_line * PER_MILLI:.2f} mN m about the curve of its own speed and "
        f"{fit.rmse_plane * PER_MILLI:.2f} mN m about the fit in both speeds ({fit.added} terms more, F = {fit.f:.1f}, "
        f"{fit.dof} degrees of freedom, p {nominal_p_text(fit.p)})."
        for fit in plane
        if fit.added and math.isfinite(fit.f)
    ]
    return table, Text(" ".join(lines) or "These speeds carry no test of a fit in both speeds.", kind="note")


def _drift(drift: Drift) -> tuple[Table | Text, ...]:
    if drift.reason:
        return (Text(f"Repeats and order. {drift.reason}"),)
    rows: list[tuple[str, str, str, Measured | None, float | None, Measured | None, float | None]] = []
    for order in drift.orders:
        when = "after" if order.hours >= 0.0 else "before"
        slope = Measured(order.slope * PER_MILLI, order.slope_u * PER_MILLI) if math.isfinite(order.slope) else None
        rows.append(
            (
                order.shaft,
                "falling minus rising speed",
                f"{len(order.difference)} points, falling {abs(order.hours):.1f} h {when} rising",
                Measured(order.mean * PER_MILLI, order.mean_u * PER_MILLI),
                _known(order.mean_p),
                slope,
                _known(order.slope_p),
            )
        )
    for repeat in drift.repeats:
        per_hour = HOUR * PER_MILLI
        rows.append(
            (
                repeat.shaft,
                "repeats against time",
                f"{repeat.dof + 1} differences of repeats over {repeat.hours:.1f} h",
                Measured(repeat.slope * per_hour, repeat.slope_u * per_hour),
                _known(repeat.p),
                None,
                None,
            )
        )
    table = Table(
        "repeats-and-order",
        "Repeats and order",
        "Neutral drag at the same points in different runs: mean difference in mN m and its trend with speed, and "
        "drift of repeats in mN m an hour. Rising and falling runs differ by temperature, order and drift together.",
        (
            Column("shaft", "Shaft"),
            Column("compared", "Compared"),
            Column("basis", "On the basis of"),
            Column("change", "Difference, or drift an hour", "mN m", uncertain=True),
            Column("p", "p", format=".2g"),
            Column("trend", "Trend with speed", "mN m s/rad", uncertain=True),
            Column("trend_p", "p of the trend", format=".2g"),
        ),
        tuple(rows),
    )
    return (table,)
