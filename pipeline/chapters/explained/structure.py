"""Chapter on what the residuals of fits follow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.residuals.covariates import BY_ID
from pmg.pipeline.diagnosis.residuals.fitted import FITS
from pmg.pipeline.report.document import Chart, Column, Figure, Measured, Section, Series, Table, Text
from pmg.pipeline.wording.probability import search_p_text
from pmg.sim import sources
from pmg.sim.signals import RESIDUAL

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.residuals.search import Followed, ResidualStudy, ShaftResidual
    from pmg.pipeline.report.table import Cell

DRAWN = 4
"""Covariates of one fit and shaft that are drawn at most, clearest first."""


def structure_section(study: ResidualStudy) -> Section:
    """Lack of fit, covariates, figures of those that stand out, outlying points, and what could not be tested."""
    figures = [_figure(part) for part in study.parts if any(one.rank is not None for one in part.followed)]
    return Section(
        "residuals",
        "What the residuals follow",
        (
            Text(
                "Each fit is taken as a linear model of its readings. A covariate stands for a few smooth columns; "
                "what the fit leaves of them is held against the residual. What follows no covariate is the noise. "
                "The nominal p-value, p, is that of one covariate alone. The search's, with look-elsewhere, is the "
                f"probability that any of the {study.tested} tests, on any shaft in any of these fits, is as clear in "
                f"a grid made of noise and rounding alone, from {study.draws} such grids. The clearest covariate then "
                "joins the fit and the rest is looked at again, which gives p of the rest; the place counts over both "
                "shafts. Sizes are after what the fit absorbs; noise alone gives a size too, which is shown with it."
            ),
            Text(_manner(study)),
            _lack(study),
            _covariates(study),
            *figures,
            _points(study),
            _untested(study),
        ),
        (sources.WESTFALL_YOUNG,),
    )


def _manner(study: ResidualStudy) -> str:
    """The fits by name, and the noise that each was judged against."""
    named = dict.fromkeys(f"{part.fit.name}: {FITS[part.fit.name]}" for part in study.parts)
    ways = dict.fromkeys(f"{part.fit.name}, {part.shaft}, {part.lack.description}" for part in study.parts)
    if len({part.lack.description for part in study.parts}) == 1:
        ways = {f"all {study.parts[0].lack.description}": None}
    return f"The fits are {'; '.join(named)}.\n\nLack of fit is judged: {'; '.join(ways)}."


def _lack(study: ResidualStudy) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for part in study.parts:
        lack = part.lack
        rows.append(
            (
                part.fit.name,
                part.shaft,
                lack.chi_square,
                lack.dof,
                lack.chi_square / lack.dof,
                lack.p_value,
                float(RESIDUAL.display(lack.scatter)),
                float(RESIDUAL.display(lack.noise)),
                lack.source,
            )
        )
    short = sum(part.lack.p_value <= 0.05 for part in study.parts)
    return Table(
        "residuals-lack",
        "Lack of fit",
        f"{short} of {len(study.parts)} fits scatter more than the known noise at 5 %.",
        (
            Column("fit", "Fit"),
            Column("shaft", "Shaft"),
            Column("chi_square", "χ²", digits=1),
            Column("dof", "dof", digits=1),
            Column("ratio", "χ²/dof", digits=2),
            Column("p_value", "p", format=".2g"),
            Column("scatter", "scatter", "mN m", digits=2),
            Column("noise", "noise", "mN m", digits=2),
            Column("source", "Noise from"),
        ),
        tuple(rows),
    )


def _covariates(study: ResidualStudy) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for part in study.parts:
        for one in part.followed:
            size, u = float(RESIDUAL.display(one.size)), float(RESIDUAL.display(one.size_u))
            rows.append(
                (
                    f"{part.fit.name}, {part.shaft}",
                    one.rank,
                    f"{one.words}\n{one.look.family.configuration}",
                    Measured(size, u),
                    float(RESIDUAL.display(one.noise_size)),
                    _shape(one),
                    one.p_value,
                    search_p_text(one.p_search, study.draws).removeprefix("= "),
                    search_p_text(one.p_beyond, study.draws).removeprefix("= "),
                )
            )
    clear = sum(one.rank is not None for part in study.parts for one in part.followed)
    return Table(
        "residuals-covariates",
        "Covariates",
        f"{clear} of {study.tested} tests are significant, one after the other. Those that carry more than nine tenths "
        "of the same trace are named together: these points cannot tell them apart.",
        (
            Column("fit", "Fit, shaft"),
            Column("place", "Place"),
            Column("covariate", "Covariate"),
            Column("size", "Size (rms)", "mN m", uncertain=True),
            Column("noise_size", "noise alone", "mN m", digits=2),
            Column("shape", "Drag, where", "mN m"),
            Column("p_value", "p", format=".2g"),
            Column("p_look_elsewhere", "p, search"),
            Column("p_beside", "p, rest"),
        ),
        tuple(rows),
    )


def _shape(one: Followed) -> str:
    """Drag at low, middle and high values, or at each sign, one a line."""
    return "\n".join(f"{float(RESIDUAL.display(drag)):+.2f} at {where}" for where, drag in one.shape)


def _figure(part: ShaftResidual) -> Figure:
    clear = [one for one in part.followed if one.rank is not None][:DRAWN]
    return Figure(
        f"residual-{part.fit.name}-{part.shaft}",
        f"{FITS[part.fit.name]}, {part.shaft}",
        "Measured minus fitted drag against the significant covariates: "
        + "; ".join(f"{one.words}, {float(RESIDUAL.display(one.size)):.2f} mN m rms" for one in clear)
        + ". The part that follows the covariate is drawn over the residual; it depends on the whole set-point, as the "
        "fit has taken its share.",
        tuple(_chart(part, one) for one in clear),
        columns=2,
    )


def _chart(part: ShaftResidual, one: Followed) -> Chart:
    readings, covariate = part.fit.readings, one.look.covariate
    rows = np.flatnonzero(one.look.rows & np.isfinite(one.look.value))
    rows = rows[np.argsort(one.look.value[rows], kind="stable")]
    x = one.look.value[rows]
    residual = RESIDUAL.display(part.fit.residual * readings.direction)[rows]
    label = f"{covariate.words} [{covariate.unit}]" if covariate.unit else _sign_label(covariate.signs, covariate.words)
    return Chart(
        label,
        "residual, as drag [mN m]",
        (
            Series("measured minus fitted, U = 2u", x, residual, RESIDUAL.display(readings.u[rows]), "markers", 0),
            Series("part that follows it", x, RESIDUAL.display(one.drag[rows]), None, "markers", 1),
        ),
        references=(("", 0.0),),
        title=f"{covariate.words} ({one.look.family.configuration})",
    )


def _sign_label(signs: tuple[str, ...], words: str) -> str:
    named = [f"{value:+d} {name}" for value, name in zip((-1, 0, 1), signs, strict=True) if name]
    return f"{words}: {', '.join(named)}"


def _points(study: ResidualStudy) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for part in study.parts:
        readings = part.fit.readings
        for outlier, still in part.outliers:
            rows.append(
                (
                    part.fit.name,
                    part.shaft,
                    str(readings.grid.points.name[readings.row[outlier.row]]),
                    float(readings.torque[outlier.row]),
                    float(part.fit.torque[outlier.row]),
                    outlier.surprise,
                    outlier.p_value,
                    outlier.looked_at,
                    still,
                )
            )
    return Table(
        "residuals-points",
        "Outliers",
        f"{len(rows)} residuals beyond the scatter of the other points of the fit at 5 %, each "
        "corrected for the number of points. The surprise is the externally studentised residual.",
        (
            Column("fit", "Fit"),
            Column("shaft", "Shaft"),
            Column("point", "Point"),
            Column("observed", "Observed", "N m", digits=4),
            Column("fitted", "Fitted", "N m", digits=4),
            Column("surprise", "Surprise", "s.d.", digits=2),
            Column("p_value", "p", format=".2g"),
            Column("looked_at", "Points looked at"),
            Column("beside_covariates", "Outlier with the covariates fitted"),
        ),
        tuple(rows),
    )


def _untested(study: ResidualStudy) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (part.fit.name, part.shaft, BY_ID[name].words, reason)
        for part in study.parts
        for name, reason in part.untested.items()
    ]
    return Table(
        "residuals-untested",
        "Covariates that could not be tested",
        f"{len(rows)} times a covariate does not vary, is not recorded, or is the fit's own.",
        (Column("fit", "Fit"), Column("shaft", "Shaft"), Column("covariate", "Covariate"), Column("reason", "Reason")),
        tuple(rows),
    )
