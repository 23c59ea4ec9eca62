"""A campaign as far as it has come: its points, what the cross-checks say, and the first mismatch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from pmg.pipeline.analysis.comparison import compare
from pmg.pipeline.analysis.tolerance import COMPARED, agreements
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.campaign import campaigns, measured_grid
from pmg.pipeline.grid.copies import without_copies
from pmg.pipeline.grid.crosschecks.catalogue import cross_check
from pmg.pipeline.grid.window_facts import rated, window_facts
from pmg.pipeline.wording.numerals import number
from pmg.pipeline.wording.probability import COVERAGE_FACTOR
from pmg.sim.errors import PmgError
from pmg.sim.signals import RESIDUAL, SPEED_RING, SPEED_SUN, TORQUES
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from pmg.pipeline.analysis.comparison import Residuals
    from pmg.pipeline.analysis.tolerance import Agreements
    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.pipeline.model.model_file import Model
    from pmg.pipeline.recording.remark import Remark
    from pmg.pipeline.store.store import Store
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid


class PointState(StrEnum):
    """State of a point of the grid."""

    MEASURED = "measured"
    AGREES = "agrees with the simulation"
    DIFFERS = "differs from the simulation"
    REJECTED = "rejected"


@dataclass(frozen=True)
class WatchedPoint:
    """A point of the grid.

    Parameters
    ----------
    name, kind : str
        Its name, and its configuration.
    across, along : float
        Place in the grid: speed of the sun [rpm], and speed of the ring [rpm] or, engaged, the load [N m].
    state : PointState
        Its state.
    why : str
        Reason of a rejection, or the difference; empty else.
    """

    name: str
    kind: str
    across: float
    along: float
    state: PointState
    why: str = ""


@dataclass(frozen=True)
class WatchedCampaign:
    """A campaign as far as it has come.

    Parameters
    ----------
    name : str
        Of the campaign; empty before the first recording.
    recordings : int
        Usable recordings.
    points : tuple of WatchedPoint
        In the order of the test.
    unusable : tuple of (str, str)
        Recordings that cannot be used, with the reason.
    remarks : tuple of Remark
        Findings of the cross-checks.
    first_mismatch : str
        The first point beyond tolerance and U = 2u, in a sentence; empty where none is.
    simulation : str
        What the points are compared with, or why they are not yet.
    """

    name: str = ""
    recordings: int = 0
    points: tuple[WatchedPoint, ...] = ()
    unusable: tuple[tuple[str, str], ...] = ()
    remarks: tuple[Remark, ...] = ()
    first_mismatch: str = ""
    simulation: str = "Nothing has landed yet."


def watched_campaign(store: Store, bench: BenchParameters, given: Model | None = None) -> WatchedCampaign:
    """The latest campaign of a store as far as it has come.

    Parameters
    ----------
    store : Store
        Holds what has been decoded.
    bench : BenchParameters
        The machine.
    given : Model, optional
        A model to compare with from the first point on; without one the campaign's own fit serves, once it has enough
        points for one.
    """
    held = store.manifests()
    bad = tuple((m.file, next((f.message for f in m.findings), "no reason is kept")) for m in held if not m.ingested)
    sound = [manifest for manifest in held if manifest.ingested]
    if not sound:
        return WatchedCampaign(unusable=bad, simulation="No usable recording has landed yet.")
    name = campaigns(sound)[-1]
    of_it = without_copies([manifest for manifest in sound if manifest.campaign == name])
    checked = cross_check(of_it, bench)
    known = WatchedCampaign(name, len(of_it), unusable=bad, remarks=tuple(checked.findings))
    try:
        grid = measured_grid(name, list(checked.manifests), bench)
    except PmgError as none:
        return _with(known, (), "", none.advice)
    return _judged(known, grid, rated(bench, window_facts(checked.manifests)), given)


def _with(known: WatchedCampaign, points: tuple[WatchedPoint, ...], mismatch: str, simulation: str) -> WatchedCampaign:
    return replace(known, points=points, first_mismatch=mismatch, simulation=simulation)


def _judged(known: WatchedCampaign, grid: Grid, bench: BenchParameters, given: Model | None) -> WatchedCampaign:
    """The points of a grid, each compared with the simulation where there is one."""
    calibration: FittedBaseline | None = None
    if given is not None:
        gearbox = Gearbox(bench, (*baseline_mechanisms(given.baseline, bench), *given.mechanisms(bench)))
        words = f"Compared with the given model: {given.description}. U leaves the uncertainty of that model out."
    else:
        analysis = analyse(grid, AnalysisOptions(), bench)
        calibration = analysis.calibration
        if calibration is None:
            lacking = "; ".join(fault.came for fault in analysis.missing[:1]) or "too few points"
            return _with(known, _points(grid, None, None), "", f"Not compared yet: {lacking}.")
        gearbox = Gearbox.calibrated(bench, calibration.model)
        words = f"Compared with the baseline fitted to the {len(grid)} points so far."
    residuals = compare(grid, steady(gearbox, grid.points, grid.campaign), bench, calibration)
    judged = agreements(residuals, bench)
    points = _points(grid, residuals, judged)
    beyond = [i for i, point in enumerate(points) if point.state is PointState.DIFFERS]
    first = min(beyond, key=lambda i: float(grid.points.started_at[i]), default=None)
    sentence = "" if first is None else f"{points[first].name}: {points[first].why}"
    return _with(known, points, sentence, words)


def _points(grid: Grid, residuals: Residuals | None, judged: Agreements | None) -> tuple[WatchedPoint, ...]:
    at = grid.points
    found: list[WatchedPoint] = []
    for i in range(len(grid)):
        state, why = PointState.MEASURED, ""
        if not grid.accepted[i]:
            state, why = PointState.REJECTED, str(grid.reason[i])
        elif residuals is not None and judged is not None and judged.compared[i]:
            why = _difference(residuals, judged, i)
            state = PointState.DIFFERS if why else PointState.AGREES
        along = float(at.load_set[i]) if at.engaged[i] else float(SPEED_RING.display(float(at.speed_ring[i])))
        across = float(SPEED_SUN.display(float(at.speed_sun[i])))
        found.append(WatchedPoint(str(at.name[i]), str(at.configuration[i]), across, along, state, why))
    return tuple(found)


def _difference(residuals: Residuals, judged: Agreements, i: int) -> str:
    """The first torque of a point that is beyond its tolerance and beyond U; empty where none is."""

    def shown(torque: float) -> str:
        return f"{number(float(RESIDUAL.display(torque)), 1)} {RESIDUAL.display_unit}"

    for name, signal in (each for each in COMPARED if each[1] in TORQUES):
        difference, agreement = getattr(residuals, name), judged.of[name]
        if agreement.compared[i] and not agreement.within[i] and not difference.within[i]:
            value, u, bound = float(difference.value[i]), float(difference.u[i]), float(agreement.bound[i])
            off = f"the {signal.meaning} is {shown(value)} off the simulation"
            return f"{off}; tolerance is {shown(bound)}, U = 2u is {shown(COVERAGE_FACTOR * u)}"
    return ""
