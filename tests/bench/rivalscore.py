"""Answers of contestants scored by the rules of `pmg prove`, and thresholds calibrated on clean campaigns."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.trials.score.figures import ABOUT_ONE, Figured, detection, figures
from pmg.pipeline.trials.score.rates import count
from pmg.pipeline.trials.score.score import DiagnosisScore, Score, judge
from tests.bench.bout import Answer, Reply

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

FALSE_ALARM_RATE = 0.05
"""Of a calibrated setting."""
CALIBRATED = "calibrated to 5 %"
SHOWN = (
    "false_alarm",
    "size_50",
    "size_95",
    "named_right_above",
    "confident_library",
    "confident_outside",
    "held_out",
)
"""Figures of `pmg prove` that a contestant without rivals and tests can be asked for."""
NAMING = ("named_right_above", "right_id", "confident_library", "confident_outside")
"""Figures that mean nothing for one that alarms and never names."""


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Parameters
    ----------
    name, setting : str
        Who, and by which rule.
    figures : tuple of Figured
        Those of `SHOWN`, and the id named right whatever the shaft.
    bins : tuple
        Detection against size, as in `pmg.pipeline.trials.score.figures.detection`.
    seconds : float
        Median time of a campaign [s]; NaN where it is not known.
    scores : tuple of Score
        One a campaign.
    """

    name: str
    setting: str
    figures: tuple[Figured, ...]
    bins: tuple[Any, ...]
    seconds: float
    scores: tuple[Score, ...]

    @property
    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "name": self.name,
            "setting": self.setting,
            "figures": [figure.document for figure in self.figures],
            "detection": [
                {"mean_sigma": mean, "hits": rate.hits, "of": rate.of, "interval": list(rate.interval or ())}
                for _, _, mean, rate in self.bins
            ],
            "outcomes": [str(score.outcome) for score in self.scores],
            "said": [list(score.named) for score in self.scores],
            "median_seconds": self.seconds if math.isfinite(self.seconds) else None,
        }


def document_of(reply: Reply) -> dict[str, Any]:
    """A reply in the words of a diagnosis; an alarm that names nothing is one that is not in the library."""
    verdict = "consistent" if not reply.alarm else "not_in_library" if reply.said is None else "named"
    named = [] if reply.said is None else [{"id": reply.said[0], "shaft": reply.said[1], "parameters": []}]
    return {"verdict": verdict, "mechanisms": named, "rivals": [], "held_out": None, "p_value": math.nan}


def score(truth: Mapping[str, Any], reply: Reply | None) -> Score:
    """A reply beside the truth; None where no baseline could be fitted."""
    if reply is None:
        return judge(truth, None)
    found = judge(truth, document_of(reply))
    return replace(found, held_out=reply.held_out if found.detected and truth["effects"] else None)


def calibrated_threshold(levels: Sequence[float], rate: float = FALSE_ALARM_RATE) -> float:
    """The level that a further clean campaign passes with at most that probability, whatever the levels' law.

    The k-th highest of n, k the whole part of `rate` times n + 1; infinite where n is too small for it.
    """
    k = math.floor(rate * (len(levels) + 1) + 1e-9)
    return float(np.sort(np.asarray(levels, dtype=np.float64))[-k]) if k else math.inf


def row_of(name: str, setting: str, scores: Sequence[Score], seconds: Sequence[float]) -> Row:
    """The figures of one contestant by one setting."""
    every = {figure.id: figure for figure in figures(scores, (), ())}
    chosen = [every[name] for name in SHOWN]
    large = [
        s for s in scores if s.kind == "one" and s.reached >= ABOUT_ONE[0] and s.outcome is not DiagnosisScore.NOT_MADE
    ]
    named = (DiagnosisScore.RIGHT, DiagnosisScore.WRONG_SHAFT)
    right = count([s.outcome in named for s in large])
    what = "the same, whatever the shaft"
    chosen.insert(4, Figured("right_id", what, "", right.value, right.interval, right.of, right.hits))
    middle = float(np.median(seconds)) if len(seconds) else math.nan
    return Row(name, setting, tuple(chosen), detection(scores)[0], middle, tuple(scores))


