"""The stage behind ``pmg validate``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.chapters.studies.validation import sections_of
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_files, now
from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.document import Facts, Headline, Report
from pmg.pipeline.report.write import write_report
from pmg.pipeline.store.sources import PUBLISHED
from pmg.pipeline.thesis_figures import verdict
from pmg.pipeline.thesis_figures.compared import compared_figures
from pmg.pipeline.thesis_figures.listing import documents, failed_draws, judged_words, summary, table_lines
from pmg.pipeline.thesis_figures.rounding import DRAWS, ROUNDING_SEED
from pmg.pipeline.thesis_figures.transient import transient_documents, transient_lines
from pmg.sim.bench import load_bench

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.thesis_figures.compared import ComparedFigures
    from pmg.pipeline.thesis_figures.verdict import JudgedFigure


def run_validate(grids: Path, draws: int | None = None, seed: int | None = None, report: Path | None = None) -> Outcome:
    """Compute every published figure from the published grids, and say whether it comes out.

    Parameters
    ----------
    grids : Path
        Folder of the published grids.
    draws : int, optional
        Draws within the rounding of the tables; `DRAWS` when not given.
    seed : int, optional
        Seed of the draws; `ROUNDING_SEED` when not given.
    report : Path, optional
        Folder of a report; none is written when not given.
    """
    began = now()
    draws, seed = DRAWS if draws is None else draws, ROUNDING_SEED if seed is None else seed
    bench = load_bench()
    grid = read_published(grids, bench)
    figures = compared_figures(grid, bench, draws, seed)
    judged, runs = figures.judged, figures.runs
    counts = verdict.count(judged)
    digests = {name: sha256_of(grids / name) for name in PUBLISHED}
    data: dict[str, Any] = {
        "draws": draws,
        "draws_failed": judged[0].failed,
        "seed": seed,
        "sha256": digests,
        "counts": {str(name): n for name, n in counts.items()},
        "figures": documents(judged),
        "report": None,
    }
    data["transient"] = transient_documents(runs)
    lines = [*table_lines(judged), *transient_lines(runs), "", f"{summary(judged)} ({draws} draws, seed {seed})"]
    lines += [failed] if (failed := failed_draws(judged)) else []
    if report is not None:
        files = write_report(_page(figures, digests), report)
        leave_crate_of_files(report, "pmg validate", tuple(grids / name for name in PUBLISHED), files, began)
        data |= {"report": str(files[0]), "files": [str(path) for path in files]}
        lines.append(f"report: {files[0]}")
    return Outcome(
        data,
        tuple(lines),
        _findings(judged),
        mismatch=bool(counts[verdict.FigureVerdict.NOT_EXPLAINED]),
    )


def _findings(judged: tuple[JudgedFigure, ...]) -> tuple[Remark, ...]:
    """Every figure that rounding does not explain, or that hangs on what the source states twice."""
    which = verdict.FigureVerdict
    kinds = (which.NOT_EXPLAINED, which.OTHER_CONSTANT, which.INCONSISTENT)
    return tuple(
        Remark(
            "info",
            j.figure.id,
            f"{j.figure.what}: {j.figure.text} {j.figure.unit.name}".rstrip() + f" is {judged_words(j)}",
        )
        for j in judged
        if j.verdict in kinds
    )


def _page(figures: ComparedFigures, digests: dict[str, str]) -> Report:
    return Report(
        title="Published figures",
        subtitle="Planetary magnetic gearbox: the thesis's figures, computed anew from its rounded grids",
        verdict=Headline(f"{summary(figures.judged)}.", "neutral"),
        sections=sections_of(figures),
        provenance=Facts(
            (*((f"SHA-256 of {name}", d) for name, d in digests.items()), ("Versions", versions(PACKAGES)))
        ),
    )
