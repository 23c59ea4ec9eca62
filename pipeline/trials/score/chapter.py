"""Chapter on the trial of the diagnosis: rates with their aims, detection, confusion, every campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.report.document import (
    Chart,
    Column,
    Facts,
    Figure,
    Headline,
    Report,
    Section,
    Series,
    Table,
    Text,
)
from pmg.pipeline.trials.score.figures import ABOUT_ONE
from pmg.pipeline.trials.score.summary import time_document
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.probability import COVERAGE_FACTOR

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.report.table import Cell
    from pmg.pipeline.trials.score.agreement import TrialAgreement
    from pmg.pipeline.trials.score.summary import Trial

SIZES_DRAWN = (0.02, 20.0)
"""Sizes between which the curve is drawn [sigma]."""


WHICH = {"steady": "", "motion": " of runs in motion"}
"""What the campaigns of each track hold, in words."""


def proof_page(trial: Trial, facts: Mapping[str, Any]) -> Report:
    """The page of a trial; `facts` holds seed, strata, laws, route and the digest of the program."""
    aimed = [figure for figure in trial.figures if figure.aim is not None]
    met, open_ = (sum(figure.met is state for figure in aimed) for state in (True, None))
    untold = f"; {open_} cannot be told from so few" if open_ else ""
    return Report(
        title="Proof of the diagnosis",
        subtitle=f"{len(trial.scores)} synthetic campaigns{WHICH[facts['track']]} with sealed truths, "
        "from a bench that shares no formula with the models",
        verdict=Headline(
            f"{met} of {counted(len(aimed), 'aim')} met at 95 % over {counted(len(trial.scores), 'campaign')}{untold}.",
            "good" if met == len(aimed) else "attention",
        ),
        sections=(_proof_section(trial), _cases_section(trial)),
        provenance=Facts(
            (
                ("Master seed", str(facts["seed"])),
                ("Kinds of campaign", ", ".join(facts["strata"])),
                ("Families of laws", str(facts["laws"])),
                ("Route", str(facts["route"])),
                ("SHA-256 of the program's sources", str(facts["code"])),
                ("Versions", versions(PACKAGES)),
            )
        ),
    )


def _proof_section(trial: Trial) -> Section:
    """Figures, detection and confusion."""
    time = time_document(trial)
    items: list[Text | Facts | Table | Figure] = [
        Text(
            "Each campaign was drawn with an effect concealed in it, or none, by a bench of its own whose laws are "
            "not those of the library. The SHA-256 of every truth was written down before the first diagnosis, and "
            "checked when the truths were opened. Sizes are counted after absorption: the root mean square over all "
            "readings of what a free baseline cannot take up, in standard uncertainties of one point's mean. "
            "Intervals are Clopper and Pearson's at 95 %, for sizes from the profile of the likelihood, for medians "
            "from order statistics."
        ),
        _figures(trial),
        Facts(
            (
                ("Time of a diagnosis, median", f"{time['median']:.1f} s"),
                ("longest", f"{time['most']:.1f} s, aim {time['aim']} s: {'met' if time['met'] else 'not met'}"),
            )
        ),
    ]
    if trial.bins:
        items.append(_detection(trial))
    if trial.agreement is not None:
        items.append(_agreement(trial.agreement))
    items += [_outcomes(trial), _places(trial), _confusion(trial)]
    return Section("proof", "What the diagnosis is worth", tuple(items))


def _figures(trial: Trial) -> Table:
    aimed = [figure for figure in trial.figures if figure.aim is not None]
    missed, open_ = ([figure.what for figure in aimed if figure.met is state] for state in (False, None))
    told = [f"Not met: {'; '.join(missed)}."] if missed else []
    told += [f"Cannot tell, as the interval allows either: {'; '.join(open_)}."] if open_ else []
    rule = "An aim is met where the whole interval lies in it."
    return Table(
        "proof-figures",
        "Figures and aims",
        " ".join([rule, *(told or ["Every aim is met."])]),
        (
            Column("figure", "Figure"),
            Column("value", "Value, interval"),
            Column("aim", "Aim"),
            Column("state", "State"),
        ),
        tuple((figure.what, figure.shown, figure.aim_shown, figure.state) for figure in trial.figures),
    )


def _detection(trial: Trial) -> Figure:
    sizes = np.array([mean for _, _, mean, _ in trial.bins])
    rates = np.array([rate.value for *_, rate in trial.bins], dtype=np.float64)
    ends = np.array([rate.interval for *_, rate in trial.bins])  # a bin is never empty
    half = 0.5 * (ends[:, 1] - ends[:, 0])
    series = [
        Series("its interval at 95 %", sizes, ends.mean(axis=1), half / COVERAGE_FACTOR, "band", 0),
        Series("part detected, by size", sizes, rates, None, "markers", 0),
    ]
    caption = "Part of the campaigns with one effect in which a mismatch was claimed, against its size. "
    if trial.curve is None:
        caption += "A curve cannot be fitted: all, or none, were detected, or detection does not grow with size."
    else:
        x = np.geomspace(*SIZES_DRAWN, 200)
        series.append(Series("logistic curve above chance alarms", x, trial.curve.probability(x), None, "line", 1))
        caption += f"Half are detected at {trial.curve.size(0.5):.2f} sigma, 95 % at {trial.curve.size(0.95):.2f}. "
        caption += f"Where nothing can be seen, {trial.curve.seen.guess:.0%} alarm by chance: the curve begins there."
    chart = Chart(
        "size after absorption [sigma]",
        "part detected",
        tuple(series),
        references=(("50 %", 0.5), ("95 %", 0.95)),
        x_limits=SIZES_DRAWN,
        y_limits=(-0.05, 1.05),
        x_log=True,
    )
    return Figure("detection", "Detection against size", caption, (chart,))


def _agreement(agreement: TrialAgreement) -> Table:
    apart = [str(pair.number) for pair in agreement.pairs if not pair.same_verdict]
    caption = (
        f"Campaigns that went by recordings, through files and every stage, as well: {len(agreement.pairs)}. Both "
        "ways share the campaign and its wander from point to point; the noise within the windows is drawn anew. "
    )
    caption += f"The verdicts differ in: {', '.join(apart)}." if apart else "No verdict differs."
    return Table(
        "agreement",
        "By grid and by recordings",
        caption,
        (Column("figure", "Figure"), Column("value", "Value, interval")),
        tuple((figure.what, figure.shown) for figure in agreement.figures),
    )


def _outcomes(trial: Trial) -> Table:
    columns = list(dict.fromkeys(name for counted in trial.outcomes.values() for name in counted))
    rows: list[tuple[Cell, ...]] = [
        (kind, "", sum(counted.values()), *(counted.get(name, 0) for name in columns))
        for kind, counted in trial.outcomes.items()
    ]
    rows += [
        ("clean", design, sum(counted.values()), *(counted.get(name, 0) for name in columns))
        for design, counted in trial.by_design.items()
    ]
    rows += [
        (
            kind,
            f"from {low:g}" if high == np.inf else f"{low:g} to {high:g}",
            sum(counted.values()),
            *(counted.get(name, 0) for name in columns),
        )
        for kind, low, high, counted in trial.by_size
    ]
    return Table(
        "outcomes",
        "How it came out, by kind and size",
        "Campaigns by kind; below, clean ones by design, and those with one effect by size after absorption [sigma].",
        (
            Column("kind", "Kind"),
            Column("part", "Design, size"),
            Column("campaigns", "Campaigns"),
            *map(Column, columns),
        ),
        tuple(rows),
    )


def _places(trial: Trial) -> Table:
    low, high = ABOUT_ONE
    return Table(
        "places",
        "Where it was located, by true place",
        f"Single effects of the library of {low:g} to {high:g} sigma, and larger ones. Right is the place of the cause "
        "that is named or leads a set, or of the clearest difference, on the right shaft where one is told.",
        (
            Column("place", "Place"),
            Column("about_one", "Located right, about 1 sigma"),
            Column("larger", "Located right, larger"),
        ),
        tuple(
            (place, *(f"{rate.hits} of {rate.of}" for rate in (at_one, larger)))
            for place, at_one, larger in trial.by_place
        ),
    )


def _confusion(trial: Trial) -> Table:
    columns, counted = trial.confusion
    return Table(
        "confusion",
        "What was concealed and what was said",
        "Rows: the effect concealed, single ones only, of any size. Columns: what was named (of several, the leading "
        "one), or what was said instead.",
        (Column("concealed", "Concealed"), *(Column(name, name.replace("_", " ")) for name in columns)),
        tuple((name.replace("_", " "), *(row.get(said) for said in columns)) for name, row in counted.items()),
    )


def _cases_section(trial: Trial) -> Section:
    """Every campaign."""
    table = Table(
        "cases",
        "Every campaign",
        "In the order drawn; pmg prove --case runs any of them alone.",
        (
            Column("case", "No."),
            Column("stratum", "Concealed, shaft, size asked for"),
            Column("reached", "Size", "sigma", digits=2),
            Column("verdict", "Verdict"),
            Column("said", "Said"),
            Column("outcome", "Outcome"),
            Column("p_value", "p-value", format=".2g"),
            Column("held_out", "Withheld error", digits=2),
            Column("parameter", "Parameter error", format=".1%"),
            Column("test", "Separating test"),
        ),
        tuple(
            (
                row["case"],
                row["stratum"].replace("_", " "),
                row["reached_sigma"],
                row["verdict"].replace("_", " ") or "none",
                ", ".join(row["said"]).replace("_", " "),
                row["outcome"],
                row["p_value"],
                row["held_out_ratio"],
                None if row["parameter"] is None else row["parameter"]["relative_error"],
                row["separating_test"] or "",
            )
            for row in trial.rows
        ),
    )
    return Section("campaigns", "Campaigns", (table,))
