"""Sets of causes in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.wording.plurals import capitalised

if TYPE_CHECKING:
    from collections.abc import Sequence

SHAFT_WORDS = {
    "sun": " on the sun shaft",
    "ring": " on the ring shaft",
    "both": "",
    "either": " of the sun or the ring",
}
"""What follows the name of a cause, by the shaft that it acts on."""

TOGETHER = " together with "
"""Between causes of one set."""


def numbered(sets: Sequence[Sequence[str]], *, others: bool = False) -> tuple[str, ...]:
    """Sets of which one is the cause, a sentence each; what is in all of them is said first.

    Parameters
    ----------
    sets : sequence of sequence of str
        Names of the causes of each.
    others : bool
        Whether the cause may be none of them, so that nothing is common to all that may be.
    """
    common = [cause for cause in sets[0] if all(cause in each for each in sets)]
    rest = [[cause for cause in each if cause not in common] for each in sets]
    if others or not common or len(sets) == 1 or not all(rest):
        return tuple(f"{i}. {capitalised(TOGETHER.join(each))}." for i, each in enumerate(sets, 1))
    beside = "them" if common[1:] else "it"
    first = f"{capitalised(TOGETHER.join(common))} in any case; besides {beside}, one of these."
    return (first, *(f"{i}. {capitalised(TOGETHER.join(each))}." for i, each in enumerate(rest, 1)))
