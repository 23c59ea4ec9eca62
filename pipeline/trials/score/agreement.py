"""Do both ways from a concealed campaign, by grid and by recordings, end in the same diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE
from pmg.pipeline.trials.score.figures import ABOUT_ONE, Figured, middle, share
from pmg.pipeline.trials.score.score import judge

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.trials.score.case_list import AnyLot
    from pmg.pipeline.trials.score.score import Score

CLEAN_PART = 3
"""For so many concealed campaigns that go both ways, one clean one does."""


def both_ways(lots: tuple[AnyLot[Any], ...], concealed: int) -> tuple[AnyLot[Any], ...]:
    """The first campaigns that are not clean, so many of them, and a third as many clean ones, in their order."""
    left = {True: concealed // CLEAN_PART, False: concealed}
    chosen = []
    for lot in lots:
        clean = lot.stratum.kind == "clean"
        if left[clean] > 0:
            left[clean] -= 1
            chosen.append(lot)
    return tuple(chosen)


@dataclass(frozen=True)
class Pair:
    """One campaign that went both ways.

    Parameters
    ----------
    number : int
        Its place in the trial.
    grid, recordings : Score
        What each way was worth.
    leading : (tuple of str, tuple of str)
        Ids of the mechanisms that each way puts first, sorted; empty where it names none.
    """

    number: int
    grid: Score
    recordings: Score
    leading: tuple[tuple[str, ...], tuple[str, ...]]

    @property
    def same_verdict(self) -> bool:
        """Whether both say the same; two campaigns that could not be diagnosed do."""
        return self.grid.verdict == self.recordings.verdict

    @property
    def same_leading(self) -> bool | None:
        """Whether both put the same mechanisms first; None where neither names any."""
        return self.leading[0] == self.leading[1] if any(self.leading) else None

    @property
    def same_side(self) -> bool | None:
        """Whether both p-values lie on the same side of the level of the test; None where one is missing."""
        if self.grid.p_value is None or self.recordings.p_value is None:
            return None
        return (self.grid.p_value <= FALSE_ALARM_RATE) == (self.recordings.p_value <= FALSE_ALARM_RATE)

    @property
    def held_out(self) -> float | None:
        """Error on withheld readings over the noise, by recordings less by grid; None where one has none."""
        if self.grid.held_out is None or self.recordings.held_out is None:
            return None
        return self.recordings.held_out - self.grid.held_out

    @property
    def document(self) -> dict[str, Any]:
        """As JSON."""
        ways = {"grid": (self.grid, self.leading[0]), "recordings": (self.recordings, self.leading[1])}
        return {
            "case": self.number,
            "stratum": self.grid.stratum,
            "reached_sigma": self.grid.reached,
            **{
                way: {
                    "verdict": score.verdict,
                    "leading": list(leading),
                    "p_value": score.p_value,
                    "held_out_ratio": score.held_out,
                    "outcome": str(score.outcome),
                }
                for way, (score, leading) in ways.items()
            },
            "same_verdict": self.same_verdict,
            "same_leading": self.same_leading,
            "same_side": self.same_side,
            "held_out_difference": self.held_out,
        }


@dataclass(frozen=True)
class TrialAgreement:
    """All campaigns that went both ways."""

    pairs: tuple[Pair, ...]

    @property
    def figures(self) -> tuple[Figured, ...]:
        """Rate of agreement of both ways, with Clopper and Pearson's intervals, and the difference of withheld errors.

        Both ways share the campaign and its wander from point to point; the noise within the windows is drawn anew.
        """
        leading = [pair.same_leading for pair in self.pairs if pair.same_leading is not None]
        side = [pair.same_side for pair in self.pairs if pair.same_side is not None]
        differs = [pair.held_out for pair in self.pairs if pair.held_out is not None]
        clear = [p.same_verdict for p in self.pairs if not p.grid.ids or p.grid.reached >= ABOUT_ONE[0]]
        where = f"same verdict both ways, clean or {ABOUT_ONE[0]:g} sigma and more"
        return (
            share("same_verdict", "same verdict both ways", [pair.same_verdict for pair in self.pairs]),
            share("same_verdict_clear", where, clear),
            share("same_leading", "same leading mechanisms, where either way names some", leading),
            share("same_side", f"p-values on the same side of {FALSE_ALARM_RATE:.0%}", side),
            middle("held_out_difference", "withheld error over the noise, by recordings less by grid, median", differs),
        )

    @property
    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "campaigns": len(self.pairs),
            "figures": [figure.document for figure in self.figures],
            "cases": [pair.document for pair in self.pairs],
        }


def agree(
    truths: Mapping[int, Mapping[str, Any]],
    results: Mapping[int, Mapping[str, Any]],
    second: Mapping[int, Mapping[str, Any]],
) -> TrialAgreement | None:
    """Both results of each campaign side by side, by its number; None where none went both ways.

    Parameters
    ----------
    truths, results : mappings
        Opened truths, and results by grid, of all campaigns.
    second : mapping
        Results by recordings, of those that went that way too.
    """
    pairs = []
    for number in sorted(second):
        truth = truths[number]
        ways = [results[number]["diagnosis"], second[number]["diagnosis"]]
        grid, recordings = (judge(truth, document) for document in ways)
        pairs.append(Pair(number, grid, recordings, (_leading(ways[0]), _leading(ways[1]))))
    return TrialAgreement(tuple(pairs)) if pairs else None


def _leading(document: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Ids that a verdict puts first, without those of rivals."""
    if document is None or document["verdict"] not in ("named", "ambiguous"):
        return ()
    return tuple(sorted(mechanism["id"] for mechanism in document["mechanisms"]))
