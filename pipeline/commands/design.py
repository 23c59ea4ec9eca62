"""The stage behind ``pmg design``: what a campaign, run or planned, can tell apart."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pmg.pipeline.analysis.outputs import read_analysis, unproven_analysis
from pmg.pipeline.chapters.explained.detectability import audit_section
from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_files, now, went_in
from pmg.pipeline.diagnosis.design.audit import RESEMBLING, audit_design
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.grid.campaign import recorded_bench
from pmg.pipeline.model.read_model import read_model
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.document import Facts, Headline, Report
from pmg.pipeline.report.write import write_report
from pmg.pipeline.settings.bench_in_force import bench_in_force
from pmg.pipeline.simulate.inputs import loss_model, unproven_losses
from pmg.pipeline.simulate.planned import planned_floor, planned_grid
from pmg.pipeline.simulate.scenario_file import read_scenario
from pmg.sim.errors import BenchError
from pmg.sim.signals import MINUTE

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.commands.crate import SourceFile
    from pmg.pipeline.diagnosis.design.audit import Audit, LookAlike, Visibility


def run_design(
    plan: Path | None,
    store: Path | None,
    report: Path | None = None,
    model_file: Path | None = None,
    machine: str | None = None,
) -> Outcome:
    """Audit the points of an analysed campaign, or of a plan.

    Parameters
    ----------
    plan : Path, optional
        TOML file with a ``[plan]`` table and a source of losses.
    store : Path, optional
        Store with an analysis.
    report : Path, optional
        Folder of a report; none is written when not given.
    model_file : Path, optional
        A model whose baseline the effects are taken about, instead of the plan's losses or the store's calibration.
        Its mechanisms are not counted as known: the audit asks whether these points would show them.
    machine : str, optional
        Machine file, or the name of one that ships; that of the store by default, or the thesis bench.
    """
    if (plan is None) == (store is None):
        came = "neither" if plan is None else "both"
        raise BenchError("PLAN and --store", came, "one of them", "Name a plan, or a store with an analysed campaign.")
    began = now()
    taken: tuple[Path | SourceFile, ...] = () if plan is None else (plan,)
    bench = bench_in_force(store, machine)
    remarks: tuple[Remark, ...] = ()
    whole = None if model_file is None else read_model(model_file)
    if plan is not None:
        file = read_scenario(plan, "a plan")
        if file.table.plan is None:
            raise BenchError(str(plan), "no [plan]", "a table [plan]", "Add one.")
        model = loss_model(file, bench) if whole is None else whole.baseline
        remarks = unproven_losses(file) if whole is None else ()
        if model is None:
            raise BenchError(f"{plan}: losses", "none", "losses to take effects about", "Name grids or an analysis.")
        grid, floor = planned_grid(file.table.plan, bench), planned_floor(file.table.plan)
        name = f"plan {plan.stem}"
    else:
        assert store is not None  # one of the two is given
        measured, options = read_analysis(store)
        bench, remarks = recorded_bench(store, measured, bench)
        remarks = unproven_analysis(store) + remarks
        analysis = analyse(measured, options, bench)
        if analysis.calibration is None or analysis.floor is None:
            return Outcome({}, (), remarks, refusal=analysis.missing[0])
        grid, floor, model = analysis.grid, analysis.floor, analysis.calibration.model
        name, taken = f"campaign {grid.campaign}", went_in(store, grid)
    model = model if whole is None else whole.baseline
    audit = audit_design(grid, bench, model, floor)
    data: dict[str, Any] = {
        "of": name,
        "points": len(grid),
        "noise_Nm": {"sun": floor.sun.u, "ring": floor.ring.u},
        "mechanisms": [_visible(row) for row in audit.visible],
        "look_alikes": [_alike(pair) for pair in audit.alike],
        "told_apart": [_pair(pair) for pair in audit.apart],
        "report": None,
    }
    lines = [*_lines(audit)]
    if report is not None:
        page = Report(
            title=f"What {name} can tell apart",
            subtitle=f"{len(grid)} points, audited from their design and noise alone",
            verdict=Headline(audit_words(audit), "attention" if audit.alike else "good"),
            sections=(audit_section(audit),),
            provenance=Facts((("Of", name), ("Versions", versions(PACKAGES)))),
        )
        files = write_report(page, report)
        leave_crate_of_files(report, "pmg design", taken, files, began)
        data["report"] = str(files[0])
        lines.append(f"report: {files[0]}")
    return Outcome(data, tuple(lines), remarks)


def audit_words(audit: Audit) -> str:
    """Result of an audit, in a sentence."""
    unseen = [f"{row.candidate.identifier} ({row.candidate.shaft})" for row in audit.visible if row.unseen]
    hidden = f"cannot be seen at any size: {', '.join(unseen)}" if unseen else "every mechanism can be seen"
    n = len(audit.alike)
    pairs = f"{n} pair{'s' if n > 1 else ''} cannot be separated" if n else "all of them can be separated"
    return f"Of the catalogue, {hidden}; {pairs}."


def _lines(audit: Audit) -> list[str]:
    rows = [f"{'mechanism':<34}{'shaft':<6}{'absorbed':>9}{'50 % [mN m]':>13}{'95 % [mN m]':>13}"]
    for row in audit.visible:
        sizes = ("-", "-") if row.unseen else (f"{row.size_50 * 1e3:.2f}", f"{row.size_95 * 1e3:.2f}")
        rows.append(
            f"{row.candidate.identifier:<34}{row.candidate.shaft:<6}{100.0 * row.absorbed:>8.1f}%"
            f"{sizes[0]:>13}{sizes[1]:>13}"
        )
    for pair in audit.alike:
        test = (
            "no known test tells"
            if pair.plan is None
            else (f"{pair.plan.experiment}, {pair.plan.seconds / MINUTE:.0f} min, power {pair.power:.0%}")
        )
        rows.append(
            f"cannot be separated (correlation {pair.correlation:.3f}): {pair.one.identifier} ({pair.one.shaft}) and "
            f"{pair.other.identifier} ({pair.other.shaft}); {test}"
        )
    if audit.resembling:
        near = audit.resembling[0]
        rows.append(
            f"separable, but with a correlation of {RESEMBLING:g} or more: {len(audit.resembling)} pairs, "
            f"closest ({near.correlation:.3f}) {near.one.identifier} ({near.one.shaft}) and "
            f"{near.other.identifier} ({near.other.shaft})"
        )
    return [*rows, audit_words(audit)]


def _visible(row: Visibility) -> dict[str, Any]:
    names = [parameter.name for parameter in row.candidate.parameters]
    return {
        "id": row.candidate.identifier,
        "shaft": row.candidate.shaft,
        "absorbed": row.absorbed,
        "seen": not row.unseen,
        "size_50_Nm": row.size_50 if math.isfinite(row.size_50) else None,
        "size_95_Nm": row.size_95 if math.isfinite(row.size_95) else None,
        "parameters_50": dict(zip(names, map(float, row.values_50), strict=True)),
    }


def _alike(pair: LookAlike) -> dict[str, Any]:
    return {
        **_pair(pair),
        "test": None if pair.plan is None else pair.plan.description,
        "minutes": None if pair.plan is None else pair.plan.seconds / MINUTE,
        "power": pair.power,
    }


def _pair(pair: LookAlike) -> dict[str, Any]:
    return {
        "ids": [pair.one.identifier, pair.other.identifier],
        "shafts": [pair.one.shaft, pair.other.shaft],
        "correlation": pair.correlation,
    }
