"""Chapter on the data: what was recorded, what could not be used and why, how large the noise is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.chapters.measured.budget import budget_items
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.document import Column, Facts, Section, Table, Text
from pmg.pipeline.windows.reduce import UNCERTAINTY_SOURCE
from pmg.pipeline.windows.window_mean import BERGER_YANG
from pmg.sim import sources
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.budget import Budget
    from pmg.pipeline.fit.noise import ShaftNoise
    from pmg.pipeline.recording.origin import ImportRecord
    from pmg.sim.grid import Grid


def data_section(
    analysis: Analysis,
    note: str,
    findings: tuple[Remark, ...],
    budget: Budget | None = None,
    origins: tuple[tuple[str, ImportRecord], ...] = (),
) -> Section:
    """Recorded data, and the part of them that could be used.

    Parameters
    ----------
    analysis : Analysis
        The campaign.
    note : str
        What the user says of the data.
    findings : tuple of Remark
        What reading the recordings brought up, in the plain form of `Finding.to_dict`.
    budget : Budget, optional
        What the mean torques are uncertain by.
    origins : tuple of (file, mapping)
        What recordings were imported from, where they were.
    """
    items: list[Text | Facts | Table] = [_overview(analysis, note)]
    if analysis.floor is not None:
        items += [
            Text(
                "Noise of one point's mean torque. Scatter within a window is only part of it: between points the "
                "bench re-approaches its speed. Uncertainties in this report are standard uncertainties u; bars and "
                "statements of agreement use U = 2u."
            ),
            _noise_table(analysis.floor.sun, analysis.floor.ring),
        ]
    if budget is not None:
        items += budget_items(budget)
    items += _judged_windows(analysis.grid)
    if analysis.lacking:
        items.append(
            Table(
                id="holes",
                title="Holes in the grids",
                caption=f"{len(analysis.lacking)} cells of the test grid hold no accepted point.",
                columns=(Column("cell", "Cell"),),
                rows=tuple((cell,) for cell in analysis.lacking),
            )
        )
    if origins:
        items.append(_origins_table(origins))
    if findings:
        items.append(_findings_table(findings))
    items += [Text(f"Not done: {error}", kind="warning") for error in analysis.missing]
    used = (sources.GUM,) if budget is None or budget.facts is None else (sources.GUM, UNCERTAINTY_SOURCE, BERGER_YANG)
    return Section("data", "Data quality", tuple(items), used)


def _overview(analysis: Analysis, note: str) -> Facts:
    """Counts of the points, and what is known of the campaign as a whole."""
    grid, at = analysis.grid, analysis.grid.points
    kinds = f"{int(at.neutral.sum())} neutral, {int(at.engaged.sum())} engaged, {int(at.zero.sum())} zero checks"
    return Facts(
        (
            ("Campaign", grid.campaign),
            ("Points", f"{len(grid)}: {kinds}"),
            ("Note", note or "none"),
            ("Accepted", f"{int(grid.accepted.sum())} of {len(grid)}"),
            ("Holes in the grids", f"{len(analysis.lacking)}" if analysis.lacking else "none"),
            ("Order of the test", "known" if at.ordered else "not recorded"),
            ("Bearing temperature", "in no fit: what was recorded stands among the conditions"),
        )
    )


def _judged_windows(grid: Grid) -> list[Table]:
    """Tables of the rejected windows, and of those accepted with a remark; neither where there are none."""
    remarked = grid.accepted & (grid.reason != "")
    u = [within * 1e3 for within in (grid.within_sun, grid.within_ring)]
    u_columns = [Column(f"u_{shaft}", f"u {shaft}", "mN m", digits=2) for shaft in SIDES]
    tables = (
        (
            ~grid.accepted,
            ("rejected-windows", "Rejected windows"),
            f"{int((~grid.accepted).sum())} of {len(grid)} windows failed a check; they take no part in any fit.",
            [Column("reason", "Reason")],
            [grid.reason],
        ),
        (
            remarked,
            ("remarked-windows", "Accepted with a remark"),
            f"{int(remarked.sum())} of {int(grid.accepted.sum())} accepted windows are near a limit, hold slow "
            "noise, or end where data were lost; they count as the others do, with their own uncertainty.",
            [Column("reason", "Remark"), *u_columns],
            [grid.reason, *u],
        ),
    )
    return [
        Table(
            *called,
            caption,
            (Column("point", "Point"), *columns),
            tuple(zip(grid.points.name[which].tolist(), *(one[which].tolist() for one in values), strict=True)),
        )
        for which, called, caption, columns, values in tables
        if which.any()
    ]


def _origins_table(origins: tuple[tuple[str, ImportRecord], ...]) -> Table:
    """Sources of imported recordings: names of the files, and the source of each."""
    count = sum(origin.findings for _, origin in origins)
    return Table(
        id="imported",
        title="Imported recordings",
        caption=f"{len(origins)} recordings were made of files in other formats; reading those gave {count} findings.",
        columns=(
            Column("file", "Recording"),
            Column("source", "Source"),
            Column("format", "Format"),
            Column("reader", "Read by"),
            Column("size", "Bytes"),
            Column("sha256", "SHA-256"),
            Column("findings", "Findings", "", digits=0),
        ),
        rows=tuple(
            (
                file,
                *(origin.source, origin.format, origin.reader, origin.size, origin.sha256),
                float(origin.findings),
            )
            for file, origin in origins
        ),
    )


def _findings_table(findings: tuple[Remark, ...]) -> Table:
    """Table of the remarks on the recordings."""
    return Table(
        id="findings",
        title="Findings of the ingest",
        caption=f"{len(findings)} remarks about files, channels and samples. Stretches end before the second number.",
        columns=(
            Column("severity", "Severity"),
            Column("where", "Where"),
            Column("message", "What"),
            Column("bytes", "Bytes"),
            Column("samples", "Samples"),
            Column("kept", "Kept"),
            Column("lost", "Lost"),
        ),
        rows=tuple(_finding_row(finding.to_dict()) for finding in findings),
    )


def _finding_row(plain: Mapping[str, Any]) -> tuple[str, ...]:
    stretches = [" to ".join(map(str, plain.get(name, ()))) for name in ("byte_range", "sample_range")]
    where = f"{plain['file']}: {plain['where']}" if "file" in plain else plain["where"]
    message = f"{plain['message']}. {plain['do']}" if "do" in plain else plain["message"]
    return plain["severity"], where, message, *stretches, plain.get("kept", ""), plain.get("lost", "")


def _noise_table(sun: ShaftNoise, ring: ShaftNoise) -> Table:
    def row(shaft: str, noise: ShaftNoise) -> tuple[str | float | None, ...]:
        return (
            shaft,
            noise.u * 1e3,
            noise.within * 1e3,
            noise.repeats * 1e3,
            noise.repeats_dof,
            noise.unstructured * 1e3,
            noise.unstructured_dof,
            noise.correlation,
            noise.at(0.0) * 1e3,
            noise.at(noise.growth.fastest) * 1e3,
            noise.source,
        )

    return Table(
        id="noise-floor",
        title="Noise floor",
        caption=f"One point's mean is uncertain by {sun.u * 1e3:.2f} mN m (sun) and {ring.u * 1e3:.2f} mN m (ring).",
        columns=(
            Column("shaft", "Shaft"),
            Column("u", "u of a point", "mN m", digits=2),
            Column("within", "within the window", "mN m", digits=2),
            Column("repeats", "repeats", "mN m", digits=2),
            Column("repeats_dof", "dof", "", digits=0),
            Column("unstructured", "unstructured scatter", "mN m", digits=2),
            Column("unstructured_dof", "dof", "", digits=0),
            Column("correlation", "correlation of neighbours", "", digits=2),
            Column("at_rest", "u towards rest", "mN m", digits=2),
            Column("at_highest", "u at the highest speed", "mN m", digits=2),
            Column("source", "Taken from"),
        ),
        rows=(row("sun", sun), row("ring", ring)),
    )
