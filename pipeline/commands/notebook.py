"""The way from recordings to a diagnosis for notebooks and scripts: values in, values out, no folder needed.

Each function is the stage of the command of the same name without its files: `ingest`, `analyse`, `compare`,
`diagnose`, and `write_report` for whoever wants the files after all. They are imported from ``pmg.pipeline``.
"""

from __future__ import annotations

import shutil
import tempfile
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, Unpack, overload

import numpy as np

from pmg.pipeline.commands.analyse import gather
from pmg.pipeline.commands.audit_entry import audited_from_python
from pmg.pipeline.commands.compare import write_results
from pmg.pipeline.commands.compare_and_diagnose import SEED, diagnose_campaign, simulate_campaign
from pmg.pipeline.commands.in_motion.notebook import MotionCampaignDiagnosis, diagnose_in_motion
from pmg.pipeline.commands.ingest import IngestOptions, run_ingest
from pmg.pipeline.commands.notebook_results import (
    CampaignAnalysis,
    CampaignComparison,
    CampaignDiagnosis,
    FittingChoices,
    IngestedCampaigns,
)
from pmg.pipeline.commands.stored_analysis import analysed
from pmg.pipeline.files.threads import one_thread
from pmg.pipeline.fit.analysis import analyse as analyse_grid
from pmg.pipeline.fit.options import chosen_options
from pmg.pipeline.grid.tables import frame_grid, grid_frame
from pmg.pipeline.model.read_model import read_model
from pmg.pipeline.recording import read
from pmg.pipeline.settings.bench_in_force import bench_of_store
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.recording.read import Recording
    from pmg.pipeline.windows.limits import Steadiness

__all__ = ["analyse", "compare", "diagnose", "ingest", "read_recording", "write_report"]


def read_recording(recording: str | Path) -> Recording:
    """One recording, decoded: samples in SI units, steps of the sequence, calibration, findings.

    Parameters
    ----------
    recording : str or Path
        A file of layout pmg.v1.

    Returns
    -------
    Recording
        `samples` is a polars frame: torques [N m] and angles [rad] of both shafts on one sample clock.

    Raises
    ------
    UnusableRecordingError
        When the file gives no point.
    """
    return read.read_recording(Path(recording))


@one_thread()
def ingest(
    recordings: str | Path,
    store: str | Path | None = None,
    *,
    workers: int | None = 1,
    limits: Path | Steadiness | None = None,
    supplied: Path | None = None,
    machine: str | Path | None = None,
) -> IngestedCampaigns:
    """Decode recordings, find and judge their test windows, and reduce them to means.

    Parameters
    ----------
    recordings : str or Path
        Folder of recordings, or one file.
    store : str or Path, optional
        Folder that keeps samples and means, to be used again; without it a temporary one.
    workers : int, optional
        Processes of this machine, which a script may only ask for under ``if __name__ == "__main__"``; None for as many
        as pay.
    limits : Path or Steadiness, optional
        Limits by which windows are judged, or the file that holds them.
    supplied : Path, optional
        File that states what the recordings lack.
    machine : str or Path, optional
        Machine file of another magnetic gear, or the name of one that ships; the store remembers it.

    Returns
    -------
    IngestedCampaigns

    Raises
    ------
    RecordingError
        When there are no recordings.
    """
    place = Path(tempfile.mkdtemp(prefix="pmg-store-")) if store is None else Path(store)
    options = IngestOptions(workers, limits=limits, chart=supplied, machine=None if machine is None else str(machine))
    try:
        with audited_from_python("ingest", place, recordings=recordings, **vars(options)):
            done = run_ingest(Path(recordings), place, options)
    except BaseException:
        if store is None:
            shutil.rmtree(place, ignore_errors=True)
        raise
    counts = done.data
    found = IngestedCampaigns(
        place,
        tuple(counts["campaigns"]),
        counts["windows"],
        counts["rejected"],
        tuple(remark.to_dict() for remark in done.findings),
    )
    if store is None:
        weakref.finalize(found, shutil.rmtree, place, ignore_errors=True)
    return found


@one_thread()
def analyse(
    recordings: IngestedCampaigns | str | Path | None = None,
    *,
    grids: str | Path | None = None,
    campaign: str | None = None,
    terms_sun: str | None = None,
    terms_ring: str | None = None,
    k_corr: str | float | None = None,
    **fitting: Unpack[FittingChoices],
) -> CampaignAnalysis:
    """Fit losses, calibrate the model and balance the powers of a campaign.

    Parameters
    ----------
    recordings : IngestedCampaigns, str or Path
        What `ingest` gave, or a store.
    grids : str or Path, optional
        Folder with grids of means to analyse instead.
    campaign : str, optional
        Which campaign, where the store holds several.
    terms_sun, terms_ring : str, optional
        Powers of speed in the loss curves, such as ``"0,1/2,1,2"``; ``"auto"`` lets the data choose.
    k_corr : str or float, optional
        ``"joint"``, ``"rule"``, or a value from 0 to 1.
    **fitting
        How the losses are fitted, see `FittingChoices`.

    Returns
    -------
    CampaignAnalysis

    Raises
    ------
    StoreError
        When the store holds no such campaign.
    FitError
        When a choice is not understood.
    """
    if (recordings is None) == (grids is None):
        came = "neither" if recordings is None else "both"
        raise FitError("analyse", f"{came} of recordings and grids", "one of them", "Pass what ingest gave, or grids=.")
    options = chosen_options(
        published=grids is not None,
        terms_sun=terms_sun,
        terms_ring=terms_ring,
        correction=None if k_corr is None else str(k_corr),
        **fitting,
    )
    store = recordings.store if isinstance(recordings, IngestedCampaigns) else Path(recordings or ".")
    of = None if recordings is None else store
    with audited_from_python("analyse", of, grids=grids, campaign=campaign, **options.document()):
        gathered = gather(store, None if grids is None else Path(grids), campaign, bench_of_store(store))
        first = analyse_grid(gathered.grid, options, gathered.bench)
        # As it comes back from a store: speeds in rpm and back, noise floor in u. The same bytes as by the commands.
        grid = frame_grid(grid_frame(first.grid), first.grid.origin, first.grid.campaign)
        return CampaignAnalysis(analysed(store, grid, first.options), recordings)


