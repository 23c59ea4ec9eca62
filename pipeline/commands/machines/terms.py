"""The stages behind ``pmg terms``, and behind ``pmg run`` with a machine of one's own."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from io import StringIO
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pmg.pipeline.chapters.bench_parts import asked_of
from pmg.pipeline.chapters.explained.balance import terms_sections
from pmg.pipeline.chapters.explained.machine import machine_sections, readings_section
from pmg.pipeline.chapters.explained.machine_sheet import machine_sheet
from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.commands.compare_and_diagnose import SEED
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_files, now
from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.causes import cause_lines, named_causes, near_causes, nearest_lines
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.document import free_run_lines, headline, terms_document, terms_lines
from pmg.pipeline.diagnosis.balance.low_pass_told import low_pass_remarks
from pmg.pipeline.diagnosis.balance.low_passes import try_low_passes
from pmg.pipeline.diagnosis.balance.machine.found_and_stated import (
    contradictions,
    found_and_stated,
    not_compared,
)
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.machine.machine_document import machine_document
from pmg.pipeline.diagnosis.balance.machine.power import steady_points
from pmg.pipeline.diagnosis.balance.machine.simulated import with_free_runs
from pmg.pipeline.diagnosis.balance.machine.with_cause import with_cause
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.files.progress import Steps
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.shipped import machine_path
from pmg.pipeline.recording.findings import Severity
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.document import Caution, Facts, Report
from pmg.pipeline.report.document import Headline as Headline
from pmg.pipeline.report.write import write_report
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.machine.machine import Machine
    from pmg.pipeline.report.action_sheet import ActionSheet
    from pmg.pipeline.report.document import Section

DOCUMENT = "terms.json"
"""The diagnosis as JSON."""

RESIDUALS = "residuals.csv"
"""Residuals of the models, sample by sample."""

STEPS = ("recordings", "half the low-pass, and twice", "terms and their proof", "report")
"""Steps of a diagnosis, as its progress names them."""

WITH_CAUSE = "machine-with-cause.toml"
"""The machine file with what was named as a known term."""

OF_A_CASE = Remark(
    "info", "case", "a machine file says the same and more: 'pmg machine new', then 'pmg run RECORDINGS --machine FILE'"
)
"""Told with every case file."""


def run_terms(
    case_file: Path, out: Path, data: Path | None = None, seed: int | None = None, progress: Progress | None = None
) -> Outcome:
    """Diagnose the recordings of a case; write page, tables, residuals and JSON.

    Parameters
    ----------
    case_file : Path
        Case in TOML.
    out : Path
        Folder of what is written.
    data : Path, optional
        Folder of the recordings, instead of the one that the case names.
    seed : int, optional
        Seed of synthetic records, resamples and decoys.
    progress : Progress, optional
        Receives each step as it begins.
    """
    return _run(read_case(case_file, data), case_file, out, seed, None, progress)


def run_machine(
    machine: str, recordings: Path, out: Path, seed: int | None = None, progress: Progress | None = None
) -> Outcome:
    """Diagnose the recordings of a machine; write page, tables, residuals and JSON.

    Parameters
    ----------
    machine : str
        Machine file, or the name of one that ships.
    recordings : Path
        Folder of recordings of any format that is imported, or one of them.
    out : Path
        Folder of what is written.
    seed : int, optional
        Seed of synthetic records, resamples and decoys.
    progress : Progress, optional
        Receives each step as it begins.
    """
    path = machine_path(machine)
    described = read_machine(path)
    return _run(case_of(described, recordings), path, out, seed, described, progress)


def _run(
    case: Case, file: Path, out: Path, seed: int | None, machine: Machine | None, progress: Progress | None
) -> Outcome:
    began = now()
    _check_out(out, file)
    seed = SEED if seed is None else seed
    steps = Steps(progress, *STEPS)
    steps.begin(STEPS[0])
    recorded, withheld = read_recordings(case)
    steps.begin(STEPS[1])
    low_passes = try_low_passes(case, np.random.default_rng(seed))
    steps.begin(STEPS[2])
    diagnosis = with_free_runs(diagnose_terms(case, recorded, withheld, np.random.default_rng(seed), low_passes))
    steps.begin(STEPS[3])
    files = [file, *case.files]
    digests = {file.name: sha256_of(file), **{case.label(path): sha256_of(path) for path in case.files}}
    causes = named_causes(diagnosis)
    document = terms_document(diagnosis) | {"causes": [cause.document for cause in causes]}
    document |= {"near": [cause.document for cause in near_causes(diagnosis)]}
    document |= {"seed": seed, "sha256": digests}
    sections: tuple[Section, ...] = ()
    against: tuple[Remark, ...] = ()
    if machine is not None:
        points = () if case.ratio is None else steady_points(recorded, machine, _inertia(diagnosis))
        compared = found_and_stated(diagnosis, machine)
        against = contradictions(compared, diagnosis)
        document |= machine_document(machine, points, compared)
        sections = machine_sections(machine, points, compared, causes)
    tables = {DOCUMENT: json.dumps(document, indent=1, allow_nan=False) + "\n", RESIDUALS: _residual_table(diagnosis)}
    if machine is not None and (text := with_cause(file.read_text(encoding="utf-8"), diagnosis)):
        tables[WITH_CAUSE] = text
    elif machine is not None:
        (out / WITH_CAUSE).unlink(missing_ok=True)
    for name, text in tables.items():
        write_atomic(out / name, text.encode())
    remarks = (*against, *findings_of(recorded), *findings_of(withheld), *low_pass_remarks(diagnosis))
    cautions = tuple(Caution(f"{r.place}: {r.message}") for r in remarks if r.severity != Severity.INFO)
    own = (*sections, *readings_section(remarks))
    sheet = machine_sheet(diagnosis, against, goes_on=WITH_CAUSE in tables)
    page = _page(diagnosis, seed, digests, (own, cautions), sheet, contradicted=bool(against))
    written = (*write_report(page, out), *(out / name for name in tables))
    command = "pmg terms" if machine is None else "pmg run"
    leave_crate_of_files(out, command, tuple(files), written, began)
    data_out: dict[str, Any] = document | {"report": str(written[0]), "files": [str(path) for path in written]}
    return Outcome(
        data_out,
        (
            *terms_lines(diagnosis),
            "",
            *cause_lines(causes, case.axis.push),
            *nearest_lines(diagnosis),
            *free_run_lines(diagnosis),
            f"report: {written[0]}",
            *((f"go on with: --machine {out / WITH_CAUSE}",) if WITH_CAUSE in tables else ()),
        ),
        (*remarks, *((OF_A_CASE,) if machine is None else not_compared(machine))),
        mismatch=diagnosis.verdict is not Verdict.CONSISTENT,
    )


def _check_out(out: Path, file: Path) -> None:
    """Refuse a folder that is none, or one in which the file that was given would be written over."""
    if out.exists() and not out.is_dir():
        raise BenchError(f"--report {out}", "a file", "a folder, or none yet", "Name a folder.")
    if (out / WITH_CAUSE).resolve() == file.resolve():
        do = "Name another folder, or copy the file first."
        raise BenchError(f"--report {out}", "the folder that holds the machine file", "another one", do)


def findings_of(recorded: Recorded | None) -> tuple[Remark, ...]:
    """What was found in reading some recordings; warnings with what to do."""
    found = () if recorded is None else recorded.findings
    return tuple(
        replace(each, message=f"{each.message}. {each.do}") if each.severity is Severity.WARNING else each
        for each in found
    )


def _inertia(diagnosis: TermsDiagnosis) -> float:
    """Inertia as the first shaft sees it: fitted, or known."""
    found = (e.value for e in diagnosis.steps[-1].fitted.estimates if e.term == "inertia")
    return next(found, diagnosis.case.fixed.get("inertia", 0.0))


def _residual_table(diagnosis: TermsDiagnosis) -> str:
    """Thinned samples of the fitted recordings, each on its own clock, and what the models leave, as CSV."""
    recorded = diagnosis.recorded
    truth = recorded.force + recorded.known
    last = (diagnosis.refinements or diagnosis.steps)[-1]
    models = (diagnosis.steps[0], diagnosis.steps[-1], last)
    motion = recorded.thin(np.c_[recorded.motion.position, recorded.motion.speed, recorded.motion.acceleration])
    columns = np.c_[recorded.elapsed, motion, truth, *(step.fitted.left(recorded) for step in models)]
    axis = diagnosis.case.axis
    head = ["recording", "time [s]", f"position [{axis.length}]", f"speed [{axis.speed}]"]
    head += [f"acceleration [{axis.acceleration}]", f"{axis.pushes} [{axis.push}]"]
    head += [f"residual_{name} [{axis.push}]" for name in ("baseline", "named", "refined")]
    text = StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(head)
    ends = (*recorded.starts, len(columns))
    for k, name in enumerate(recorded.names):
        table.writerows([name, *(f"{value:.9g}" for value in row)] for row in columns[ends[k] : ends[k + 1]])
    return text.getvalue()


def _page(
    diagnosis: TermsDiagnosis,
    seed: int,
    digests: dict[str, str],
    own: tuple[tuple[Section, ...], tuple[Caution, ...]],
    sheet: ActionSheet,
    *,
    contradicted: bool,
) -> Report:
    first, *others = terms_sections(diagnosis)
    consistent = diagnosis.verdict is Verdict.CONSISTENT
    own_sections, cautions = own
    asks = "" if consistent and not contradicted else "Check the file" if consistent else asked_of(diagnosis.verdict)
    state: Literal["good", "attention"] = "attention" if asks else "good"
    return Report(
        title=diagnosis.case.title,
        subtitle=f"Terms of its {diagnosis.case.axis.pushes} balance: what the baseline lacks, and the proof",
        verdict=Headline(headline(diagnosis), state, warnings=cautions, asks=asks),
        sections=(first, *own_sections, *others),
        sheet=sheet,
        provenance=Facts(
            (
                *((f"SHA-256 of {name}", digest) for name, digest in digests.items()),
                ("Seed", str(seed)),
                ("Versions", versions(PACKAGES)),
            )
        ),
    )
