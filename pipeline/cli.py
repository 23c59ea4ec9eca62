"""The command line: ``pmg ingest``, ``analyse``, ``compare`` and ``run``. Each command parses, calls verbs, prints."""

from __future__ import annotations

import json
import os
import sys
import traceback
from contextlib import contextmanager
from enum import IntEnum, StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pmg.sim.errors import PmgError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pmg.pipeline.options import AnalysisOptions
    from pmg.pipeline.stages import Outcome

SCHEMA = "pmg.result/1"


class ExitCode(IntEnum):
    """What the exit code says."""

    DONE = 0
    FINDINGS = 1
    COULD_NOT_RUN = 2
    PARTLY_DONE = 3
    INTERNAL_ERROR = 70
    INTERRUPTED = 130


class FailOn(StrEnum):
    """What makes a finished command exit with 1."""

    NEVER = "never"
    MISMATCH = "mismatch"
    FINDINGS = "findings"


app = typer.Typer(
    help="From recordings of a planetary magnetic gearbox to losses, a simulation beside them, and what explains "
    "the difference.",
    epilog="Exit codes: 0 done, 1 done with findings under --fail-on, 2 could not run, 3 partly done (run again to "
    "resume), 70 internal error, 130 interrupted.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Recordings = Annotated[Path, typer.Argument(help="Folder of .mcap recordings, or one file.", metavar="RECORDINGS")]
StoreOption = Annotated[Path, typer.Option("--store", help="Folder of decoded runs and results; made if absent.")]
ReportOption = Annotated[Path, typer.Option("--report", help="Folder of report.html, figures, tables, diagnosis.json.")]
GridsOption = Annotated[
    Path | None, typer.Option("--grids", help="Folder with neutral_grid.csv and engaged_grid.csv, instead.")
]
CampaignOption = Annotated[str | None, typer.Option("--campaign", help="Which campaign, if the store holds several.")]
TermsSun = Annotated[
    str | None, typer.Option("--terms-sun", help="Powers of speed in the sun's loss curve, such as 0,1/2,1,2.")
]
TermsRing = Annotated[str | None, typer.Option("--terms-ring", help="The same for the ring.")]
CorrectionOption = Annotated[
    str | None,
    typer.Option("--k-corr", help="Correction factor: joint (fitted), rule (largest plausible), or a number."),
]
RestOption = Annotated[
    bool | None, typer.Option("--include-rest/--exclude-rest", help="Use readings of resting shafts in the curves.")
]
NoteOption = Annotated[str, typer.Option("--note", help="Told at the head of the report, such as where data are from.")]
WorkersOption = Annotated[int | None, typer.Option("--workers", min=1, help="Parallel workers of the ingest.")]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")]
FailOnOption = Annotated[FailOn, typer.Option("--fail-on", help="Exit with 1 on a mismatch, or on any finding.")]


@app.command()
def ingest(
    recordings: Recordings,
    store: StoreOption,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Decode recordings into the store: torque [N m] and angle [rad] per run, windows judged, findings kept."""

    def stage() -> Outcome:
        from pmg.pipeline.stages import run_ingest

        with _progress(as_json) as progress:
            return run_ingest(recordings, store, workers=workers, progress=progress)

    _carry_out("ingest", stage, as_json, fail_on)


@app.command()
def analyse(
    store: StoreOption,
    grids: GridsOption = None,
    campaign: CampaignOption = None,
    terms_sun: TermsSun = None,
    terms_ring: TermsRing = None,
    k_corr: CorrectionOption = None,
    include_rest: RestOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Average windows into neutral and engaged grids, fit losses, calibrate, balance powers."""

    def stage() -> Outcome:
        from pmg.pipeline.stages import run_analyse

        options = _options(grids, terms_sun, terms_ring, k_corr, include_rest)
        return run_analyse(store, options, grids=grids, campaign=campaign)

    _carry_out("analyse", stage, as_json, fail_on)


@app.command()
def compare(
    store: StoreOption,
    report: ReportOption,
    note: NoteOption = "",
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Set the simulator beside the bench, say whether and where they differ, and write the report."""

    def stage() -> Outcome:
        from pmg.pipeline.stages import run_compare

        return run_compare(store, report, note)

    _carry_out("compare", stage, as_json, fail_on)


@app.command()
def run(
    store: StoreOption,
    report: ReportOption,
    recordings: Annotated[
        Path | None, typer.Argument(help="Folder of .mcap recordings, or one file.", metavar="[RECORDINGS]")
    ] = None,
    grids: GridsOption = None,
    campaign: CampaignOption = None,
    terms_sun: TermsSun = None,
    terms_ring: TermsRing = None,
    k_corr: CorrectionOption = None,
    include_rest: RestOption = None,
    note: NoteOption = "",
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Ingest, analyse and compare in one go; or analyse and compare published grids (--grids)."""

    def stage() -> Outcome:
        from pmg.pipeline.stages import run_all

        options = _options(grids, terms_sun, terms_ring, k_corr, include_rest)
        with _progress(as_json) as progress:
            return run_all(
                recordings,
                store,
                report,
                options,
                grids=grids,
                campaign=campaign,
                note=note,
                workers=workers,
                progress=progress,
            )

    _carry_out("run", stage, as_json, fail_on)


def _options(
    grids: Path | None, terms_sun: str | None, terms_ring: str | None, k_corr: str | None, include_rest: bool | None
) -> AnalysisOptions:
    from pmg.pipeline.options import chosen_options

    return chosen_options(
        published=grids is not None,
        terms_sun=terms_sun,
        terms_ring=terms_ring,
        correction=k_corr,
        include_rest=include_rest,
    )


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[int, int, str], None]]:
    """A progress line on standard error: rewritten on a terminal, one line a tenth elsewhere."""
    terminal = sys.stderr.isatty()
    shown = -1

    def show(done: int, total: int, name: str) -> None:
        nonlocal shown
        step = done if terminal else (10 * done) // max(total, 1)
        if step == shown or (quiet and not terminal):
            return
        shown = step
        text = f"ingest {done}/{total} {name}"
        sys.stderr.write(f"\r\x1b[K{text}" if terminal else f"{text}\n")
        sys.stderr.flush()

    try:
        yield show
    finally:
        if terminal and shown >= 0:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()


def _carry_out(command: str, stage: Callable[[], Outcome], as_json: bool, fail_on: FailOn) -> None:
    """Run a stage, print what it gave, and exit with the code that says how it went."""
    outcome: Outcome | None = None
    error: dict[str, str] | None = None
    try:
        outcome = stage()
        code = _exit_code(outcome, fail_on)
    except PmgError as problem:
        code = ExitCode.COULD_NOT_RUN
        error = {"where": problem.where, "came": problem.came, "expected": problem.expected, "do": problem.do}
        typer.echo(f"pmg {command}: {problem}", err=True)
    except OSError as problem:
        code = ExitCode.COULD_NOT_RUN
        where, came = str(problem.filename or command), problem.strerror or str(problem)
        error = {"where": where, "came": came, "expected": "a readable, writable place", "do": "Check path and rights."}
        typer.echo(f"pmg {command}: {where}: {came}. Check path, rights and free space.", err=True)
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
        error = {"where": command, "came": "interrupted", "expected": "", "do": "Run it again to resume."}
        typer.echo(f"pmg {command}: interrupted; what is in the store is whole. Run it again to resume.", err=True)
    except Exception as problem:  # the outermost place: a defect of pmg, shown with its trace
        code = ExitCode.INTERNAL_ERROR
        error = {"where": command, "came": repr(problem), "expected": "", "do": "Report this as a defect of pmg."}
        traceback.print_exc()
        typer.echo(f"pmg {command}: internal error, a defect of pmg; please report it with the lines above.", err=True)
    if as_json:
        result: dict[str, Any] = {
            "schema": SCHEMA,
            "command": command,
            "exit_code": int(code),
            "data": None if outcome is None else outcome.data,
            "findings": [] if outcome is None else list(outcome.findings),
            "error": error,
        }
        typer.echo(json.dumps(result, indent=1, allow_nan=False, ensure_ascii=False))
    elif outcome is not None:
        for line in outcome.lines:
            typer.echo(line)
        _tell_findings(outcome)
    if code:
        raise typer.Exit(int(code))


FINDINGS_SHOWN = 20
"""Findings printed before the rest is counted."""


def _tell_findings(outcome: Outcome) -> None:
    told = [finding for finding in outcome.findings if finding["severity"] != "info"]
    for finding in told[:FINDINGS_SHOWN]:
        place = f"{finding['file']}: {finding['where']}" if "file" in finding else finding["where"]
        typer.echo(f"{finding['severity']}: {place}: {finding['message']}", err=True)
    if len(told) > FINDINGS_SHOWN:
        typer.echo(f"... and {len(told) - FINDINGS_SHOWN} more; --json and the report list them all.", err=True)


def _exit_code(outcome: Outcome, fail_on: FailOn) -> ExitCode:
    if outcome.partial:
        return ExitCode.PARTLY_DONE
    if fail_on is not FailOn.NEVER and outcome.mismatch:
        return ExitCode.FINDINGS
    if fail_on is FailOn.FINDINGS and outcome.findings:
        return ExitCode.FINDINGS
    return ExitCode.DONE


def main() -> None:
    """Entry of the console scripts.

    Linear algebra keeps to one thread unless the user says otherwise: its matrices here are small, and on a machine
    that is busy, threads that wait for each other make the analysis several times slower.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app()
