"""Remarks on a budget: slow noise, means that stray by an unknown amount or with time, tares off or unknown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scipy import stats

from pmg.pipeline.fit.noise import DRIFTED
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.wording.plurals import counted, listed
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.fit.budget import Budget

ZERO_LEVEL = 0.01
"""Level of the test whether the zero checks read zero."""


def budget_remarks(budget: Budget) -> Iterator[Remark]:
    """Remarks in the plain form of a stage's findings: slow noise, means that stray, a tare off or unknown."""
    grid, facts = budget.grid, budget.facts
    if facts is not None and not facts.correlated_by_chance:
        names = grid.points.name[facts.correlated]
        shown = listed([str(name) for name in names])
        message = (
            f"at {counted(len(names), 'point')} low-frequency noise makes the mean less certain: {shown}; expected "
            "noise that settles within a twentieth of the window. Use longer windows."
        )
        yield Remark("warning", "windows", message)
    floor = budget.floor
    unknown = [side for side in SIDES if floor is None or not floor[side].dof]
    if grid.origin != "published" and unknown:
        message = (
            f"how far means of the {' and the '.join(unknown)} stray from run to run is not known; expected repeats, "
            "zero checks, or points enough for a scatter about the loss curves. This campaign cannot state the 95 % "
            "interval of a mean, and gives that of its window alone. Run more speeds and repeat three points."
        )
        yield Remark("warning", "uncertainty of means", message)
    for side, noise in () if floor is None else floor.items():
        if noise.source == DRIFTED:
            message = (
                f"repeats of the {side} differ by {noise.repeats * 1e3:.2f} mN m, points from their neighbours by "
                f"{noise.u * 1e3:.2f} mN m; expected the same. The interval of a mean holds for the time of its "
                "window; this campaign cannot state one for the set-point at another time."
            )
            yield Remark("warning", "uncertainty of means", message)
    checks = int((grid.points.zero & grid.accepted).sum())
    if grid.origin != "published" and checks < 2:
        message = (
            f"{'none' if not checks else 'one'} in this campaign; expected two or more, as they tell how far the "
            "tares are off. What all points share holds no part for that, and is smaller than it should be; record "
            "one before and one after the campaign."
        )
        yield Remark("warning", "zero checks", message)
    for shaft in budget:
        zeros = shaft.torque[grid.points.zero & grid.accepted]
        if len(zeros) > 2 and stats.ttest_1samp(zeros, 0.0).pvalue < ZERO_LEVEL:
            message = (
                f"{len(zeros)} zero checks of the {shaft.side}: {zeros.mean() * 1e3:+.2f} mN m on average; expected "
                "0 within their scatter. The offset is not subtracted and stands in the budget; tare the transducer."
            )
            yield Remark("warning", "zero checks", message)
