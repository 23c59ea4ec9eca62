"""The whole page: its head with the verdict, then chapters in the order in which an engineer asks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import TYPE_CHECKING, Literal

import numpy as np

from pmg.pipeline.analysis.power_flow import power_flows
from pmg.pipeline.analysis.tolerance import agreements
from pmg.pipeline.chapters.arrange import arranged
from pmg.pipeline.chapters.bench_parts import asked_of
from pmg.pipeline.chapters.explained.action_sheet import action_sheet
from pmg.pipeline.chapters.explained.detectability import audit_section
from pmg.pipeline.chapters.explained.extended_model import ends_table, prediction_table
from pmg.pipeline.chapters.explained.verdict import diagnosis_section
from pmg.pipeline.chapters.measured.conditions import conditions_section, grids_section
from pmg.pipeline.chapters.measured.efficiency import efficiency_section, speed_ratio_section
from pmg.pipeline.chapters.measured.flow import flow_section
from pmg.pipeline.chapters.measured.loss_parts import loss_parts_figure
from pmg.pipeline.chapters.measured.losses import losses_section
from pmg.pipeline.chapters.measured.neutral import neutral_section
from pmg.pipeline.chapters.measured.quality import data_section
from pmg.pipeline.chapters.measured.sensor_fault import highest_loss, sensor_fault_items
from pmg.pipeline.chapters.measured.torque_map import torque_map_sections
from pmg.pipeline.chapters.simulated.by_load import by_load_figures
from pmg.pipeline.chapters.simulated.comparison import comparison_section
from pmg.pipeline.chapters.studies.printed_simulation import printed_simulation_sections
from pmg.pipeline.chapters.with_cause import behind_points, simulate_twice, with_switch
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.remedy import bench_action
from pmg.pipeline.diagnosis.grid.statement import statement
from pmg.pipeline.grid.conditions import conditions
from pmg.pipeline.grid.crosschecks.contradiction import CrossCheckRemark
from pmg.pipeline.grid.readings import predict
from pmg.pipeline.model.apply_model import lead
from pmg.pipeline.report.document import Caution, Facts, Headline, Report, Section, Signals, Table, Text
from pmg.pipeline.thesis_figures.printed_simulation import oddities
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.units import MILLI
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.analysis.power_flow import Flow
    from pmg.pipeline.analysis.tolerance import Agreements, Tolerance
    from pmg.pipeline.chapters.with_cause import SimulatedTwice
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.budget import Budget
    from pmg.pipeline.fit.losses import PowerBalance
    from pmg.pipeline.grid.conditions import Conditions
    from pmg.pipeline.model.compared_campaign import ComparedCampaign
    from pmg.pipeline.model.sensor_fault_correction import CorrectedLosses
    from pmg.pipeline.point_signals.encoded import Encoded
    from pmg.pipeline.recording.origin import ImportRecord
    from pmg.pipeline.recording.remark import Remark
    from pmg.sim.bench import BenchParameters

PACKAGES = ("pmg-bench", "numpy", "scipy", "pandas", "polars", "mcap", "matplotlib")
"""Distributions whose versions the report names."""


def versions(packages: tuple[str, ...]) -> str:
    """Distributions and their versions, in one line."""
    return ", ".join(f"{name} {version(name)}" for name in packages)


@dataclass(frozen=True)
class RecordedFacts:
    """What a report tells of the recordings behind a grid.

    Parameters
    ----------
    findings : tuple of Remark
        Remarks of the ingest.
    origins : tuple of (file, mapping)
        What recordings were imported from, where they were.
    conditions : Conditions, optional
        Under which conditions the campaign was run.
    budget : Budget, optional
        What the mean torques are uncertain by.
    orders : Section, optional
        What repeats with the turn of a shaft, where the ingest kept it.
    signals : Encoded, optional
        The signals behind the points of the grid.
    """

    findings: tuple[Remark, ...] = ()
    origins: tuple[tuple[str, ImportRecord], ...] = ()
    conditions: Conditions | None = None
    budget: Budget | None = None
    orders: Section | None = None
    signals: Encoded | None = None


def build_report(
    analysis: Analysis,
    judged: ComparedCampaign | None,
    bench: BenchParameters,
    recorded: RecordedFacts,
    *,
    note: str,
    provenance: tuple[tuple[str, str], ...],
    tolerances: Mapping[str, Tolerance] | None = None,
    faults: tuple[CorrectedLosses, ...] = (),
) -> Report:
    """The report of one campaign, as far as its analysis reached.

    Parameters
    ----------
    analysis : Analysis
        Grids, fits, balance.
    judged : ComparedCampaign or None
        What it says about the simulator.
    bench : BenchParameters
        Motor constants for the power flow.
    recorded : RecordedFacts
        What is known of the recordings.
    note : str
        What the reader must know about the data, such as that they are synthetic; may be empty.
    provenance : tuple of (label, value)
        Inputs, hashes, seed, command.
    tolerances : mapping, optional
        Tolerances that were set for the comparison, by quantity.
    faults : tuple of CorrectedLosses
        The losses without a fault of a reading, under each explanation that has one.
    """
    diagnosis, carried, ends = (None, None, ()) if judged is None else (judged.diagnosis, judged.carried, judged.ends)
    sheet, before = None, "" if carried is None else lead(carried)
    twice = simulate_twice(judged, analysis.calibration, bench)
    sections: list[Section] = [
        conditions_section(recorded.conditions or conditions(()), note),
        grids_section(analysis.grid, opens=recorded.signals is not None),
    ]
    left = analysis if carried is None else carried.analysis
    corrected = () if analysis.balance is None else sensor_fault_items(faults, analysis.balance)
    if analysis.fits is not None:
        sections.append(neutral_section(analysis, analysis.fits))
    if analysis.balance is not None and analysis.calibration is not None:
        sections.append(_behind(losses_section(analysis, analysis.balance, analysis.calibration), corrected))
        sections.append(_behind(_efficiency(analysis.balance, twice), corrected[:1]))
        if analysis.grid.origin != "published":  # its speeds are those that were set
            sections.append(speed_ratio_section(analysis.balance, bench))
    flows = _flows(analysis, twice, bench)
    if twice is not None and flows:
        gearbox = twice.boxes[0][1]
        sections.extend(torque_map_sections(gearbox, flows[0].grid))
        sections.append(_behind(flow_section(flows, (loss_parts_figure(gearbox, flows[0]),)), corrected[:1]))
    agreed = None if twice is None else agreements(twice.plain, bench, tolerances)
    if twice is not None:
        of_model = (() if carried is None else (prediction_table(carried),)) + ((ends_table(ends),) if ends else ())
        more = (*of_model, *(by_load_figures(analysis.balance, flows) if analysis.balance and flows else ()))
        sections.append(with_switch(lambda of: comparison_section(of, agreements(of, bench, tolerances), more), twice))
    sections += (*printed_simulation_sections(analysis.grid), *(() if recorded.orders is None else (recorded.orders,)))
    if diagnosis is not None and left.calibration is not None:
        readings = diagnosis.mismatch.readings
        residual = readings.torque - predict(readings, bench, left.calibration.model)
        costs, first = highest_loss(faults, analysis.balance), _unsettled(recorded.findings)
        sheet = action_sheet(diagnosis, residual, before, costs, first)
        sections.append(diagnosis_section(diagnosis, residual))
        sections += () if diagnosis.audit is None else (audit_section(diagnosis.audit),)
    if analysis.grid.origin == "published":
        from pmg.pipeline.chapters.studies.validation import published_sections

        sections.extend(published_sections(analysis.grid, bench))
    sections.append(data_section(analysis, note, recorded.findings, recorded.budget, recorded.origins))
    return Report(
        title=f"Campaign {analysis.grid.campaign}",
        subtitle=note or "Planetary magnetic gearbox: recordings, losses, simulation and what explains the difference",
        verdict=_verdict(analysis, diagnosis, before, agreed, faults, recorded),
        sections=arranged(tuple(sections)),
        provenance=Facts((*provenance, ("Versions", versions(PACKAGES)))),
        signals=_signals(recorded.signals, twice, agreed),
        sheet=sheet,
        switch="" if twice is None else f"Simulate {twice.boxes[-1][0]}",
    )


def _flows(analysis: Analysis, twice: SimulatedTwice | None, bench: BenchParameters) -> tuple[Flow, ...]:
    """The power flows; none where nothing was compared."""
    if twice is None or analysis.calibration is None or analysis.causes is None:
        return ()
    behind = twice.plain.simulated, bench, analysis.calibration, analysis.causes
    return power_flows(twice.boxes[0][1], twice.plain.grid, *behind)


def _efficiency(balance: PowerBalance, twice: SimulatedTwice | None) -> Section:
    """The chapter on efficiency, with the simulated ones where there are any."""
    if twice is None:
        return efficiency_section(balance, None)
    return with_switch(lambda of: efficiency_section(balance, of), twice)


def _signals(signals: Encoded | None, twice: SimulatedTwice | None, agreed: Agreements | None) -> Signals | None:
    """The signals behind the points, with what is simulated there."""
    if signals is None:
        return None
    simulated = "" if twice is None or agreed is None else behind_points(twice, agreed)
    return Signals(signals.index_json, signals.base64, simulated)


def _contradictions(findings: tuple[Remark, ...]) -> list[str]:
    """What the cross-checks found, a line for each check: the first in full, how many more there are."""
    by_check: dict[str, list[CrossCheckRemark]] = {}
    for finding in findings:
        if isinstance(finding, CrossCheckRemark):
            by_check.setdefault(finding.check, []).append(finding)
    return [
        f"{found[0].place}: {found[0].message}" + (f" ({len(found) - 1} more in data quality)" if found[1:] else "")
        for found in by_check.values()
    ]


def _unsettled(findings: tuple[Remark, ...]) -> tuple[str, ...]:
    """What to do about each contradiction of the campaign as a whole."""
    return tuple(each.settle for each in findings if isinstance(each, CrossCheckRemark) and each.settle)


def _behind(section: Section, first: tuple[Text | Table, ...]) -> Section:
    """The section with some items before its own."""
    return replace(section, items=(*first, *section.items))


def _verdict(
    analysis: Analysis,
    diagnosis: Diagnosis | None,
    before: str,
    agreed: Agreements | None,
    faults: tuple[CorrectedLosses, ...],
    recorded: RecordedFacts,
) -> Headline:
    grid = analysis.grid
    warnings = []
    rejected = int((~grid.accepted).sum())
    if rejected:
        warnings.append(Caution(f"{counted(rejected, 'point')} rejected.", "rejected-windows"))
    if analysis.lacking:
        warnings.append(Caution(f"{counted(len(analysis.lacking), 'cell')} of the grids empty.", "holes"))
    warnings += [Caution(text, "data") for text in _contradictions(recorded.findings)]
    warnings += [Caution(*odd) for odd in oddities(grid)]
    above = 0 if analysis.balance is None else int(analysis.balance.above_one().sum())
    zeros = int(grid.points.zero.sum())
    checks = f" ({counted(zeros, 'zero check')})" if zeros else ""
    if not zeros and grid.origin != "published":
        checks = " (no zero check)"
    figures = [("Points accepted", f"{int(grid.accepted.sum())} of {len(grid)}{checks}")]
    if agreed is not None:
        out = int(agreed.compared.sum()) - int(agreed.within.sum())
        figures.append((f"Out of tolerance{_least_bounds(agreed)}", f"{out} of {int(agreed.compared.sum())}"))
    if diagnosis is None:
        reason = str(analysis.missing[0]) if analysis.missing else ""
        text = f"No comparison was possible. {reason}".strip()
        return Headline(text, "attention", tuple(figures), tuple(warnings))
    state: Literal["good", "attention"] = (
        "attention" if diagnosis.verdict != "consistent" or warnings or above or faults else "good"
    )
    test = bool(diagnosis.next_tests) or diagnosis.verdict is Verdict.CONFOUNDED
    asks = "" if state == "good" else asked_of(diagnosis.verdict, repair=bool(bench_action(diagnosis)), test=test)
    return Headline(before + statement(diagnosis), state, tuple(figures), tuple(warnings), asks)


def _least_bounds(agreed: Agreements) -> str:
    """From what difference on a torque is out of tolerance, by shaft, in brackets; empty where none is compared."""
    judged = {side: agreed.of[f"torque_{side}"] for side in SIDES}
    if not all(each.compared.any() for each in judged.values()):
        return ""
    least = (f"{side} {np.min(each.bound[each.compared]) / MILLI:.3g}" for side, each in judged.items())
    return f" ({', '.join(least)} mN m)"
