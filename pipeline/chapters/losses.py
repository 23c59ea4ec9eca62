"""Chapters on the neutral losses and on the powers and efficiencies of the engaged gear."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import by_load, by_speed, forward_neutral, lay_out, measured, speed_levels
from pmg.pipeline.losses import QUANTITIES
from pmg.pipeline.report.document import (
    Chart,
    Column,
    Facts,
    Figure,
    Measured,
    Section,
    Series,
    SpeedMap,
    Table,
    Text,
)
from pmg.sim import signals, sources
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.analyse import Analysis
    from pmg.pipeline.calibrate import Calibration
    from pmg.pipeline.damping import DampingFit
    from pmg.pipeline.fit import LossFit, LossFits
    from pmg.pipeline.losses import PowerBalance
    from pmg.sim.grid import Grid


def neutral_section(grid: Grid, fits: LossFits) -> Section:
    """Neutral losses: maps over the speed grid, fitted curves, coefficients."""
    rows = forward_neutral(grid)
    if not rows.any():
        rows = np.asarray(grid.points.neutral & grid.accepted)
    sun, ring = speed_levels(grid.points[rows])
    maps = []
    for signal, torque in ((signals.TORQUE_SUN, grid.torque_sun), (signals.TORQUE_RING, grid.torque_ring)):
        x, y, z = lay_out(ring, sun, torque[rows])
        maps.append(SpeedMap(x, y, z, SPEED_RING.label, SPEED_SUN.label, signal.label, title=signal.meaning))
    charts = tuple(_curve_chart(grid, fit) for fit in (fits.sun, fits.ring))
    return Section(
        "neutral",
        "Neutral losses",
        (
            Figure(
                "neutral-maps",
                "Torque over the neutral grid",
                f"Loss torque of the sun {_range(grid.torque_sun[rows])} N m and of the ring "
                f"{_range(grid.torque_ring[rows])} N m over {len(np.unique(sun))} x {len(np.unique(ring))} speeds. "
                "A shaft at 0 rpm is held by its motor: its reading is a static reaction.",
                tuple(maps),
                columns=2,
            ),
            Figure(
                "loss-curves",
                "Loss curves",
                f"Fitted loss torque against the shaft's own speed: scatter about the curve {fits.sun.rmse * 1e3:.2f} "
                f"mN m (sun) and {fits.ring.rmse * 1e3:.2f} mN m (ring).",
                charts,
                columns=2,
            ),
            _coefficients(fits),
        ),
        (sources.THESIS.at("section 4.2.3"), sources.BURNHAM_ANDERSON),
    )


def _range(values: signals.Array) -> str:
    return f"{values.min():.3f} to {values.max():.3f}"


def _curve_chart(grid: Grid, fit: LossFit) -> Chart:
    is_sun = fit.shaft == "sun"
    own = SPEED_SUN if is_sun else SPEED_RING
    speed = grid.points.speed_sun if is_sun else grid.points.speed_ring
    drag = fit.residuals + fit.curve.torque(speed[fit.rows])
    u = (grid.u_sun if is_sun else grid.u_ring)[fit.rows]
    fine = np.linspace(0.0, fit.curve.speed_limit, 200)
    label = signals.LOSS_TORQUE_SUN.label if is_sun else signals.LOSS_TORQUE_RING.label
    return Chart(
        own.label,
        label,
        (
            Series("measured, U = 2u", own.display(np.abs(speed[fit.rows])), drag, u, "markers", 0),
            Series("fit", own.display(fine), fit.curve.torque(fine), None, "line", 1),
        ),
        title=f"{fit.shaft} shaft",
    )


def _coefficients(fits: LossFits) -> Table:
    rows = []
    for fit in (fits.sun, fits.ring):
        for power, value, error in zip(fit.curve.powers, fit.curve.coefficients, fit.standard_errors, strict=True):
            unit = float(
                (signals.SPEED_SUN if fit.shaft == "sun" else signals.SPEED_RING).display(fit.curve.speed_reference)
            )
            rows.append(
                (
                    fit.shaft,
                    f"(n / {unit:.0f} rpm)^{power:g}" if power else "constant",
                    Measured(float(value), float(error)),
                    fit.r_squared,
                    fit.rmse * 1e3,
                    fit.error_thesis * 1e3,
                    fit.aicc,
                )
            )
    return Table(
        "loss-fit",
        "Coefficients of the loss curves",
        "Least squares of the neutral torques. The thesis's own error measure divides the root of the sum of squares "
        "by n, so it shrinks with the number of points; the scatter (RMSE) does not.",
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


def losses_section(analysis: Analysis, balance: PowerBalance, calibration: Calibration) -> Section:
    """Losses in watts before efficiencies, the correction factor, the damping constants, the table by point."""
    at = balance.grid.points
    speed = SPEED_SUN.display(np.abs(at.speed_sun))
    order = np.argsort(speed, kind="stable")
    loss_chart = Chart(
        SPEED_SUN.label,
        "power [W]",
        tuple(
            Series(
                signal.meaning,
                speed[order],
                balance.values[signal.name][order],
                balance.u(signal.name)[order],
                "markers",
                i,
            )
            for i, signal in enumerate((signals.LOSS_TOTAL, signals.LOSS_BEARINGS, signals.LOSS_MAGNETIC))
        ),
        references=(("", 0.0),),
    )
    above = int(balance.above_one().sum())
    implausible = int(balance.implausible().sum())
    warning = (
        (
            Text(
                f"The magnetic efficiency is above 1 at {above} points, at {implausible} of them by more than U: "
                "neutral "
                "losses, scaled by K_corr, exceed what the engaged gear loses there. Shown as it is.",
                kind="warning",
            ),
        )
        if above
        else ()
    )
    return Section(
        "losses",
        "Power losses and efficiency by load",
        (
            Facts(_constants(analysis, calibration)),
            *warning,
            Figure(
                "power-losses",
                "Power losses",
                f"Total loss up to {balance.values[signals.LOSS_TOTAL.name].max():.1f} W, of which bearings "
                f"{balance.values[signals.LOSS_BEARINGS.name].max():.1f} W and the magnetic gear "
                f"{balance.values[signals.LOSS_MAGNETIC.name].max():.1f} W (K_corr = {balance.correction:.3f}).",
                (loss_chart,),
            ),
            _efficiency_figure(balance),
            _damping_table(analysis.damping),
            _balance_table(balance),
        ),
        (sources.THESIS.at("equations 4.2 to 4.7 and 6.1"), sources.BERTOTTI),
    )


def _constants(analysis: Analysis, calibration: Calibration) -> tuple[tuple[str, str | Measured], ...]:
    def shown(name: str, factor: float = 1.0) -> str | Measured:
        error = calibration.standard_error(name)
        value = calibration.value(name) * factor
        if error is not None:
            return Measured(value, error * factor)
        return f"{value:.4g} ({'on its bound' if name in calibration.on_bound else 'held'})"

    rule = analysis.rule_correction
    return (
        ("K_corr in use", shown("K_corr")),
        ("K_corr by the thesis's rule (no negative magnetic loss)", "-" if rule is None else f"{rule:.3f}"),
        ("Hysteresis b [mN m]", shown("b", 1e3)),
        ("Eddy c [1e-4 N m s/rad]", shown("c", 1e4)),
        ("Excess d", shown("d")),
        ("Chi-square of the calibration", f"{calibration.chi_square:.0f} for {calibration.dof} degrees of freedom"),
    )


def _efficiency_figure(balance: PowerBalance) -> Figure:
    at = balance.grid.points
    panels = []
    for signal in (signals.EFFICIENCY_TOTAL, signals.EFFICIENCY_MAGNETIC):
        series = []
        for i, (name, rows) in enumerate(by_load(at)):
            x = SPEED_SUN.display(np.abs(at.speed_sun[rows]))
            order = np.argsort(x, kind="stable")
            y, u = signal.display(balance.values[signal.name][rows]), balance.u(signal.name)[rows] / signal.scale
            series.append(Series(name, x[order], y[order], u[order], "both", i))
        panels.append(Chart(SPEED_SUN.label, signal.label, tuple(series), (("", 100.0),), "Load", signal.meaning))
    total = balance.values[signals.EFFICIENCY_TOTAL.name]
    return Figure(
        "efficiency",
        "Efficiency by load",
        f"Total efficiency between {total.min() * 100:.1f} and {total.max() * 100:.1f} % over all points. Near zero "
        "load its uncertainty grows without bound: read the losses in watts first.",
        tuple(panels),
        columns=2,
    )


def _damping_table(fits: tuple[DampingFit, ...]) -> Table:
    def cell(value: float, error: float | None, factor: float) -> Measured | str:
        return "0 (on its bound)" if error is None else Measured(value * factor, error * factor)

    return Table(
        "damping",
        "Damping constants against the correction factor",
        "Least squares of the magnetic loss power at a given K_corr, constants not below zero (thesis, equation 6.1).",
        (
            Column("k_corr", "K_corr", "", digits=3),
            Column("b", "b", "mN m"),
            Column("c", "c", "1e-4 N m s/rad"),
            Column("d", "d", "1e-3 N m (s/rad)^1/2"),
            Column("r_squared", "R²", "", digits=4),
            Column("rmse", "RMSE", "W", digits=4),
        ),
        tuple(
            (
                fit.correction,
                cell(fit.b, fit.standard_errors[0], 1e3),
                cell(fit.c, fit.standard_errors[1], 1e4),
                cell(fit.d, fit.standard_errors[2], 1e3),
                fit.r_squared,
                fit.rmse,
            )
            for fit in fits
        ),
    )


def _balance_table(balance: PowerBalance) -> Table:
    at = balance.grid.points
    return Table(
        "power-balance",
        "Losses and efficiencies by point",
        f"{len(at)} engaged points; uncertainty with the common part (transducer tolerance, curves) included.",
        (
            Column("point", "Point"),
            Column("speed_sun", SPEED_SUN.meaning, SPEED_SUN.display_unit, digits=1),
            Column("load", "load asked for", "N m", digits=2),
            *(Column(s.name, s.meaning, s.display_unit, uncertain=True) for s in QUANTITIES),
        ),
        tuple(
            (
                str(at.name[i]),
                float(SPEED_SUN.display(at.speed_sun[i])),
                float(at.load_set[i]),
                *(measured(s, balance.values[s.name][i], balance.u(s.name)[i]) for s in QUANTITIES),
            )
            for i in by_speed(at)
        ),
    )
