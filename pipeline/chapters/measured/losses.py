"""The chapter on the power losses of the engaged gear, in watts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import in_relief, iso_levels, lay_out, names_in_cells, names_of
from pmg.pipeline.chapters.measured.correction import correction_items
from pmg.pipeline.chapters.measured.damping_curves import correction_figures
from pmg.pipeline.fit.losses import AVERAGED, QUANTITIES
from pmg.pipeline.grid.levels import by_load, by_speed, speed_levels
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
    measured,
)
from pmg.pipeline.wording import numerals
from pmg.pipeline.wording.option_words import DampingMethod
from pmg.sim import signals, sources
from pmg.sim.signals import SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.pipeline.fit.losses import PowerBalance


ALWAYS_BEHIND = (sources.THESIS.at("equations 4.2 to 4.7 and 6.1"), sources.BERTOTTI, sources.BIRGE)
"""Sources of the chapter."""

CHI_SQUARE = {
    DampingMethod.LEAST_SQUARES: "Chi-square of the calibration",
    DampingMethod.BISQUARE: "Chi-square of the calibration, by the robust scale of its bisquare fit",
}
"""What the calibration's chi-square is called."""

BEHIND: dict[DampingMethod, tuple[sources.Source, ...]] = {
    DampingMethod.LEAST_SQUARES: (),
    DampingMethod.BISQUARE: (sources.HOLLAND_WELSCH, sources.DUMOUCHEL),
}
"""Sources of the weights of a damping fit."""


def losses_section(analysis: Analysis, balance: PowerBalance, calibration: FittedBaseline) -> Section:
    """Losses by element, over speed and load, the correction factor, the damping constants, the table by point."""
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
                points=names_of(at.name[order]),
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
        "Power losses",
        (
            Facts(_constants(analysis, calibration)),
            Text(_uncertainty_note(balance, calibration), kind="note"),
            *warning,
            Figure(
                "power-losses",
                "Power losses",
                f"Total loss up to {_highest(balance, signals.LOSS_TOTAL)} W; bearings up to "
                f"{_highest(balance, signals.LOSS_BEARINGS)} W and the magnetic gear up to "
                f"{_highest(balance, signals.LOSS_MAGNETIC)} W, with U = 2u (K_corr = {balance.correction:.3f}).",
                (loss_chart,),
            ),
            *_loss_maps(balance),
            _means_table(balance),
            *correction_figures(analysis.damping, balance),
            *correction_items(analysis),
            _balance_table(balance),
        ),
        (*ALWAYS_BEHIND, *BEHIND[calibration.method]),
    )


def _constants(analysis: Analysis, calibration: FittedBaseline) -> tuple[tuple[str, str | Measured], ...]:
    def shown(name: str, factor: float = 1.0) -> str | Measured:
        error = calibration.standard_error(name)
        value = calibration.value(name) * factor
        if error is not None:
            of = analysis.causes.standard_errors()[name] if analysis.causes is not None else (error, 0.0)
            return Measured(value, float(np.hypot(*of)) * factor)
        return f"{value:.4g} ({'on its bound' if name in calibration.on_bound else 'held'})"

    rule = analysis.rule_correction
    return (
        ("K_corr in use", shown("K_corr")),
        (
            "K_corr by the thesis's rule (no negative magnetic loss)",
            numerals.MISSING if rule is None else f"{rule:.3f}",
        ),
        ("Hysteresis b [mN m]", shown("b", 1e3)),
        ("Eddy c [1e-4 N m s/rad]", shown("c", 1e4)),
        ("Excess d", shown("d")),
        (CHI_SQUARE[calibration.method], f"{calibration.chi_square:.0f} for {calibration.dof} degrees of freedom"),
    )


def _uncertainty_note(balance: PowerBalance, calibration: FittedBaseline) -> str:
    if not balance.correction_fitted:
        factor = "K_corr is held: what it may be off by is in no figure here."
    elif "K_corr" in calibration.on_bound:
        factor = "K_corr sits on its bound; what it may still be is in the figures."
    else:
        factor = "K_corr errs together with the curves, so bearing and magnetic loss err in opposite directions."
    return (
        "Uncertainties have a part that differs from point to point and one that all points share: the transducers' "
        f"tolerances, the curves and K_corr. {factor} The constants' hold the scatter of the readings and the "
        "transducers' tolerances."
    )


def _highest(balance: PowerBalance, signal: signals.Signal) -> str:
    """The largest value and its U, in the unit of display."""
    values = balance.values[signal.name]
    i = int(np.argmax(np.where(np.isnan(values), -np.inf, values)))
    return numerals.measured(float(signal.display(values[i])), 2.0 * float(balance.u(signal.name)[i]) / signal.scale)


def _means_table(balance: PowerBalance) -> Table:
    rows = []
    for load, chosen in by_load(balance.grid.points):
        for signal in AVERAGED:
            mean = balance.mean(signal.name, chosen)
            value = Measured(float(signal.display(mean.value)), mean.u / signal.scale)
            parts = mean.independent / signal.scale, mean.common / signal.scale
            rows.append((load, mean.points, signal.meaning, signal.display_unit, value, *parts))
    return Table(
        "means-by-load",
        "Means by load",
        "Means over the points of each load. What differs from point to point falls with the root of their number; "
        "what they share does not.",
        (
            Column("load", "Load"),
            Column("points", "Points"),
            Column("quantity", "Quantity"),
            Column("unit", "Unit"),
            Column("mean", "Mean ± u", "", uncertain=True),
            Column("u_independent", "u, by point", "", digits=4),
            Column("u_common", "u, common", "", digits=4),
        ),
        tuple(rows),
    )


def _loss_maps(balance: PowerBalance) -> tuple[Figure, ...]:
    """Total and magnetic loss over speed and load, forward flow, as maps and as surfaces."""
    at = balance.grid.points
    rows = np.asarray(at.drive == "sun")
    if not rows.any():
        return ()
    load, speed = np.abs(np.round(at.load_set, 3))[rows], speed_levels(at)[0][rows]
    panels = []
    for signal in (signals.LOSS_TOTAL, signals.LOSS_MAGNETIC):
        x, y, z = lay_out(load, speed, signal.display(balance.values[signal.name][rows]))
        points = names_in_cells(load, speed, at.name[rows])
        panels.append(
            SpeedMap(
                x,
                y,
                z,
                "load asked for [N m]",
                SPEED_SUN.label,
                f"{signal.meaning} [W]",
                annotate=True,
                contours=iso_levels(z),
                title=signal.meaning,
                points=points,
            )
        )
    caption = "Losses over speed and load with lines of equal loss, forward flow. Grey: not measured."
    maps = Figure("loss-map", "Losses over speed and load", caption, tuple(panels), columns=2)
    return maps, *in_relief(maps, "The same losses as height: a point at each engaged point, forward flow.")


def _balance_table(balance: PowerBalance) -> Table:
    at = balance.grid.points
    return Table(
        "power-balance",
        "Losses and efficiencies by point",
        f"{len(at)} engaged points; uncertainty with the common part (transducers, curves, K_corr) included.",
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
