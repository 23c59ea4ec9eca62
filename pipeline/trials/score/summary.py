"""A trial summed up: scores, tables, the document ``pmg.proof/1``, and lines for people."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.trials.score.agreement import agree
from pmg.pipeline.trials.score.case_list import SHARES
from pmg.pipeline.trials.score.figures import ABOUT_ONE, detection, figures
from pmg.pipeline.trials.score.rates import EDGES, count
from pmg.pipeline.trials.score.score import DiagnosisScore, Score, judge, resolution
from pmg.pipeline.trials.score.sets import figures_by_laws, set_figures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.trials.score.agreement import TrialAgreement
    from pmg.pipeline.trials.score.figures import Aim, Figured
    from pmg.pipeline.trials.score.rates import DetectionCurve, Rate

SCHEMA = "pmg.proof/1"
TIME_AIM = 60.0
"""Longest that a campaign should take [s]."""
NOTHING, A_SET, OTHER_SET, NOT_IN = "nothing", "a set with it", "a set without it", "not in library"
"""Columns of the confusion table in addition to the ids."""


@dataclass(frozen=True)
class Trial:
    """All scores of a trial.

    Parameters
    ----------
    scores : tuple of Score
        One a campaign.
    rows : tuple of dict
        The same as JSON.
    figures : tuple of Figured
        Rates and sizes with their aims.
    bins, curve
        Detection against size.
    seconds : tuple of float
        Time of each diagnosis [s].
    agreement : TrialAgreement or None
        Of both ways, grid and recordings; None where no campaign went both.
    """

    scores: tuple[Score, ...]
    rows: tuple[dict[str, Any], ...]
    figures: tuple[Figured, ...]
    bins: tuple[tuple[float, float, float, Rate], ...]
    curve: DetectionCurve | None
    seconds: tuple[float, ...]
    agreement: TrialAgreement | None = None

    @property
    def outcomes(self) -> dict[str, dict[str, int]]:
        """Counts of outcomes by kind of campaign."""
        found: dict[str, dict[str, int]] = {}
        for kind in SHARES:
            counted = Counter(score.outcome for score in self.scores if score.kind == kind)
            if counted:
                found[kind] = {str(outcome): counted[outcome] for outcome in DiagnosisScore if counted[outcome]}
        return found

    @property
    def by_design(self) -> dict[str, dict[str, int]]:
        """Counts of outcomes of clean campaigns by design."""
        names = dict.fromkeys(score.stratum for score in self.scores if score.kind == "clean")
        found = {name: Counter(str(s.outcome) for s in self.scores if s.stratum == name) for name in sorted(names)}
        return {name: dict(counted) for name, counted in found.items()}

    @property
    def by_size(self) -> tuple[tuple[str, float, float, dict[str, int]], ...]:
        """Kind, size from and to, and how many came out how; single effects."""
        found = []
        for kind in ("one", "outside"):
            for low, high in pairwise(EDGES):
                mine = [s.outcome for s in self.scores if s.kind == kind and low <= s.reached < high]
                if mine:
                    counted = Counter(mine)
                    found.append((kind, low, high, {str(o): counted[o] for o in DiagnosisScore if counted[o]}))
        return tuple(found)

    @property
    def by_place(self) -> tuple[tuple[str, Rate, Rate], ...]:
        """Where single effects of the library sit, and how many are located right: about 1 sigma, and larger ones."""
        low, high = ABOUT_ONE
        single = [score for score in self.scores if score.kind == "one" and score.located is not None]

        def rate(place: str, least: float, most: float) -> Rate:
            return count([bool(s.located) for s in single if s.place == place and least <= s.reached < most])

        places = sorted({score.place for score in single if score.reached >= low})
        return tuple((place, rate(place, low, high), rate(place, high, math.inf)) for place in places)

    @property
    def confusion(self) -> tuple[tuple[str, ...], dict[str, dict[str, int]]]:
        """Columns, and for each concealed single effect how often each was said (the leading id, of several)."""
        found: dict[str, Counter[str]] = {}
        for score in self.scores:
            if score.kind in ("clean", "one", "outside"):
                true = score.ids[0] if score.ids else NOTHING
                found.setdefault(true, Counter())[_said(score)] += 1
        ids = sorted({name for counted in found.values() for name in counted} - {NOTHING, A_SET, OTHER_SET, NOT_IN})
        columns = (*ids, A_SET, OTHER_SET, NOT_IN, NOTHING)
        order = sorted(found, key=lambda name: (name == NOTHING, name.startswith("outside_"), name))
        return columns, {name: dict(found[name]) for name in order}


def _said(score: Score) -> str:
    """Column of the confusion table for the diagnosis of a campaign."""
    if score.verdict == "named":
        return score.named[0]
    if score.verdict == "ambiguous":
        return A_SET if score.outcome is DiagnosisScore.RIGHT_SET else OTHER_SET
    return NOT_IN if score.verdict == "not_in_library" else NOTHING


def summarise(
    truths: Mapping[int, Mapping[str, Any]],
    results: Mapping[int, Mapping[str, Any]],
    second: Mapping[int, Mapping[str, Any]] | None = None,
    aims: Mapping[str, Aim | None] = MappingProxyType({}),
) -> Trial:
    """Scores of all campaigns, by their numbers.

    Results of those that went by recordings too are in `second`; `aims` stand in place of the usual ones, by figure.
    """
    scores = tuple(judge(truths[number], results[number]["diagnosis"]) for number in sorted(truths))
    rows = tuple(
        case_row(number, score, truths[number], results[number])
        for number, score in zip(sorted(truths), scores, strict=True)
    )
    bins, curve = detection(scores)
    times = tuple(float(results[number]["seconds"]) for number in sorted(truths))
    tests = {
        verdict: [row["separating_test"] for row in rows if row["separating_test"] and row["verdict"] == verdict]
        for verdict in ("ambiguous", "confounded")
    }
    shown = (*figures(scores, tests["ambiguous"], tests["confounded"]), *set_figures(scores), *figures_by_laws(scores))
    shown = tuple(replace(figure, aim=aims.get(figure.id, figure.aim)) for figure in shown)
    return Trial(scores, rows, shown, bins, curve, times, agree(truths, results, second or {}))


def _unclear(score: Score) -> bool:
    """Whether a further test was asked for, and there is something for it to show."""
    return score.verdict == "ambiguous" or (score.verdict == "confounded" and bool(score.ids))


def case_row(number: int, score: Score, truth: Mapping[str, Any], result: Mapping[str, Any]) -> dict[str, Any]:
    """One campaign as JSON."""
    parameter = score.parameter
    return {
        "case": number,
        "campaign": truth["campaign"],
        "kind": score.kind,
        "stratum": score.stratum,
        "concealed": list(score.ids),
        "reached_sigma": score.reached,
        "verdict": score.verdict,
        "said": list(score.named),
        "set_holds_truth": score.holds,
        "laws": score.laws,
        "outcome": str(score.outcome),
        "expected": score.verdict in truth["expected"],
        "p_value": score.p_value,
        "place": score.place,
        "located": score.located,
        "held_out_ratio": score.held_out,
        "recognised": score.recognised,
        "parameter": None
        if parameter is None
        else {
            "true": parameter.true,
            "value": parameter.value,
            "standard_error": parameter.error,
            "relative_error": parameter.relative,
            "covers": parameter.covers,
        },
        "separating_test": resolution(truth, result["extended"]) if _unclear(score) else None,
    }


def scores_document(trial: Trial, facts: Mapping[str, Any]) -> dict[str, Any]:
    """The document; all but ``time_s`` is the same for the same seed and program."""
    columns, confusion = trial.confusion
    curve = trial.curve
    return {
        "schema": SCHEMA,
        **facts,
        "campaigns": len(trial.scores),
        "figures": [figure.document for figure in trial.figures],
        "detection": {
            "bins": [
                {
                    "from_sigma": low,
                    "to_sigma": high if math.isfinite(high) else None,
                    "mean_sigma": mean,
                    "hits": rate.hits,
                    "of": rate.of,
                    "interval": list(rate.interval or ()),
                }
                for low, high, mean, rate in trial.bins
            ],
            "curve": None if curve is None else {"start": curve.start, "slope": curve.slope, "guess": curve.seen.guess},
        },
        "outcomes": trial.outcomes,
        "clean_by_design": trial.by_design,
        "by_size": [
            {"kind": kind, "from_sigma": low, "to_sigma": high if math.isfinite(high) else None, "outcomes": counted}
            for kind, low, high, counted in trial.by_size
        ],
        "by_place": [
            {"place": place, "about_1": [at_one.hits, at_one.of], "larger": [larger.hits, larger.of]}
            for place, at_one, larger in trial.by_place
        ],
        "confusion": {"said": list(columns), "concealed": confusion},
        "agreement": None if trial.agreement is None else trial.agreement.document,
        "cases": list(trial.rows),
        "time_s": time_document(trial),
    }


def time_document(trial: Trial) -> dict[str, Any]:
    """Time of one diagnosis [s]."""
    seconds = np.array(trial.seconds)
    return {
        "median": float(np.median(seconds)),
        "most": float(seconds.max()),
        "all": float(seconds.sum()),
        "aim": f"at most {TIME_AIM:g}",
        "met": bool(seconds.max() <= TIME_AIM),
    }


def score_lines(trial: Trial) -> tuple[str, ...]:
    """The figures for people."""
    lines = []
    for figure in trial.figures:
        aim = f"; aim {figure.aim_shown}: {figure.state}" if figure.aim else ""
        lines.append(f"{figure.what}: {figure.shown}{aim}")
    if trial.agreement is not None:
        lines.append(f"campaigns that went both ways, by grid and by recordings: {len(trial.agreement.pairs)}")
        lines += [f"{figure.what}: {figure.shown}" for figure in trial.agreement.figures]
    time = time_document(trial)
    lines.append(f"time of a diagnosis: median {time['median']:.1f} s, most {time['most']:.1f} s; aim {time['aim']} s")
    return tuple(lines)
