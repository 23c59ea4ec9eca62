"""What a contestant of `./pmgw bench rivals` is given, and what it answers; the truth is not among it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from pmg.pipeline.diagnosis.engine.withheld import FOLDS
from pmg.pipeline.diagnosis.grid.candidates import grid_problem
from pmg.pipeline.diagnosis.grid.withheld import deal
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.pipeline.trials.nature import measure_case
from pmg.sim.bench import load_bench

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy.typing as npt

    from pmg.pipeline.diagnosis.grid.candidates import GridProblem
    from pmg.pipeline.trials.score.case_list import Lot
    from pmg.sim.signals import Array, Mask

TOUCHED = 0.1
"""Part of the root mean square of an effect from which a reading counts as touched, as in `pmg prove`."""


@dataclass(frozen=True)
class Bout:
    """A measured campaign about its calibrated baseline.

    Parameters
    ----------
    stage : GridProblem
        Readings, baseline, noise: what the diagnosis works on too.
    fold : (m,) array of int
        Fold of each reading: the blocks of the diagnosis's own withheld proof.
    """

    stage: GridProblem
    fold: npt.NDArray[np.int64]

    @cached_property
    def scale(self) -> Array:
        """Noise of each reading [N m]."""
        return np.asarray(self.stage.white.scale)

    @cached_property
    def residual(self) -> Array:
        """Residual of the frozen baseline, in units of the noise."""
        return np.asarray((self.stage.readings.torque - self.stage.predicted) / self.scale)

    def beside(self, values: Array, train: Mask) -> Array:
        """Values (m,) or (m, k) [noise] less what the baseline takes up of them on the training rows."""
        columns = self.stage.columns / self.scale[:, None]
        length = np.linalg.norm(columns[train], axis=0)
        length[length == 0.0] = 1.0
        solution = np.linalg.lstsq(columns[train] / length, values[train], rcond=1e-8)[0]
        return np.asarray(values - (columns / length) @ solution)

    def residual_without(self, train: Mask) -> Array:
        """Residual of the baseline that the training rows alone determine, at every reading, in units of the noise."""
        return self.beside(self.residual, train)

    @cached_property
    def covariates(self) -> Array:
        """Speed of sun and ring [rad/s], ring torque asked for [N m], time since the first point [s]: (m, 4)."""
        row, at = self.stage.readings.row, self.stage.readings.grid.points
        time = at.started_at - at.started_at.min()
        return np.stack([at.speed_sun[row], at.speed_ring[row], at.load_set[row], time[row]], axis=1)

    @property
    def shafts(self) -> tuple[tuple[str, Mask], ...]:
        """Readings of each transducer."""
        return ("sun", self.stage.readings.sun), ("ring", ~self.stage.readings.sun)

    def held_out(self, effect: Array, predict: Callable[[Mask], Array]) -> float | None:
        """Error on withheld readings over the noise, where the effect acts; None without an effect.

        Parameters
        ----------
        effect : (m,) array
            What was found on all readings [noise]; it decides only which readings are looked at.
        predict : callable
            From the training rows to a correction of every reading [noise].
        """
        size = math.sqrt(float(np.mean(effect**2)))
        if size == 0.0:
            return None
        touched = np.abs(effect) > TOUCHED * size
        touched &= self.fold < FOLDS
        after = np.zeros(len(effect))
        for k in range(FOLDS):
            test, train = self.fold == k, self.fold != k
            after[test] = (self.residual_without(train) - predict(train))[test]
        return self.ratio(after, touched)

    def ratio(self, error: Array, rows: Mask) -> float | None:
        """Root mean square of errors [noise] over that of the noise, both in N m; None over no readings."""
        if not rows.any():
            return None
        return math.sqrt(float(np.mean((error * self.scale)[rows] ** 2) / np.mean(self.scale[rows] ** 2)))


@dataclass(frozen=True)
class Reply:
    """What a contestant says of a campaign by one of its settings.

    Parameters
    ----------
    alarm : bool
        Whether it claims a mismatch.
    said : (id, shaft) or None
        The mechanism that it names; None where it names nothing.
    held_out : float or None
        Error on withheld readings with its correction in, over the noise.
    """

    alarm: bool
    said: tuple[str, str] | None = None
    held_out: float | None = None


@dataclass(frozen=True)
class Answer:
    """All that a contestant says of a campaign.

    Parameters
    ----------
    level : float
        How strongly it alarms; a calibrated setting alarms above the level that clean campaigns seldom pass.
    settings : dict of str to Reply
        By each of its own rules.
    graded : tuple of (float, Reply)
        What it says when told to ask for that much, in rising order; one entry where asking for more changes nothing
        but whether it alarms.
    seconds : float
        Time without the withheld folds, which are the bench's question and not its own.
    remarks : dict
        Whatever else it tells.
    """

    level: float
    settings: Mapping[str, Reply]
    graded: tuple[tuple[float, Reply], ...]
    seconds: float
    remarks: Mapping[str, Any]

    def above(self, threshold: float) -> Reply:
        """The reply of the setting that alarms above a level."""
        if self.level <= threshold:
            return Reply(alarm=False)
        said = next((reply for level, reply in self.graded if level > threshold), self.graded[-1][1])
        return Reply(True, said.said, said.held_out)


class Contestant(Protocol):
    """One that answers."""

    @property
    def name(self) -> str:
        """As in the table, and in the files that keep its answers."""

    def __call__(self, bout: Bout, *, withheld: bool) -> Answer:
        """What it says of a campaign; errors on withheld readings only when asked for."""


def enter(lot: Lot) -> Bout | None:
    """A campaign measured as `pmg prove` measures it; None where no baseline can be fitted."""
    bench = load_bench()
    analysis = analyse(measure_case(lot.draw(), lot.rng("measure")), AnalysisOptions(), bench)
    if analysis.calibration is None or analysis.fits is None or analysis.floor is None:
        return None
    readings = take_readings(analysis.grid, bench)
    stage = grid_problem(readings, bench, analysis.calibration.model, whitener(readings, bench, analysis.floor))
    return Bout(stage, deal(readings, FOLDS)[1])