@one_thread()
def compare(analysis: CampaignAnalysis, model: str | Path | None = None) -> CampaignComparison:
    """Simulate every point of a campaign, and subtract.

    Parameters
    ----------
    analysis : CampaignAnalysis
        Of the campaign.
    model : str or Path, optional
        A model file to simulate instead of the calibrated baseline.

    Returns
    -------
    CampaignComparison

    Raises
    ------
    FitError
        When the points do not permit a calibration, and why.
    """
    whole = analysis.whole
    given = None if model is None else read_model(Path(model))
    simulated = simulate_campaign(whole.analysis, whole.options, whole.bench, given)
    if simulated is None:
        came = "; ".join(analysis.missing) or "no calibration"
        raise FitError(
            f"campaign {analysis.campaign}", came, "points to calibrate by", "See pmg doctor for the points."
        )
    return CampaignComparison(analysis, simulated)


@overload
def diagnose(found: CampaignComparison, *, seed: int = SEED) -> CampaignDiagnosis: ...
@overload
def diagnose(
    found: IngestedCampaigns, *, campaign: str | None = None, model: str | Path | None = None
) -> MotionCampaignDiagnosis: ...
@one_thread()
def diagnose(
    found: CampaignComparison | IngestedCampaigns,
    *,
    seed: int = SEED,
    campaign: str | None = None,
    model: str | Path | None = None,
) -> CampaignDiagnosis | MotionCampaignDiagnosis:
    """Name what the simulation left out, or say why it cannot be determined.

    Parameters
    ----------
    found : CampaignComparison or IngestedCampaigns
        A campaign compared with its simulation; of runs in motion what `ingest` gave, as they need no grid.
    seed : int
        Of the synthetic campaigns behind the p-value of a comparison.
    campaign, model : str or Path, optional
        Which campaign in motion, where there are several; a model of other such runs, to take its causes out before.

    Returns
    -------
    CampaignDiagnosis or MotionCampaignDiagnosis

    Raises
    ------
    StoreError
        When there is no such campaign.
    FitError
        When it is none of both, or its runs do not permit a diagnosis.
    """
    in_motion = isinstance(found, IngestedCampaigns)
    if seed != SEED if in_motion else (campaign or model) is not None:
        came = "a seed, for runs in motion" if in_motion else "a campaign or a model, for a comparison"
        raise FitError("diagnose", came, "none of that", "Leave it out.")
    if isinstance(found, IngestedCampaigns):
        return diagnose_in_motion(found, campaign, None if model is None else Path(model))
    if not isinstance(found, CampaignComparison):
        expected = "what compare gave, or, of runs in motion, what ingest gave"
        raise FitError("diagnose", type(found).__name__, expected, "Pass that.")
    comparison, whole = found, found.analysis.whole
    rng = np.random.default_rng(seed)
    judged = diagnose_campaign(whole.analysis, comparison.simulated, whole.bench, rng, whole.beside_motion)
    return CampaignDiagnosis(comparison.analysis, judged, seed)


@one_thread()
def write_report(
    diagnosis: CampaignDiagnosis | MotionCampaignDiagnosis,
    folder: str | Path,
    *,
    note: str = "",
    tolerances: Mapping[str, tuple[float, float]] | None = None,
) -> Path:
    """Write the report with its figures and tables, ``diagnosis.json`` and ``model.toml``.

    Parameters
    ----------
    diagnosis : CampaignDiagnosis or MotionCampaignDiagnosis
        Of a campaign.
    folder : str or Path
        Where; made when it is not there.
    note : str
        Told at the head of the report.
    tolerances : mapping, optional
        Tolerances of the comparison with steady points, by quantity: absolute [SI] and relative.

    Returns
    -------
    Path
        The page.
    """
    if isinstance(diagnosis, MotionCampaignDiagnosis):
        return diagnosis.write(Path(folder), note)
    page = diagnosis.report_with(note, tolerances) if note or tolerances else diagnosis.report
    files, _ = write_results(page, diagnosis.analysis.whole, diagnosis.judged, Path(folder), tolerances)
    return files[0]
