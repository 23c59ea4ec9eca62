"""Figures on the sets that are told: how often they hold the truth and how large they are, and figures by laws."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pmg.pipeline.trials.laws import RESERVED, USUAL
from pmg.pipeline.trials.score.figures import ABOUT_ONE, IN_LIBRARY, Aim, Figured, figures, mean, share

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.trials.score.score import Score

WORDS = {
    "one": "one effect",
    "outside": "one effect outside the library",
    "two": "two effects",
    "confounded": "poor designs",
}
"""Kinds of campaign in which a set may hold a truth."""
ANSWERS = {
    "named": "where a cause was named",
    "ambiguous": "where several causes were given",
    "weak": "where the difference was too weak to name one cause, or none was proved",
    "not_in_library": "where no cause of the library was given",
}
"""Kinds of answer, each with how often it holds the truth."""
COVER, SMALL = Aim(low=0.95), Aim(high=1.5)
"""Of the share of sets that hold the truth, and of the mean size where there is one cause to tell."""
OF_LAWS = (
    "size_95",
    "named_right_at_1",
    "named_right_above",
    "right_or_set",
    "two_right",
    "confident_library",
    "held_out",
    "parameter_cover",
    "set_cover_one",
    "set_size_one",
)
"""Figures that are given for each family of laws."""


def set_figures(scores: Sequence[Score]) -> tuple[Figured, ...]:
    """Coverage of the sets told, over all sizes, and their mean size about 1 sigma, by kind of campaign.

    A named cause is a set of one, and that the library holds no such cause is a member by itself. Shafts do not count.
    """
    told = {kind: [score for score in scores if score.kind == kind and score.holds is not None] for kind in WORDS}
    about = {kind: [s for s in told[kind] if ABOUT_ONE[0] <= s.reached < ABOUT_ONE[1]] for kind in WORDS}
    every = [bool(score.holds) for kind in WORDS for score in told[kind]]
    return (
        share("set_cover", "sets told that hold the truth, a named cause being a set of one", every, COVER),
        *(
            share(f"set_cover_{kind}", f"sets that hold the truth, {words}", [bool(s.holds) for s in told[kind]], COVER)
            for kind, words in WORDS.items()
        ),
        *(
            share(f"set_cover_by_{answer}", f"sets that hold the truth, {words}", _holding(told, answer), COVER)
            for answer, words in ANSWERS.items()
        ),
        *(
            mean(
                f"set_size_{kind}",
                f"mean size of a set about 1 sigma, {words}",
                [float(len(score.told)) for score in about[kind]],
                SMALL if kind in ("one", "outside") else None,
            )
            for kind, words in WORDS.items()
        ),
    )


def _holding(told: Mapping[str, Sequence[Score]], answer: str) -> list[bool]:
    """Whether each set of one of the `ANSWERS` holds the truth."""
    return [bool(score.holds) for scores in told.values() for score in scores if score.answer == answer]


def figures_by_laws(scores: Sequence[Score]) -> tuple[Figured, ...]:
    """Figures on effects of the library, once for usual and once for reserved laws, where a trial holds both.

    They have no aims of their own, as the trial as a whole is judged.
    """
    library = [score for score in scores if score.kind in IN_LIBRARY]
    if {score.laws for score in library} < {USUAL, RESERVED}:
        return ()
    found = []
    for family in (USUAL, RESERVED):
        mine = [score for score in library if score.laws == family]
        for figure in (*figures(mine, (), ()), *set_figures(mine)):
            if figure.id in OF_LAWS:
                name, what = f"{figure.id}_{family}", f"{figure.what}; {family} laws"
                found.append(replace(figure, id=name, what=what, aim=None))
    return tuple(found)