def rows_of(
    name: str,
    truths: Sequence[Mapping[str, Any]],
    answers: Sequence[Answer | None],
    clean: Sequence[Answer | None],
) -> tuple[Row, ...]:
    """One line for each rule of a contestant, and one for the threshold that `clean` campaigns calibrate.

    Parameters
    ----------
    name : str
        Of the contestant.
    truths, answers : sequences
        Of the campaigns that are judged; None where no baseline could be fitted.
    clean : sequence
        Answers to other campaigns, without any effect, which calibrate and are not judged.
    """
    made = [answer for answer in answers if answer is not None]
    seconds = [answer.seconds for answer in made]
    rows = [
        row_of(name, rule, _scores(truths, [None if a is None else a.settings[rule] for a in answers]), seconds)
        for rule in (made[0].settings if made else ())
    ]
    threshold = calibrated_threshold([answer.level for answer in clean if answer is not None])
    if math.isfinite(threshold):
        replies = [None if a is None else a.above(threshold) for a in answers]
        rows.append(row_of(name, CALIBRATED, _scores(truths, replies), seconds))
    return tuple(rows)


def _scores(truths: Sequence[Mapping[str, Any]], replies: Sequence[Reply | None]) -> tuple[Score, ...]:
    return tuple(score(truth, reply) for truth, reply in zip(truths, replies, strict=True))


def proof_row(document: Mapping[str, Any], cases: Sequence[int]) -> Row:
    """pmg's own line, from the `scores.json` of `pmg prove` and the same campaigns."""
    by_number = {int(case["case"]): case for case in document["cases"]}
    scores = [
        Score(
            kind=case["kind"],
            stratum=case["stratum"],
            ids=tuple(case["concealed"]),
            reached=float(case["reached_sigma"]),
            verdict=case["verdict"],
            named=tuple(case["said"]),
            outcome=DiagnosisScore(case["outcome"]),
            p_value=case["p_value"],
            parameter=None,
            held_out=case["held_out_ratio"] if case["concealed"] else None,
            recognised=case["recognised"],
            laws=case["laws"],
        )
        for case in (by_number[number] for number in cases)
    ]
    return row_of("pmg", "as it is", scores, [float(document["time_s"]["median"])])


def cell(figure: Figured) -> str:
    """Value and interval, short; a size without an interval lies beyond what the campaigns determine."""
    if figure.value is None:
        return "none told"
    if figure.unit == "sigma" and figure.interval is None:
        return "not determined"
    scale, digits = (100.0, ".0f") if figure.hits is not None else (1.0, ".2f")
    ends = figure.interval
    rest = "" if ends is None else f" ({ends[0] * scale:{digits}} to {ends[1] * scale:{digits}})"
    told = f"{figure.value * scale:{digits}}" + (" %" if figure.hits is not None else "")
    return f"{told}{rest}"


def table(rows: Sequence[Row]) -> str:
    """The rows as Markdown; a column of `SHOWN` that none fills stays."""
    titles = (
        "false alarms, clean",
        "50 % seen [sigma]",
        "95 % seen [sigma]",
        "named right, one effect from 0.75 sigma",
        "id right, shaft aside",
        "wrong and confident, in library",
        "outside it",
        "withheld error / noise",
    )
    lines = ["| who | setting | " + " | ".join(titles) + " | time [s] |", "|---" * (len(titles) + 3) + "|"]
    for row in rows:
        mute = any(s.detected for s in row.scores) and not any(s.named for s in row.scores)
        cells = [row.name, row.setting, *("–" if mute and f.id in NAMING else cell(f) for f in row.figures)]
        cells.append(f"{row.seconds:.1f}" if math.isfinite(row.seconds) else "")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
