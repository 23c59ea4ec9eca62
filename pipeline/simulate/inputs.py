"""Inputs that a scenario names: losses, torque map and recorded programmes, made into a model and its programmes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.analysis.outputs import read_analysis, unproven_analysis
from pmg.pipeline.fit.analysis import analyse, chosen_terms, fit_curves
from pmg.pipeline.fit.calibration import calibrate
from pmg.pipeline.fit.options import chosen_options
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.model.read_model import read_model
from pmg.pipeline.simulate.field_csv import read_fem_csv
from pmg.pipeline.simulate.programmes import programme_of
from pmg.pipeline.thesis_figures.printed_simulation import recovered_losses
from pmg.pipeline.wording.option_words import AUTO, check_powers, parse_powers
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.programme import Programme
from pmg.sim.errors import BenchError, FitError
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.maps.analytic import Cogging, analytic_map
from pmg.sim.maps.table import fit_map
from pmg.sim.mechanisms import Instrument
from pmg.sim.mechanisms.warmth import WARMING, begin_warm
from pmg.sim.shafts import SIDES
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.fit.options import AnalysisOptions
    from pmg.pipeline.recording.remark import Remark
    from pmg.pipeline.simulate.scenario import Losses
    from pmg.pipeline.simulate.scenario_file import ScenarioFile
    from pmg.pipeline.simulate.scenario_mechanisms import Switched
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.maps.torque_map import TorqueMap
    from pmg.sim.mechanisms import Mechanism


@dataclass(frozen=True)
class Inputs:
    """A scenario's model and programmes.

    Parameters
    ----------
    bench : BenchParameters
        The bench's numbers.
    losses : LossModel or None
        The losses; None where there are none at all.
    drivetrain : Drivetrain
        The bench in motion.
    sun, ring : Programme
        What the motors are asked for [N m], or [rad/s] where they follow speed; nothing unless the scenario says.
    facts : tuple of (label, value)
        Where the losses and the map come from, for people.
    limits : tuple of float
        Time constants of what is held over a run [s].
    """

    bench: BenchParameters
    losses: LossModel | None
    drivetrain: Drivetrain
    sun: Programme
    ring: Programme
    facts: tuple[tuple[str, str], ...]
    limits: tuple[float, ...] = ()

    @property
    def gearbox(self) -> Gearbox:
        """The same losses at steady speed; faults of the transducers distort what is recorded, not these."""
        return Gearbox(self.bench, tuple(m for m in self.drivetrain.mechanisms if not isinstance(m, Instrument)))


def gather_inputs(
    file: ScenarioFile, bench: BenchParameters, model_file: Path | None = None, switched: tuple[Switched, ...] = ()
) -> Inputs:
    """Inputs that a scenario names, read and made into a model.

    Parameters
    ----------
    file : ScenarioFile
        The scenario.
    bench : BenchParameters
        The bench's numbers.
    model_file : Path, optional
        A model to take the losses and mechanisms from, instead of the scenario's source of losses.
    switched : tuple of Switched
        Mechanisms to switch on besides the scenario's.
    """
    scenario, mode = file.table, file.table.bench
    given = scenario.losses.model
    model_file = model_file or (None if given is None else file.resolve(given))
    model: LossModel | None
    about: tuple[tuple[str, str], ...]
    added: tuple[Mechanism, ...]
    if model_file is not None:
        whole = read_model(model_file)
        model, added = whole.baseline, whole.mechanisms(bench)
        about = (("Losses", f"model {model_file.name}"), ("Mechanisms of the model", whole.description))
    else:
        model, added = loss_model(file, bench), ()
        about = _about_losses(file, model)
    extra = (*scenario.mechanism, *switched)
    added += tuple(one.mechanism(bench, model or NO_LOSSES) for one in extra)
    _refuse_twice(file, added)
    if extra:
        about = (*about, ("Mechanisms switched on", "; ".join(one.description for one in extra)))
    torque_map, about_map = _torque_map(file, bench)
    drivetrain = Drivetrain(
        bench,
        (*(() if model is None else baseline_mechanisms(model, bench)), *added),
        scenario.assumptions,
        mode.gear,
        mode.configuration,
        mode.held,
        mode.control_sun,
        mode.control_ring,
        torque_map,
        begin_warm(added),
    )
    run = scenario.transient
    sun, ring = (
        programme_of(file, side, None if run is None else getattr(run, side), getattr(mode, f"control_{side}"))
        for side in SIDES
    )
    if any(isinstance(m, WARMING) for m in added):
        warmth = drivetrain.warmth
        text = f"sun {warmth.sun:g} K, ring {warmth.ring:g} K, magnets {warmth.magnets:g} K above ambient"
        about = (*about, ("Warmth held over a run", text))
    limits = tuple(float(m.time_constant) for m in added if isinstance(m, WARMING))
    return Inputs(bench, model, drivetrain, sun, ring, (*about, ("Torque map", about_map)), limits)


NO_LOSSES = LossModel(LossCurve((0.0,), np.zeros(1), 1.0, 1.0), LossCurve((0.0,), np.zeros(1), 1.0, 1.0), 1.0, 0, 0, 0)
"""Losses under the mechanisms where a scenario has none."""


def _refuse_twice(file: ScenarioFile, mechanisms: tuple[Mechanism, ...]) -> None:
    ids = [mechanism.identifier for mechanism in mechanisms]
    for i, name in enumerate(ids):
        if name in ids[:i]:
            came, do = f"{name} twice", "Take it out of the scenario, of --with, or of the model."
            raise BenchError(f"{file.path}: mechanism.{name}", came, "each mechanism once", do)


def loss_model(file: ScenarioFile, bench: BenchParameters) -> LossModel | None:
    """The losses: curves fitted to the grids, and what is not set by hand calibrated on them."""
    given = file.table.losses
    if given.none:
        return None
    if given.model is not None:
        return read_model(file.resolve(given.model)).baseline
    if given.grids is not None:
        grid, options = read_published(file.resolve(given.grids), bench), chosen_options(published=True)
    else:
        grid, options = read_analysis(file.resolve(str(given.analysis)))
    if given.terms_sun == AUTO:
        options = replace(options, auto_sun=True)
    elif given.terms_sun is not None:
        powers = _powers(given.terms_sun, f"{file.path}: losses.terms_sun")
        options = replace(options, auto_sun=False, powers_sun=powers)
    if given.terms_ring == AUTO:
        options = replace(options, auto_ring=True)
    elif given.terms_ring is not None:
        powers = _powers(given.terms_ring, f"{file.path}: losses.terms_ring")
        options = replace(options, auto_ring=False, powers_ring=powers)
    if given.robust is not None:
        options = replace(options, robust=given.robust)
    if given.damping is not None:
        options = replace(options, damping=given.damping)
    model = _with_constants(given, grid, options, bench)
    return recovered_losses(grid, model, bench) if given.printed_torques else model


def _with_constants(given: Losses, grid: Grid, options: AnalysisOptions, bench: BenchParameters) -> LossModel:
    """Curves fitted to the grid, with the constants set by hand; those left out are calibrated."""
    by_hand = {name: getattr(given, name) for name in ("b", "c", "d") if getattr(given, name) is not None}
    if given.K_corr is not None and len(by_hand) == 3:
        fits = fit_curves(grid, chosen_terms(grid, options)[0], weighted=True)
        return LossModel(fits.sun.curve, fits.ring.curve, given.K_corr, **by_hand)
    if given.K_corr is not None:
        options = replace(options, correction=repr(given.K_corr))
    return _calibrated(grid, options, bench, by_hand)


def unproven_losses(file: ScenarioFile) -> tuple[Remark, ...]:
    """A warning where the losses are of an analysis in a store that is unproven."""
    given = file.table.losses
    return () if given.analysis is None or given.model is not None else unproven_analysis(file.resolve(given.analysis))


def _powers(text: str, where: str) -> tuple[float, ...]:
    return check_powers(parse_powers(text, where))


def _calibrated(grid: Grid, options: AnalysisOptions, bench: BenchParameters, by_hand: dict[str, float]) -> LossModel:
    """The calibrated losses; with constants set by hand, the others are calibrated together with them."""
    analysis = analyse(grid, options, bench)
    if by_hand and analysis.calibration is not None and analysis.fits is not None:
        correction = None if options.correction == "joint" else analysis.calibration.model.correction
        return calibrate(
            analysis.grid, analysis.fits, bench, correction=correction, held=by_hand, method=options.damping
        ).model
    if analysis.calibration is None:
        raise (
            analysis.missing[0]
            if analysis.missing
            else FitError(
                "losses", "no calibration", "grids that determine one", "Set K_corr, b, c and d in the scenario."
            )
        )
    return analysis.calibration.model


def _about_losses(file: ScenarioFile, model: LossModel | None) -> tuple[tuple[str, str], ...]:
    given = file.table.losses
    if model is None:
        return (("Losses", "none at all"),)
    constants = {"K_corr": model.correction, "b": model.b, "c": model.c, "d": model.d}
    text = ", ".join(
        f"{name} = {value:.4g} ({'calibrated' if getattr(given, name) is None else 'set in the scenario'})"
        for name, value in constants.items()
    )
    terms = "; ".join(
        f"{shaft} {', '.join(f'{power:g}' for power in curve.powers)}" + (" (by the data)" if chosen == AUTO else "")
        for shaft, curve, chosen in (
            ("sun", model.curve_sun, given.terms_sun),
            ("ring", model.curve_ring, given.terms_ring),
        )
    )
    by_hand = all(getattr(given, name) is not None for name in constants)
    recovered = ", the sun's such that the source's printed torques come out" if given.printed_torques else ""
    fitted = "fitted robustly" if by_hand else "calibrated together with the constants, not robustly"
    return (
        ("Losses", f"curves of {given.grids or given.analysis}" + (f", {fitted}" if given.robust else "") + recovered),
        ("Powers of speed in the curves", terms),
        ("Loss constants", text),
    )


def _torque_map(file: ScenarioFile, bench: BenchParameters) -> tuple[TorqueMap | None, str]:
    """The map that the scenario describes, before its scale; None for the plain sine."""
    given, gear = file.table.map, bench.gear(file.table.bench.gear)
    if given.fem is not None:
        found, quality = fit_map(read_fem_csv(file.resolve(given.fem)), gear)
        return found, f"{given.fem}: {quality.terms} terms, residual {quality.residual_rms:.2g} N m (rms)"
    if not given.model_fields_set:
        return None, "sine with the published pull-out torques"
    harmonics = {int(order): share for order, share in given.harmonics.items()}
    cogging = (
        None if amplitude is None else Cogging(amplitude, order)
        for amplitude, order in (
            (given.cogging_sun_nm, given.cogging_sun_order),
            (given.cogging_ring_nm, given.cogging_ring_order),
        )
    )
    return analytic_map(gear, 1.0, harmonics, *cogging), "analytic, with the harmonics and cogging of the scenario"
