"""The page that sets two campaigns side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from pmg.pipeline.campaign_comparison.document import kinds_compared, mean_document
from pmg.pipeline.campaign_comparison.statement import alike, statement
from pmg.pipeline.chapters.campaigns.figures import curve_figure, follow_figure, load_figure, map_figures
from pmg.pipeline.chapters.campaigns.tables import conditions_table, constants_table, point_table, unmatched_table
from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.report.document import (
    Caution,
    Column,
    Facts,
    Figure,
    Headline,
    Measured,
    Report,
    Section,
    Table,
    Text,
)
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.probability import nominal_p_text, search_p_text
from pmg.sim import signals
from pmg.sim.signals import RESIDUAL, RPM, Signal

if TYPE_CHECKING:
    from pmg.pipeline.campaign_comparison.constants import ConstantDifference, CurveDifference
    from pmg.pipeline.campaign_comparison.difference import Versus
    from pmg.pipeline.campaign_comparison.verdict import ComparisonVerdict, GroupResult
    from pmg.pipeline.report.document import Cell

SHOWN: dict[str, Signal] = {
    signal.name: signal
    for signal in (
        signals.LOSS_TOTAL,
        signals.LOSS_BEARINGS,
        signals.LOSS_MAGNETIC,
        signals.EFFICIENCY_TOTAL,
        signals.EFFICIENCY_MAGNETIC,
    )
}
"""Derived quantities, in their units of display; differences of torques are in those of a residual."""

RULE = (
    "Independent parts of both add in quadrature. A transducer's sensitivity and non-linearity are one error where "
    "both campaigns used the same transducer (serial number, nominal torque and span), and then only what it does to B "
    "minus what it does to A is left; otherwise they are two errors. The tare counts as another one in each campaign, "
    "and so does what the scatter of the readings does to curves, K_corr and damping constants."
)


def versus_report(
    versus: Versus,
    judged: ComparisonVerdict | None,
    constants: tuple[ConstantDifference, ...],
    curves: tuple[CurveDifference, ...],
    *,
    note: str,
    provenance: tuple[tuple[str, str], ...],
) -> Report:
    """The report of two campaigns: outcome, conditions, differences, what they follow, points, unmatched.

    Parameters
    ----------
    versus : Versus
        The campaigns, matched and subtracted.
    judged : Judged or None
        The tests; None where nothing matched.
    constants : tuple of ConstantDifference
        What was fitted to each.
    curves : tuple of CurveDifference
        Loss curves.
    note : str
        What the reader must know about the data; may be empty.
    provenance : tuple of (label, value)
        Inputs and hashes of both.
    """
    sections = [Section("conditions", "Conditions of both", (conditions_table(versus),))]
    if judged is not None:
        sections.append(_differences(versus, judged))
        sections.append(_followed(versus, judged))
    if constants:
        figures = () if not curves else (curve_figure(curves),)
        text = "Coefficients of one curve err together: read the curves, not single coefficients."
        items = (constants_table(constants), Text(text, kind="note"), *figures)
        sections.append(Section("fitted", "Fitted constants and curves", items))
    sections.append(_matching(versus))
    return Report(
        title=f"{versus.b.name} against {versus.a.name}",
        subtitle=note or "Comparison of two campaigns: B minus A, point by point",
        verdict=_verdict(versus, judged),
        sections=tuple(sections),
        provenance=Facts((*provenance, ("Versions", versions(PACKAGES)))),
    )


def _verdict(versus: Versus, judged: ComparisonVerdict | None) -> Headline:
    matching = versus.matching
    figures = [("Points matched", str(len(matching)))]
    figures += [
        (f"Only in {side.label}", str(len(left)))
        for side, left in ((versus.a, matching.only_a), (versus.b, matching.only_b))
    ]
    warnings = []
    if versus.in_both:
        warnings.append(f"{versus.in_both[:1].upper()}{versus.in_both[1:]}.")
    warnings += [
        f"{side.label} is a published grid: rounded torques, no time, no transducers known."
        for side in (versus.a, versus.b)
        if side.grid.origin == "published"
    ]
    state: Literal["good", "attention"] = "attention"
    if judged is not None:
        beyond = sum(group.beyond for group in judged.groups)
        figures.append(("Torques beyond U", f"{beyond} of {sum(group.points for group in judged.groups)}"))
        state = "attention" if judged.readings_differ or warnings else "good"
    return Headline(statement(versus, judged), state, tuple(figures), tuple(map(Caution, warnings)))


def _differences(versus: Versus, judged: ComparisonVerdict) -> Section:
    tests = Facts(
        (
            (
                "A difference as clear as the clearest here, where there is none",
                f"p {search_p_text(judged.p_value, judged.draws)}, noise and what the transducers leave allowed for",
            ),
            ("The same for the readings alone", f"p {search_p_text(judged.p_readings, judged.draws)}, noise only"),
            ("Transducers", versus.shared.description),
            ("Set-points that differ within tolerance", _corrected(versus)),
        )
    )
    figures = [*map_figures(versus), *(() if (figure := load_figure(versus)) is None else (figure,))]
    items: tuple[Text | Facts | Table | Figure, ...] = (
        tests,
        _means(versus),
        Text(RULE, kind="note"),
        *figures,
        point_table(versus, SHOWN),
    )
    return Section("differences", "Differences, B − A", items)


def _corrected(versus: Versus) -> str:
    if not versus.corrected:
        return "not corrected: no campaign has loss curves"
    largest = max(
        float(np.max(np.abs(versus.quantities[s].correction), initial=0.0)) for s in ("torque_sun", "torque_ring")
    )
    return (
        f"corrected by the calibrated models of both, torques by {RESIDUAL.display(largest):.3g} mN m at most; how far "
        "the models disagree is in the uncertainty"
    )


def _means(versus: Versus) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for name, kind in kinds_compared(versus):
        mean = mean_document(versus, name, kind)
        signal = SHOWN.get(name, RESIDUAL)
        of = signals.TORQUE_SUN if name == "torque_sun" else signals.TORQUE_RING if name == "torque_ring" else signal
        words = "load applied (an input)" if name == "torque_ring" and kind == "engaged" else of.meaning
        u = float(np.hypot(mean["u_independent"], mean["u_common"]))
        share = f"{mean['beyond_U']} of {mean['points']}"
        rows.append(
            (
                words,
                "zero checks" if kind == "zero" else kind,
                mean["points"],
                signal.display_unit,
                Measured(float(signal.display(mean["mean"])), u / signal.scale),
                mean["u_independent"] / signal.scale,
                mean["u_common"] / signal.scale,
                share,
                mean["beyond_U_independent"],
            )
        )
    return Table(
        "mean-differences",
        "Mean differences by configuration",
        "B minus A, mean over matched points. Own: what is independent from point to point, of both; common: what the "
        "errors that points share leave in the mean. Noise alone puts 5 % of points beyond U = 2u.",
        (
            Column("quantity", "Quantity"),
            Column("configuration", "Configuration"),
            Column("points", "Points"),
            Column("unit", "Unit"),
            Column("mean", "Mean B − A", uncertain=True),
            Column("u_independent", "u own", format=".2g"),
            Column("u_common", "u common", format=".2g"),
            Column("beyond", "Beyond U"),
            Column("beyond_independent", "Beyond 2 u own"),
        ),
        tuple(rows),
    )


def _followed(versus: Versus, judged: ComparisonVerdict) -> Section:
    rows: list[tuple[Cell, ...]] = []
    for group in judged.groups:
        best = alike(group)
        rows += [
            (
                group.words,
                one.covariate.words,
                Measured(float(RESIDUAL.display(one.slope.value)), one.slope.u / RESIDUAL.scale),
                f"mN m per {one.covariate.unit}",
                100.0 * one.share,
                f"p {nominal_p_text(one.slope.p_value)}",
                "best" if one in best else "",
            )
            for one in group.followed
        ]
    table = Table(
        "followed",
        "What the differences follow",
        "Straight lines, one covariate at a time, on torques in the direction of rotation. Covariates that explain "
        "nearly the same share cannot be separated: the order of a test may be the order of its speeds.",
        (
            Column("group", "Torque"),
            Column("covariate", "Against"),
            Column("slope", "Slope of B − A", uncertain=True),
            Column("unit", "Unit"),
            Column("share", "Share of variance", "%", digits=0),
            Column("p", "Nominal p"),
            Column("best", "Best"),
        ),
        tuple(rows),
    )
    tests = Table(
        "groups",
        "Tests by configuration and shaft",
        "Chi-square of all differences of a group, with their covariance. One search over all tests gives the p-value "
        "of the page.",
        (
            Column("group", "Torque"),
            Column("points", "Points"),
            Column("mean", "Mean B − A", "mN m", uncertain=True),
            Column("chi_square", "Chi-square", digits=1),
            Column("p", "Nominal p"),
            Column("beyond", "Beyond U"),
        ),
        tuple(_tested(group) for group in judged.groups),
    )
    return Section("followed-by", "What the difference follows", (follow_figure(versus), table, tests))


def _tested(group: GroupResult) -> tuple[Cell, ...]:
    mean = Measured(float(RESIDUAL.display(group.mean.value)), group.mean.u / RESIDUAL.scale)
    p = f"p {nominal_p_text(group.p_value)}"
    return group.words, group.points, mean, group.chi_square, p, f"{group.beyond} of {group.points}"


def _matching(versus: Versus) -> Section:
    matching = versus.matching
    rule = (
        f"Points match when configuration, gear, driving side and resting shafts agree, both speeds within "
        f"{matching.reach.speed / RPM:g} rpm and the load asked for within {matching.reach.load:g} N m; one to one, as "
        "many as possible, then the least sum of squared distances. Repeats are paired in the order of time. Rejected "
        "points do not take part."
    )
    items: list[Text | Table] = [Text(rule)]
    sides = ((versus.a, versus.b, matching.only_a), (versus.b, versus.a, matching.only_b))
    items += [unmatched_table(side, other, left) for side, other, left in sides if left]
    if not (matching.only_a or matching.only_b):
        items.append(Text(f"Every point has a partner: {counted(len(matching), 'pair')}.", kind="finding"))
    return Section("matching", "Matching and points without a partner", tuple(items))
