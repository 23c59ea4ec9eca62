"""The stage behind ``pmg residuals``: what the residuals of fits follow, as lines, as JSON, as a page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.analysis.outputs import read_analysis, unproven_analysis
from pmg.pipeline.chapters.explained.structure import structure_section
from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.commands.compare_and_diagnose import SEED
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_files, now, went_in
from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE
from pmg.pipeline.diagnosis.grid.locate import DRAWS
from pmg.pipeline.diagnosis.residuals.covariates import BY_ID
from pmg.pipeline.diagnosis.residuals.fitted import FITS
from pmg.pipeline.diagnosis.residuals.search import study_residuals
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.document import number
from pmg.pipeline.fit.options import THESIS_OPTIONS
from pmg.pipeline.grid.campaign import recorded_bench
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.document import Facts, Headline, Report
from pmg.pipeline.report.write import write_report
from pmg.pipeline.settings.bench_in_force import bench_of_store
from pmg.pipeline.store.sources import PUBLISHED
from pmg.pipeline.wording.probability import nominal_p_text, search_p_text
from pmg.sim.bench import load_bench
from pmg.sim.errors import FitError, GridError, near_miss
from pmg.sim.signals import RESIDUAL

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.commands.crate import SourceFile
    from pmg.pipeline.diagnosis.residuals.fitted import Outlier
    from pmg.pipeline.diagnosis.residuals.search import Followed, ResidualStudy, ShaftResidual
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid

SCHEMA = "pmg.residuals/1"

FEWEST_DRAWS = 19
"""Below this no p-value of the search can be as small as `FALSE_ALARM_RATE`."""


def run_residuals(
    store: Path | None,
    grids: Path | None,
    *,
    fit: str | None = None,
    draws: int | None = None,
    seed: int | None = None,
    report: Path | None = None,
) -> Outcome:
    """Say what the residuals of the fits to a campaign follow.

    Parameters
    ----------
    store : Path, optional
        Store with an analysis.
    grids : Path, optional
        Folder of published grids, analysed with the thesis's own choices, instead.
    fit : str, optional
        One of `FITS`; all that apply when not given.
    draws, seed : int, optional
        Synthetic grids and their seed; `DRAWS` and `SEED` when not given.
    report : Path, optional
        Folder of a report; none is written when not given.

    Raises
    ------
    GridError
        Both or neither of store and grids.
    FitError
        An unknown fit, too few draws, or a fit that these points do not allow.
    """
    began = now()
    draws, seed = DRAWS if draws is None else draws, SEED if seed is None else seed
    if fit is not None and fit not in FITS:
        raise FitError("--fit", repr(fit), ", ".join(FITS), near_miss(fit, FITS) or "Choose one, or leave it out.")
    if draws < FEWEST_DRAWS:
        raise FitError("--draws", str(draws), f"{FEWEST_DRAWS} or more", "Ask for more synthetic grids.")
    analysis, bench, remarks = _analysed(store, grids)
    if analysis.fits is None or (fit == "baseline" and analysis.calibration is None):
        return Outcome({}, (), remarks, refusal=analysis.missing[0])
    grid = analysis.grid
    study = study_residuals(analysis, bench, tuple(FITS) if fit is None else (fit,), draws, seed)
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "campaign": grid.campaign,
        "origin": grid.origin,
        "draws": draws,
        "seed": seed,
        "level": FALSE_ALARM_RATE,
        "tested": study.tested,
        "p_value": study.p_value,
        "fits": [_document(part) for part in study.parts],
        "report": None,
    }
    lines = [line for part in study.parts for line in (*_lines(part, study.draws), "")]
    lines.append(_summary(study, grid.campaign))
    if report is not None:
        files = write_report(_page(study, grid, seed), report)
        taken: tuple[Path | SourceFile, ...] = went_in(store, grid)
        if grids is not None:
            taken = tuple(grids / name for name in PUBLISHED)
        leave_crate_of_files(report, "pmg residuals", taken, files, began)
        data |= {"report": str(files[0]), "files": [str(path) for path in files]}
        lines.append(f"report: {files[0]}")
    findings = tuple(Remark("info", error.where, error.advice) for error in analysis.missing)
    return Outcome(data, tuple(lines), remarks + findings, mismatch=study.p_value <= FALSE_ALARM_RATE)


def _analysed(store: Path | None, grids: Path | None) -> tuple[Analysis, BenchParameters, tuple[Remark, ...]]:
    """The analysis of a store or of published grids, its bench, and remarks on that."""
    if store is not None and grids is None:
        grid, options = read_analysis(store)
        bench, remarks = recorded_bench(store, grid, bench_of_store(store))
        return analyse(grid, options, bench), bench, unproven_analysis(store) + remarks
    if grids is not None and store is None:
        bench = load_bench()
        return analyse(read_published(grids, bench), THESIS_OPTIONS, bench), bench, ()
    came, do = "neither" if store is None else "both", "Name a store with an analysis, or published grids."
    raise GridError("--store and --grids", came, "one of them", do)


def _page(study: ResidualStudy, grid: Grid, seed: int) -> Report:
    return Report(
        title=f"What the residuals of campaign {grid.campaign} follow",
        subtitle=f"{len(grid)} points; {', '.join(FITS[name] for name in _names(study))}",
        verdict=Headline(_summary(study, grid.campaign), "attention" if study.p_value <= FALSE_ALARM_RATE else "good"),
        sections=(structure_section(study),),
        provenance=Facts(
            (
                ("Input", f"campaign {grid.campaign}, {grid.origin}"),
                ("Synthetic grids", str(study.draws)),
                ("Their seed", str(seed)),
                ("Versions", versions(PACKAGES)),
            )
        ),
    )


def _names(study: ResidualStudy) -> tuple[str, ...]:
    return tuple(dict.fromkeys(part.fit.name for part in study.parts))


def _summary(study: ResidualStudy, campaign: str) -> str:
    """The outcome as a sentence."""
    clear = sum(one.rank is not None for part in study.parts for one in part.followed)
    stray = sum(still for part in study.parts for _, still in part.outliers)
    found = f"{clear} of {study.tested} tests of a covariate are significant"
    none = f"none of {study.tested} tests of a covariate is significant"
    return (
        f"Campaign {campaign}: {found if clear else none}, corrected for multiple testing "
        f"(p {search_p_text(study.p_value, study.draws)}); {stray} residuals are outliers."
    )


def _lines(part: ShaftResidual, draws: int) -> list[str]:
    """One fit on one shaft: lack of fit, covariates clearest first, points, what could not be tested."""
    lack, ranked = part.lack, [one for one in part.followed if one.rank is not None]
    scatter, noise = RESIDUAL.display(lack.scatter), RESIDUAL.display(lack.noise)
    rows = [
        f"{FITS[part.fit.name]}, {part.shaft}: chi2/dof = {lack.chi_square:.1f}/{lack.dof:.1f} = "
        f"{lack.chi_square / lack.dof:.2f}, p {nominal_p_text(lack.p_value)}, {lack.description}; "
        f"scatter {scatter:.2f}, noise {noise:.2f} mN m"
    ]
    rows += [
        f"  {one.rank}. {one.words} ({one.look.family.configuration}): {_ranked_words(one, draws)}" for one in ranked
    ]
    also = [one for one in part.followed if one.rank is None and one.stands_out]
    if also:
        rows.append("  significant alone, but not with the numbered ones fitted: " + "; ".join(map(_short, also)))
    for outlier, still in part.outliers:
        rows.append(f"  point {_point(part, outlier, still)}")
    quiet = [one for one in part.followed if one.rank is None and not one.stands_out]
    if quiet:
        rows.append("  nothing beyond noise with: " + ", ".join(dict.fromkeys(_named(one) for one in quiet)))
    reasons: dict[str, list[str]] = {}
    for name, reason in part.untested.items():
        reasons.setdefault(reason, []).append(BY_ID[name].words)
    rows += [f"  not tested ({reason}): {', '.join(names)}" for reason, names in reasons.items()]
    return rows


def _named(one: Followed) -> str:
    return f"{one.look.covariate.words} ({one.look.family.configuration})"


def _short(one: Followed) -> str:
    return f"{_named(one)} {RESIDUAL.display(one.size):.2f} mN m"


def _ranked_words(one: Followed, draws: int) -> str:
    size, u = RESIDUAL.display(one.size), RESIDUAL.display(one.size_u)
    return (
        f"{size:.2f} mN m rms (u {u:.2f}); {one.shape_description}; p {nominal_p_text(one.p_value)}, with "
        f"look-elsewhere {search_p_text(one.p_search, draws)}, "
        f"with the clearer ones fitted {search_p_text(one.p_beyond, draws)}"
    )


def _point(part: ShaftResidual, outlier: Outlier, still: bool) -> str:
    readings = part.fit.readings
    name = readings.grid.points.name[readings.row[outlier.row]]
    return (
        f"{name}: observed {readings.torque[outlier.row]:.4f}, fitted {part.fit.torque[outlier.row]:.4f} N m, "
        f"{outlier.surprise:+.1f} standard deviations, p {nominal_p_text(outlier.p_value)} over {outlier.looked_at} "
        "points" + ("" if still else "; not with the numbered covariates fitted")
    )


def _document(part: ShaftResidual) -> dict[str, Any]:
    """One fit on one shaft as JSON."""
    lack, readings = part.lack, part.fit.readings
    at = readings.grid.points
    return {
        "fit": part.fit.name,
        "shaft": part.shaft,
        "chi_square": number(lack.chi_square),
        "dof": number(lack.dof),
        "p_value": number(lack.p_value),
        "noise_Nm": number(lack.noise),
        "scatter_Nm": number(lack.scatter),
        "noise_source": lack.source,
        "noise_told": lack.description,
        "covariates": [_covariate(one) for one in part.followed],
        "outliers": [
            {
                "point": str(at.name[readings.row[outlier.row]]),
                "speed_sun_rad_s": float(at.speed_sun[readings.row[outlier.row]]),
                "speed_ring_rad_s": float(at.speed_ring[readings.row[outlier.row]]),
                "load_set_Nm": float(at.load_set[readings.row[outlier.row]]),
                "observed_Nm": float(readings.torque[outlier.row]),
                "fitted_Nm": float(part.fit.torque[outlier.row]),
                "surprise": outlier.surprise,
                "p_value": outlier.p_value,
                "looked_at": outlier.looked_at,
                "beside_covariates": still,
            }
            for outlier, still in part.outliers
        ],
        "not_tested": [{"id": name, "reason": reason} for name, reason in part.untested.items()],
    }


def _covariate(one: Followed) -> dict[str, Any]:
    return {
        "id": one.look.covariate.id,
        "configuration": one.look.family.configuration,
        "unit": one.look.covariate.unit or None,
        "size_Nm": one.size,
        "size_u_Nm": one.size_u,
        "size_of_noise_Nm": one.noise_size,
        "shape": [{"at": where, "drag_Nm": drag} for where, drag in one.shape],
        "p_value": one.p_value,
        "p_look_elsewhere": one.p_search,
        "same_trace": list(one.same_trace),
        "rank": one.rank,
        "p_beside_clearer": one.p_beyond,
    }
