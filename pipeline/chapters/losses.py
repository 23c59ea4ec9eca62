"""The chapter on powers, losses and efficiencies of the engaged gear."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import by_load, by_speed, measured
from pmg.pipeline.chapters.correction import correction_items
from pmg.pipeline.losses import QUANTITIES
from pmg.pipeline.report.document import (
    Chart,
    Column,
    Facts,
    Figure,
    Measured,
    Section,
    Series,
    Table,
    Text,
)
from pmg.sim import signals, sources
from pmg.sim.signals import SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.analyse import Analysis
    from pmg.pipeline.calibrate import Calibration
    from pmg.pipeline.losses import PowerBalance


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
            *correction_items(analysis),
            _balance_table(balance),
        ),
        (sources.THESIS.at("equations 4.2 to 4.7 and 6.1"), sources.BERTOTTI, sources.BIRGE),
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
