"""The track record of each kind of answer: how often it held the truth where the truth was concealed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.wording.probability import exact_interval

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.diagnosis.engine.conclusion import Conclusion


@dataclass(frozen=True)
class TrackRecord:
    """Answers of one kind in the trial, and how many of them held the truth: every cause, or that it is none known.

    Parameters
    ----------
    answer : str
        The kind, in words.
    claim : str
        What holds the truth, as the beginning of a sentence.
    held, of : int
        Counts.
    """

    answer: str
    claim: str
    held: int
    of: int

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the rate (Clopper and Pearson)."""
        return exact_interval(self.held, self.of)

    @property
    def sentence(self) -> str:
        """Counts in a sentence."""
        return f"{self.claim} in {self.held} of {self.of} simulated cases."

    @property
    def words(self) -> str:
        """Rate with its interval, in words."""
        low, high = self.interval
        return (
            f"{self.answer}: held the truth in {self.held / self.of:.0%} of {self.of} concealed synthetic campaigns "
            f"(95 % interval {low:.0%} to {high:.0%})"
        )


NONE_HELD = "The cause was one of the closest, or none of the catalogue,"
"""What holds the truth where no known cause is given."""

RECORD = {
    "named": TrackRecord("a cause named", "The cause named was right", 148, 154),
    "ambiguous": TrackRecord("several causes given", "The true cause was among those given", 30, 30),
    "weak": TrackRecord(
        "a difference too weak to name its cause, or none proved", "The truth was among those given", 68, 70
    ),
    "not_in_library": TrackRecord("no known cause given, with those that come near", NONE_HELD, 109, 114),
}
"""From the trial of 600 campaigns in ``pipeline/trials/README.md``; sizes, causes and designs as drawn there."""


IN_MOTION = {
    "named": TrackRecord("a cause named", "The cause named was right", 139, 147),
    "ambiguous": TrackRecord("several causes given", "The true cause was among those given", 17, 23),
    "weak": TrackRecord(
        "a difference too weak to name its cause, or none proved", "The truth was among those given", 31, 36
    ),
    "not_in_library": TrackRecord("no known cause given, with those that come near", NONE_HELD, 47, 54),
}
"""The same of runs in motion, from the last two draws of 240 campaigns, in ``pipeline/trials/motion/README.md``."""


OF_MACHINES = {
    "named": TrackRecord("a cause named", "The cause named was right", 56, 58),
    "ambiguous": TrackRecord("several causes given", "The true cause was among those given", 25, 25),
    "not_in_library": TrackRecord("no known cause given, with those that come near", NONE_HELD, 32, 34),
}
"""The same of other machines, from the trial of 160 campaigns in ``pipeline/trials/machines/README.md``."""


def track_record(diagnosis: Conclusion[Any, Any], records: Mapping[str, TrackRecord] = RECORD) -> TrackRecord | None:
    """The record of answers like this one among some records; None where none was found."""
    weak = diagnosis.verdict is Verdict.AMBIGUOUS and diagnosis.weak
    return records.get("weak" if weak else str(diagnosis.verdict))
