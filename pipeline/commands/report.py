"""The stage behind pmg report: two campaigns side by side."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.analysis.outputs import unproven_analysis
from pmg.pipeline.campaign_comparison.constants import constant_differences, curve_differences
from pmg.pipeline.campaign_comparison.difference import subtract
from pmg.pipeline.campaign_comparison.document import kinds_compared, mean_document, versus_document
from pmg.pipeline.campaign_comparison.matching import Reach
from pmg.pipeline.campaign_comparison.side import read_side
from pmg.pipeline.campaign_comparison.statement import statement
from pmg.pipeline.campaign_comparison.transducers import Transducers
from pmg.pipeline.campaign_comparison.verdict import PERMUTATION_SEED, judge
from pmg.pipeline.chapters.campaigns.page import versus_report
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_two, now
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.write import write_report
from pmg.pipeline.settings.bench_in_force import bench_of_store
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import StoreError
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from pmg.pipeline.campaign_comparison.difference import Versus
    from pmg.pipeline.campaign_comparison.side import CampaignSide
    from pmg.pipeline.campaign_comparison.verdict import ComparisonVerdict
    from pmg.pipeline.commands.provenance import Clock

FILE = "versus.json"


def _two(stores: Sequence[Path]) -> tuple[Path, Path]:
    """The two stores of a call.

    Raises
    ------
    StoreError
        There are more, or fewer.
    """
    if len(stores) != 2:
        more = "Compare them in pairs, each against the same A." if len(stores) > 2 else "Name A and B."
        raise StoreError("pmg report", counted(len(stores), "store"), "two: A and B", more)
    return stores[0], stores[1]


def run_report(
    stores: Sequence[Path],
    report: Path,
    *,
    campaigns: tuple[str | None, str | None] = (None, None),
    reach: Reach | None = None,
    transducers: Transducers = Transducers.AUTO,
    note: str = "",
    clock: Clock = now,
) -> Outcome:
    """Match and subtract two analysed campaigns, judge the difference, write the report and ``versus.json``.

    Parameters
    ----------
    stores : sequence of Path
        The two stores with the analyses; one and the same where it holds both campaigns.
    report : Path
        Folder of the report.
    campaigns : (str or None, str or None)
        Which campaign of each store; the analysed one where it is not given.
    reach : Reach, optional
        How far apart two points may lie and still be the same test.
    transducers : Transducers
        ``same`` or ``different`` where that is known better than from the calibrations; else ``auto``.
    note : str
        Told at the head of the report.
    clock : callable
        Time of day, for the provenance.

    Raises
    ------
    StoreError
        A store lacks what is needed, or there are not two.
    """
    began = clock()
    a, b = (read_side(*side, bench_of_store(side[1])) for side in zip("AB", _two(stores), campaigns, strict=True))
    versus = subtract(a, b, reach or Reach(), transducers)
    judged = judge(versus, np.random.default_rng(PERMUTATION_SEED))
    constants = constant_differences(versus)
    page = versus_report(
        versus,
        judged,
        constants,
        curve_differences(versus),
        note=note,
        provenance=(*_provenance(a), *_provenance(b), ("Seed of the synthetic pairs", str(PERMUTATION_SEED))),
    )
    document = versus_document(versus, judged, constants)
    files = write_report(page, report, {"points": _points(versus)})
    path = report / FILE
    write_atomic(path, (json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n").encode())
    crate = leave_crate_of_two((*files, path), ((stores[0], a.grid), (stores[1], b.grid)), "pmg report", began, clock)
    data = {name: value for name, value in document.items() if name != "points"}
    data |= {"report": str(files[0]), "files": [str(file) for file in (*files, path, crate)]}
    return Outcome(
        data,
        tuple(_lines(versus, judged, files[0])),
        (
            *(remark for store in stores for remark in unproven_analysis(store)),
            *_two_machines(stores),
            *_findings(versus),
        ),
        partial=judged is not None and bool(a.analysis.missing or b.analysis.missing),
        mismatch=judged is not None and judged.differ,
        failed=judged is None,
    )


def _two_machines(stores: Sequence[Path]) -> Iterator[Remark]:
    """A warning where the stores were made with different machines."""
    if bench_of_store(stores[0]) != bench_of_store(stores[1]):
        message = "the stores were made with different machines: differences are those of the machines too"
        yield Remark("warning", "A and B", message)


def _points(versus: Versus) -> dict[str, int]:
    matching = versus.matching
    return {"matched": len(matching), "only_a": len(matching.only_a), "only_b": len(matching.only_b)}


def _lines(versus: Versus, judged: ComparisonVerdict | None, page: Path) -> Iterator[str]:
    yield statement(versus, judged)
    reach, count = versus.matching.reach, _points(versus)
    yield (
        f"matched: {counted(count['matched'], 'point')} within {reach.speed / RPM:g} rpm and {reach.load:g} N m; "
        f"{count['only_a']} only in {versus.a.name}, {count['only_b']} only in {versus.b.name}"
    )
    yield f"transducers: {versus.shared.description}"
    for name, kind in kinds_compared(versus):
        if kind == "engaged" and name in ("loss_total", "loss_magnetic"):
            mean = mean_document(versus, name, kind)
            u = 2.0 * float(np.hypot(mean["u_independent"], mean["u_common"]))
            yield (
                f"{name.replace('_', ' ')}, B - A: {mean['mean']:.3f} W, U {u:.3f} W "
                f"({2.0 * mean['u_independent']:.3f} W without what all points share), "
                f"{mean['beyond_U']} of {mean['points']} points beyond U"
            )
    yield f"report: {page}"


def _findings(versus: Versus) -> Iterator[Remark]:
    """Remarks on a comparison of two campaigns."""
    for side, left in ((versus.a, versus.matching.only_a), (versus.b, versus.matching.only_b)):
        if left:
            names = ", ".join(str(side.grid.points.name[one.row]) for one in left[:5])
            more = " ..." if len(left) > 5 else ""
            message = f"{counted(len(left), 'point')} without a partner: {names}{more}"
            yield Remark("warning", side.name, message)
        for error in side.analysis.missing:
            yield Remark("warning", f"{side.name}, {error.where}", error.advice)
        if side.grid.origin != "published" and not (side.grid.points.zero & side.grid.accepted).any():
            message = "no zero check was accepted: by how much its zero was off is not known, and not in U"
            yield Remark("warning", side.name, message)
        if side.grid.origin == "published":
            message = (
                f"published grid, torques rounded to {side.grid.rounding:g} N m: the rounding is in its uncertainty, "
                "no time and no transducers are known"
            )
            yield Remark("warning", side.name, message)
    if versus.in_both:
        yield Remark(
            "warning", "A and B", f"{versus.in_both}; there, differences are those of two analyses of one test"
        )
    if len(versus.matching) and not versus.corrected:
        message = "no campaign has loss curves: speeds and loads that differ within the tolerances are not corrected"
        yield Remark("warning", "set-points", message)


def _provenance(side: CampaignSide) -> list[tuple[str, str]]:
    grid = side.grid
    rows = [(f"{side.label}, campaign", f"{grid.campaign} ({grid.origin})")]
    if side.manifests:
        digest = hashlib.sha256("".join(sorted(side.contents)).encode()).hexdigest()
        rows.append((f"{side.label}, recordings", str(len(side.manifests))))
        rows.append((f"{side.label}, SHA-256 over the sorted SHA-256 of the recordings", digest))
    options = side.analysis.options
    curves = ", ".join(
        f"{shaft} {' '.join(f'{p:g}' for p in powers)}"
        for shaft, powers in (("sun", options.powers_sun), ("ring", options.powers_ring))
    )
    rows.append((f"{side.label}, terms of the loss curves", curves))
    rows.append((f"{side.label}, K_corr", options.correction))
    return rows
