"""A model of the bench in motion carried to other runs: what it predicts unseen, and the runs without its causes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.fitting import TermFit
from pmg.pipeline.diagnosis.motion.candidates.terms import torque_of_terms
from pmg.pipeline.diagnosis.motion.fitted import HELD, fit_beside, fit_constants
from pmg.pipeline.diagnosis.motion.rows import later_of
from pmg.pipeline.diagnosis.motion.view import views_of
from pmg.pipeline.model.motion_model import NO_MODEL, digest_of
from pmg.pipeline.motion.smooth import derivative
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.pipeline.model.motion_model import MotionCause, MotionModel
    from pmg.pipeline.motion.lag import Lag
    from pmg.pipeline.motion.run import MovingRun
    from pmg.sim.bench import BenchParameters
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array


WORSE_BY = 1.0
"""Standard errors of a difference over the runs from which on a prediction is worse."""


@dataclass(frozen=True)
class MotionPrediction:
    """Missing torque of runs that a model has not seen, root mean squares over their rows [N m].

    Parameters
    ----------
    without, predicted, fitted : float
        With the constants of the model alone; with its causes; and with constants fitted to the runs as judged.
    unseen : bool
        Whether the model was made of other runs.
    left_out : tuple of str
        Causes of the model, by title, with which these runs are predicted worse: they are judged without them.
    """

    without: float
    predicted: float
    fitted: float
    unseen: bool
    left_out: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """For people."""
        without, predicted, fitted = (f"{1e3 * each:.2f}" for each in (self.without, self.predicted, self.fitted))
        verb = "predicts these runs with" if self.unseen else "made of these very runs, so this is no prediction:"
        named = " and ".join(self.left_out)
        absent = f" With {named} they are predicted worse: judged without." if named else ""
        return (
            f"{verb} {predicted} mN m; {without} with its constants alone, {fitted} with constants fitted to these "
            f"runs.{absent} Its constants stand for the data sheet here."
        )


def apply_motion_model(
    model: MotionModel, runs: tuple[MovingRun, ...], bench: BenchParameters
) -> tuple[tuple[MovingRun, ...], MotionModel, MotionPrediction | None]:
    """Runs without what the causes of a model add to their readings, and how well it predicts them; None of no model.

    Returns
    -------
    runs : tuple of MovingRun
        Without what its causes add.
    model : MotionModel
        With the causes that act in them.
    prediction : MotionPrediction or None
        Of the whole model.

    Notes
    -----
    A cause with which the runs are predicted plainly worse than without it (`_worse`) does not act in them, and stays
    out. Where the poles stood at the start of a run, zeros and clocks are of the campaign and fitted to it; all else is
    the model's. What a cause adds is worked out at the fine samples, whose band is wider than that of the rows; before
    the first and after the last of them the torque that it acts on is not known (NaN). A lag is taken out together with
    the skew of its reading, which that is left with. The twist of a coupling is taken from what is left, so that a drag
    is off by some two hundredths of what it is.

    Raises
    ------
    FitError
        The runs are of another gear.
    """
    if model is NO_MODEL:
        return runs, model, None
    gears = {run.gear for run in runs if run.manoeuvre.moves}
    if gears != {model.gear}:
        came = " and ".join(f"gear {gear}" for gear in sorted(gears)) or "no run that moves"
        raise FitError("model of runs in motion", came, f"runs of gear {model.gear} alone", "Choose such runs.")
    known = {name: (value, HELD * error) for name, (value, error) in model.constants.items()}
    unseen = model.provenance.get("runs_sha256") != digest_of(runs)
    alone, _, noise = fit_constants(runs, bench, known)

    def cleared_of(causes: tuple[MotionCause, ...]) -> tuple[MovingRun, ...]:
        about = fit_beside(alone, noise, tuple(map(_as_fit, causes)))[0] if causes else alone
        apart = _without(about, causes)
        return tuple(replace(run, torque=apart.get(run.name, run.torque)) for run in runs)

    cleared = cleared_of(model.causes)
    predicted, _, _ = fit_constants(cleared, bench, known)
    acting, with_acting = model.causes, predicted
    for cause in model.causes:
        others = tuple(each for each in acting if each is not cause)
        without = fit_constants(cleared_of(others), bench, known)[0] if others else alone
        if _worse(with_acting, without):
            acting, with_acting = others, without
    if acting != model.causes:
        cleared = cleared_of(acting) if acting else runs
    fitted, _, _ = fit_constants(cleared, bench)
    left_out = tuple(cause.term.title for cause in model.causes if cause not in acting)
    prediction = MotionPrediction(_missing(alone), _missing(predicted), _missing(fitted), unseen, left_out)
    return cleared, replace(model, causes=acting), prediction


def _worse(predicted: MotionBaseline, without: MotionBaseline) -> bool:
    """Whether more torque is missing with a cause than without it, run by run, beyond what runs differ in that."""
    more = _squares_by_run(predicted) - _squares_by_run(without)
    error = float(np.std(more)) / math.sqrt(len(more))
    return float(np.mean(more)) > WORSE_BY * error


def _squares_by_run(baseline: MotionBaseline) -> Array:
    """Mean square of the missing torque of each run that moves [(N m)2]."""
    by_run: dict[str, list[Array]] = {}
    for place, stretch in enumerate(baseline.stretches):
        if not stretch.at_rest:
            by_run.setdefault(stretch.run.run.name, []).append(baseline.left(place))
    return np.array([float(np.mean(np.concatenate(parts) ** 2)) for parts in by_run.values()])


def _without(about: MotionBaseline, causes: tuple[MotionCause, ...]) -> dict[str, PerShaft[Array]]:
    """Torques of the runs less what some causes add, by the name of the run."""
    found: dict[str, PerShaft[Array]] = {}
    for view in views_of(about.clean):
        run = view.state.stretch.run
        before = found.get(run.run.name, run.run.torque)
        effect = torque_of_terms(view, ((each.term, each.shape, np.array(each.amplitudes)) for each in causes))
        effect = effect + _lagging_later(view, about.lags)
        time = np.arange(len(before[view.side])) / run.run.rate
        beyond = np.nan if effect.any() else 0.0  # what acts is known at the fine samples alone
        more = np.interp(time, run.time, effect, left=beyond, right=beyond)
        found[run.run.name] = replace(before, **{view.side: before[view.side] - more})
    return found


def _lagging_later(view: RotorView, lags: tuple[Lag, ...]) -> Array:
    """What lags add to a torque that is late by the skew of its reading, beyond what they add to one in time (n,)."""
    state = view.state
    slope = derivative(state.coupling_torque, state.stretch.run.fine_rate)
    skew = state.value(f"skew_{view.side}")
    own = (lag for lag in lags if lag.side == view.side and not view.at_rest)
    return sum((skew * (slope + later_of(lag, state)[:, 0]) for lag in own), np.zeros(len(slope)))


def _as_fit(cause: MotionCause) -> TermFit:
    return TermFit(cause.term, 0.0, 0.0, np.zeros(0), (), np.array(cause.amplitudes), cause.shape)


def _missing(baseline: MotionBaseline) -> float:
    """Root mean square of the missing torque over all rows [N m]."""
    return float(np.sqrt(np.mean(np.concatenate([baseline.left(k) for k in range(len(baseline.stretches))]) ** 2)))
