"""Losses under several correction factors, and the damping fit at each, over speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.levels import by_load
from pmg.pipeline.report.document import Chart, Figure, Series
from pmg.sim import signals
from pmg.sim.signals import SPEED_SUN

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.fit.damping import DampingFit
    from pmg.pipeline.fit.losses import PowerBalance
    from pmg.sim.signals import Array


def correction_figures(fits: tuple[DampingFit, ...], balance: PowerBalance) -> tuple[Figure, ...]:
    """Bearing and magnetic loss under each K_corr, and the damping fits with their points; none without fits."""
    if not fits:
        return ()
    shown = tuple(sorted(fits, key=lambda fit: -fit.correction))
    published = balance.grid.origin == "published"
    losses = (_losses(shown, balance, published),) if balance.correction > 0.0 else ()
    return *losses, _fits(shown, published)


def _losses(fits: tuple[DampingFit, ...], balance: PowerBalance, published: bool) -> Figure:
    at = balance.grid.points
    total, lines = list[Series](), list[Series]()
    of = signals.LOSS_TOTAL
    for name, rows in by_load(at):
        x, order = _rising(np.abs(at.speed_sun[rows]))
        y, u = balance.values[of.name][rows][order], balance.u(of.name)[rows][order]
        total.append(Series(name, x, y, u, "markers", len(total), "total loss"))
    neutral = balance.values[signals.LOSS_BEARINGS.name] / balance.correction
    for i, k in enumerate((1.0, *(fit.correction for fit in fits))):
        x, first = np.unique(np.round(SPEED_SUN.display(np.abs(at.speed_sun))), return_index=True)
        lines.append(Series(f"K_corr {k:.3g}", x, k * neutral[first], None, "line", i, "neutral loss × K_corr"))
    magnetic = tuple(
        Series(f"K_corr {fit.correction:.3g}", SPEED_SUN.display(fit.speed), fit.measured, None, "both", i + 1)
        for i, fit in enumerate(fits)
    )
    printed = " Figures 4.15 to 4.18 of the source." if published else ""
    return Figure(
        "losses-by-correction",
        "Losses under several K_corr",
        f"{_plausible(fits)} Left: total loss with U = 2u against the neutral loss times K_corr; right: what is left "
        f"for the magnetic gear, mean over the loads.{printed}",
        (
            Chart(SPEED_SUN.label, "power [W]", (*total, *lines), title="Total and bearing loss"),
            Chart(SPEED_SUN.label, "power [W]", magnetic, (("", 0.0),), title="Magnetic loss"),
        ),
        columns=2,
    )


def _plausible(fits: tuple[DampingFit, ...]) -> str:
    """Up to which of these factors no point has a negative magnetic loss."""
    kept = [fit.correction for fit in fits if not fit.negative]
    if not kept:
        return "At every K_corr shown some points have a negative magnetic loss."
    beyond = [f"{fit.correction:.3g} ({fit.negative})" for fit in fits if fit.negative]
    more = f"; points below zero at {', '.join(beyond)}" if beyond else ""
    return f"No magnetic loss is negative up to K_corr = {max(kept):.3g}{more}."


def _fits(fits: tuple[DampingFit, ...], published: bool) -> Figure:
    printed = " Figures 6.2 to 6.5 of the source." if published else ""
    robust = any((fit.weights < 1.0).any() for fit in fits)
    outliers = " Half weight or less: points that the fit holds for outliers." if robust else ""
    misses = ", ".join(f"{fit.correction:.3g}: {fit.rmse:.3g} W" for fit in fits)
    return Figure(
        "damping-fits",
        "Damping fits over speed",
        f"Root mean square error by K_corr: {misses}. Each K_corr has points of its own, so that R² ranks none of "
        f"them. Points: magnetic loss, mean over the loads; line: the fit, with U = 2u by the scatter about it."
        f"{outliers}{printed}",
        tuple(_fit(fit) for fit in fits),
        columns=2,
    )


def _fit(fit: DampingFit) -> Chart:
    x, order = _rising(fit.speed)
    kept = (fit.weights > 0.5)[order]
    series = [Series("fit", x, fit.fitted[order], fit.u_fitted[order], "line", 1)]
    for name, rows, colour in (("measured", kept, 0), ("measured, half weight or less", ~kept, 3)):
        if rows.any():
            series.append(Series(name, x[rows], fit.measured[order][rows], None, "markers", colour))
    title = f"K_corr {fit.correction:.3g}, R² {fit.r_squared:.4f}"
    return Chart(SPEED_SUN.label, "magnetic loss [W]", tuple(series), (("", 0.0),), title=title)


def _rising(speed: Array) -> tuple[Array, npt.NDArray[np.int64]]:
    """Sun speeds [rpm] in rising order, and that order."""
    order = np.argsort(speed, kind="stable")
    return SPEED_SUN.display(speed)[order], order
