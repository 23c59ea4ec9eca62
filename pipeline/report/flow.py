"""The balance of a power flow: which widths meet where, before anything is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.report.figure import UNEXPLAINED

if TYPE_CHECKING:
    from pmg.pipeline.report.figure import PowerFlow

_CLOSED = 1e-9
"""Part of the greatest power below which a remainder is rounding of the arithmetic."""


@dataclass(frozen=True)
class Branch:
    """A branch that leaves (or, as a gain, enters) the trunk at one place.

    Parameters
    ----------
    label : str
        Its name.
    watts : float
        Power that leaves; negative for a gain [W].
    left, right : float
        Width that it shares with the trunk on either side [W], zero or more; ``left + right = |watts|``.
    through : float
        Width of the trunk that passes by [W].
    expanded : float
        Expanded uncertainty U of the power that leaves [W]; NaN where none is stated.
    """

    label: str
    watts: float
    left: float
    right: float
    through: float
    expanded: float = float("nan")

    @property
    def gain(self) -> bool:
        """Whether power enters here."""
        return self.watts < 0

    @property
    def unexplained(self) -> bool:
        """Whether it closes the balance instead of naming a cause."""
        return self.label.casefold().startswith(UNEXPLAINED)


@dataclass(frozen=True)
class Balance:
    """The trunk and its branches, left to right.

    Parameters
    ----------
    supply : float
        All power that enters at the two ends [W].
    trunk : tuple of float
        Power in each stretch of the trunk, positive to the right [W]; one more than there are places.
    places : tuple of Branch or None
        What happens between two stretches; None where a balanced junction has no branch.
    stages : tuple of (label, watts, index)
        Each stage, its power and its stretch of the trunk.
    expanded : tuple of float
        Expanded uncertainty U of the power of each stage [W]; NaN where none is stated.
    """

    supply: float
    trunk: tuple[float, ...]
    places: tuple[Branch | None, ...]
    stages: tuple[tuple[str, float, int], ...]
    expanded: tuple[float, ...]

    def share(self, watts: float) -> float:
        """Part of the supply; NaN where nothing is supplied."""
        return watts / self.supply if self.supply > 0 else float("nan")


def balance(flow: PowerFlow) -> Balance:
    """The widths of a power flow; whatever its numbers leave open becomes an unexplained branch.

    Parameters
    ----------
    flow : PowerFlow
        Stages and losses as stated.

    Notes
    -----
    At a junction, ``power before = power after + losses``. A change of sign along the trunk means that both
    sides feed the losses between them (or, for a gain, are fed by it).
    """
    greatest = max(abs(watts) for watts in flow.watts)
    trunk, stages = [flow.main[0][1]], [(*flow.main[0], 0)]
    of_stages, of_losses = flow.uncertainties[: len(flow.main)], flow.uncertainties[len(flow.main) :]
    places: list[Branch | None] = []
    for index, (after_label, after) in enumerate(flow.main[1:]):
        leaving = [
            (label, watts, expanded)
            for (label, watts, stage), expanded in zip(flow.losses, of_losses, strict=True)
            if stage == index
        ]
        remainder = flow.main[index][1] - after - sum(watts for _, watts, _ in leaving)
        if abs(remainder) > _CLOSED * greatest:
            leaving.append((UNEXPLAINED.capitalize(), remainder, float("nan")))
        for label, watts, expanded in leaving:
            places.append(_branch(label, watts, trunk[-1], expanded))
            trunk.append(trunk[-1] - watts)
        if not leaving:
            places.append(None)
            trunk.append(after)
        trunk[-1] = after
        stages.append((after_label, after, len(trunk) - 1))
    supply = max(flow.main[0][1], 0.0) + max(-flow.main[-1][1], 0.0)
    return Balance(supply, tuple(trunk), tuple(places), tuple(stages), of_stages)


def _branch(label: str, watts: float, before: float, expanded: float) -> Branch:
    after = before - watts
    through = min(abs(before), abs(after)) if before * after > 0 else 0.0
    return Branch(label, watts, abs(before) - through, abs(after) - through, through, expanded)
