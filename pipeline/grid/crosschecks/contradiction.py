"""A contradiction between what a recording says and what else is known, and what is done about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.codes import Severity
from pmg.pipeline.recording.remark import Remark
from pmg.sim.signals import NORMAL_MAD

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from pmg.pipeline.store.manifest import Manifest, StoredWindow
    from pmg.sim.signals import Array

SIGMAS = 10.0
"""Distance from the others of a campaign, in their own standard deviations, that noise and drift do not reach."""


class Action(StrEnum):
    """What is done with a window that contradicts something."""

    REJECT = "reject"
    WIDEN = "widen"
    KEEP = "keep"


DONE = {
    Action.REJECT: "rejected",
    Action.WIDEN: "kept with a larger uncertainty",
    Action.KEEP: "kept",
}


@dataclass(frozen=True)
class CrossCheckRemark(Remark):
    """A contradiction as the user sees it, with the cross-check that found it.

    Parameters
    ----------
    check : str
        Name of the cross-check.
    size, limit : float
        How far it is off and how far it may be, in SI or as a part, as the message says.
    settle : str
        What the user can do, where it concerns the campaign as a whole, of which nothing is rejected; may be empty.
    """

    check: str = ""
    size: float = 0.0
    limit: float = 0.0
    settle: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Plain form for JSON."""
        return super().to_dict() | {"check": self.check, "size": self.size, "limit": self.limit}


@dataclass(frozen=True)
class Row:
    """A window and the recording that it is from.

    Parameters
    ----------
    manifest : Manifest
        The recording.
    window : StoredWindow
        One of its windows.
    """

    manifest: Manifest
    window: StoredWindow

    @property
    def key(self) -> tuple[str, int]:
        """What names the window: its recording and first sample."""
        return self.manifest.identifier, self.window.first_sample


@dataclass(frozen=True)
class Contradiction:
    """One window, or all of one recording, that contradicts something.

    Parameters
    ----------
    where : Row or Manifest or None
        The window, or the recording; None for the campaign as a whole, of which nothing is rejected.
    size, limit : float
        How far it is off, and how far it may be, in the unit that `message` uses.
    message : str
        What came and what was expected, with size and limit.
    do : str
        What the user can do.
    side : str
        Shaft whose mean torque is doubted; empty for both.
    wider : float
        Half-width of the doubt about that mean [N m].
    void : bool
        Whether it is so far off that no uncertainty makes up for it: it is rejected where others are widened.
    """

    where: Row | Manifest | None
    size: float
    limit: float
    message: str
    do: str
    side: str = ""
    wider: float = 0.0
    void: bool = False

    @property
    def place(self) -> str:
        """File and point, file, or campaign."""
        if self.where is None:
            return "campaign"
        if isinstance(self.where, Row):
            return f"{self.where.manifest.file}: {self.where.window.point}"
        return self.where.file

    def finding(self, name: str, action: Action) -> CrossCheckRemark:
        """As a finding of a stage: an error where something is rejected, else a warning."""
        action = self._taken(action)
        lost = action is Action.REJECT and self.where is not None
        done = "" if self.where is None else f"; {DONE[action]}"
        severity = Severity.ERROR if lost else Severity.WARNING
        message = f"{name}: {self.message}{done}. {self.do}"
        return CrossCheckRemark(
            severity,
            self.place,
            message,
            check=name,
            size=self.size,
            limit=self.limit,
            settle=self.do if self.where is None else "",
        )

    def _taken(self, action: Action) -> Action:
        """The action asked for, or the rejection of what no uncertainty makes up for."""
        return Action.REJECT if self.void and action is Action.WIDEN else action

    def applied(self, manifests: Sequence[Manifest], name: str, action: Action) -> list[Manifest]:
        """The recordings with that action taken.

        Parameters
        ----------
        manifests : sequence of Manifest
            Recordings of the campaign.
        name : str
            Of the check; it stands in the reason of a rejected window.
        action : Action
            What is done.
        """
        action = self._taken(action)
        if self.where is None or action is Action.KEEP:
            return list(manifests)
        manifest = self.where.manifest if isinstance(self.where, Row) else self.where
        key = self.where.key if isinstance(self.where, Row) else None

        def judged(window: StoredWindow) -> StoredWindow:
            if not window.accepted or (key is not None and key != (manifest.identifier, window.first_sample)):
                return window
            if action is Action.REJECT:
                return replace(window, accepted=False, reasons=(*window.reasons, f"{name}: {self.message}"))
            return _widened(window, self.side, self.wider)

        return [
            replace(m, windows=tuple(map(judged, m.windows))) if m.identifier == manifest.identifier else m
            for m in manifests
        ]


def _widened(window: StoredWindow, side: str, half_width: float) -> StoredWindow:
    """The window with a rectangular doubt added to the uncertainty of its means (GUM 4.3.7)."""
    more = half_width / np.sqrt(3.0)
    sun, ring = (
        replace(shaft, within=float(np.hypot(np.nan_to_num(shaft.within), more))) if side in ("", name) else shaft
        for name, shaft in window.means.items()
    )
    return replace(window, means=replace(window.means, sun=sun, ring=ring))


def accepted_rows(manifests: Iterable[Manifest]) -> Iterator[Row]:
    """Accepted windows of the recordings, in order."""
    for manifest in manifests:
        yield from (Row(manifest, window) for window in manifest.windows if window.accepted)


def robust_scale(values: Array) -> float:
    """Standard deviation of normal numbers by the median of their absolute deviations (n,); 0 of fewer than two."""
    return float(NORMAL_MAD * np.median(np.abs(values - np.median(values)))) if len(values) > 1 else 0.0


def least_absolute(basis: Array, values: Array) -> Array:
    """Coefficients of the line of least absolute distances, by least squares weighted again and again."""
    coefficients = np.linalg.lstsq(basis, values, rcond=None)[0]
    for _ in range(30):
        distance = np.abs(values - basis @ coefficients)
        weight = 1.0 / np.sqrt(np.maximum(distance, 1e-6 + 1e-3 * np.median(distance)))
        coefficients = np.linalg.lstsq(basis * weight[:, None], values * weight, rcond=None)[0]
    return np.asarray(coefficients)
