"""A model of the bench in motion carried to other runs: what it predicts unseen, and the runs without its causes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.fitting import TermFit
from pmg.pipeline.diagnosis.motion.fitted import fit_beside, fit_constants
from pmg.pipeline.diagnosis.motion.view import views_of
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.pipeline.model.motion_model import MotionCause, MotionModel
    from pmg.pipeline.motion.run import MovingRun
    from pmg.sim.bench import BenchParameters
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array

KEPT_WITHIN = 1e-3
"""Factor on the standard error of a constant of a model, which is held."""


@dataclass(frozen=True)
class MotionPrediction:
    """Missing torque of runs that a model has not seen, root mean squares over their rows [N m].

    Parameters
    ----------
    without, predicted, fitted : float
        With the constants of the model alone; with its causes; and with constants fitted to these runs beside them.
    """

    without: float
    predicted: float
    fitted: float

    @property
    def sentence(self) -> str:
        """For people."""
        without, predicted, fitted = (f"{1e3 * each:.2f}" for each in (self.without, self.predicted, self.fitted))
        return (
            f"predicts these runs with {predicted} mN m; {without} with its constants alone, {fitted} with constants "
            "fitted to these runs"
        )


def apply_motion_model(
    model: MotionModel, runs: tuple[MovingRun, ...], bench: BenchParameters
) -> tuple[tuple[MovingRun, ...], MotionPrediction | None]:
    """Runs without what the causes of a model add to their readings, and how well it predicts them; None of no model.

    Notes
    -----
    Where the poles stood at the start of a run, zeros and clocks are of the campaign and fitted to it; all else is the
    model's. What a cause adds is worked out at the fine samples, whose band is wider than that of the rows.

    Raises
    ------
    FitError
        The runs are of another gear.
    """
    if not model.constants:
        return runs, None
    gears = {run.gear for run in runs if run.manoeuvre.moves}
    if gears != {model.gear}:
        came = ", ".join(f"gear {gear}" for gear in sorted(gears)) or "no run"
        raise FitError("model of runs in motion", came, f"gear {model.gear}", "Take a model of these runs' gear.")
    told = {name: (value, KEPT_WITHIN * error) for name, (value, error) in model.constants.items()}
    alone, _, noise = fit_constants(runs, bench, told)
    fits = tuple(map(_as_fit, model.causes))
    about = fit_beside(alone, noise, fits)[0] if fits else alone
    apart = _without(about, model.causes)
    cleared = tuple(replace(run, torque=apart.get(run.name, run.torque)) for run in runs)
    predicted, _, _ = fit_constants(cleared, bench, told)
    fitted, _, _ = fit_constants(cleared, bench)
    return cleared, MotionPrediction(*map(_missing, (alone, predicted, fitted)))


def _without(about: MotionBaseline, causes: tuple[MotionCause, ...]) -> dict[str, PerShaft[Array]]:
    """Torques of the runs less what some causes add, by the name of the run."""
    found: dict[str, PerShaft[Array]] = {}
    for view in views_of(about.clean):
        run = view.state.stretch.run
        before = found.get(run.run.name, run.run.torque)
        effect = sum((_torque(view, cause) for cause in causes), np.zeros(len(run.time)))
        more: Array = np.interp(np.arange(len(before[view.side])) / run.run.rate, run.time, effect)
        found[run.run.name] = replace(before, **{view.side: before[view.side] - more})
    return found


def _as_fit(cause: MotionCause) -> TermFit:
    return TermFit(cause.term, 0.0, 0.0, np.zeros(0), (), np.array(cause.amplitudes), cause.shape)


def _torque(view: RotorView, cause: MotionCause) -> Array:
    """What a cause adds at the fine samples of a stretch [N m], (n,)."""
    acts = cause.term.acts(view)
    return np.asarray(cause.term.columns(view, cause.shape) @ np.array(cause.amplitudes) * acts)


def _missing(baseline: MotionBaseline) -> float:
    """Root mean square of the missing torque over all rows [N m]."""
    return float(np.sqrt(np.mean(np.concatenate([baseline.left(k) for k in range(len(baseline.stretches))]) ** 2)))
