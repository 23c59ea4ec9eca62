"""The stages behind ``pmg terms``, and behind ``pmg run`` with a machine of one's own."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.chapters.bench_parts import asked_of
from pmg.pipeline.chapters.explained.balance import terms_sections
from pmg.pipeline.chapters.explained.machine import machine_sections
from pmg.pipeline.chapters.explained.machine_sheet import machine_sheet
from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.commands.compare_and_diagnose import SEED
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_files, now
from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.causes import cause_lines, named_causes, near_causes, nearest_lines
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.document import headline, terms_document, terms_lines
from pmg.pipeline.diagnosis.balance.low_pass_told import low_pass_remarks
from pmg.pipeline.diagnosis.balance.low_passes import try_low_passes
from pmg.pipeline.diagnosis.balance.machine.found_and_stated import found_and_stated, not_compared
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.machine.machine_document import machine_document
from pmg.pipeline.diagnosis.balance.machine.power import steady_points
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.files.progress import Steps
from pmg.pipeline.machine.gear_page import shown_bench
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.magnetic import remarks_on_bench, usual
from pmg.pipeline.machine.shipped import machine_path
from pmg.pipeline.machine.show import listed_machines, new_machine, shown_machine
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.document import Facts, Report
from pmg.pipeline.report.document import Headline as Headline
from pmg.pipeline.report.write import write_report
from pmg.pipeline.settings.bench_in_force import bench_in_force
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.machine.machine import Machine
    from pmg.pipeline.report.document import Section

DOCUMENT = "terms.json"
"""The diagnosis as JSON."""

RESIDUALS = "residuals.csv"
"""Residuals of the models, sample by sample."""

STEPS = ("recordings", "terms and their proof", "half the low-pass, and twice", "report")
"""Steps of a diagnosis, as its progress names them."""

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


def begin_machine(file: Path, like: str) -> Outcome:
    """Write a machine file to begin from.

    Parameters
    ----------
    file : Path
        Where; never a file that is there.
    like : str
        Name of a machine that ships.
    """
    return Outcome({"file": str(file), "like": like}, new_machine(file, like))


def show_machine(which: str | None) -> Outcome:
    """A machine on one page.

    Parameters
    ----------
    which : str, optional
        Machine file, or the name of one that ships; left out, all that ship.
    """
    return Outcome(*(listed_machines() if which is None else shown_machine(which)))


def show_bench(machine: str | None) -> Outcome:
    """The bench in force on one page.

    Parameters
    ----------
    machine : str, optional
        Machine file, or the name of one that ships; left out, the bench of the thesis.
    """
    return Outcome(*shown_bench(bench_in_force(None, machine)))


def check_machine(machine: str, recordings: Path | None) -> Outcome:
    """Whether a machine file is sound, and whether recordings hold what it names.

    Parameters
    ----------
    machine : str
        Machine file, or the name of one that ships.
    recordings : Path, optional
        Folder of its recordings, or one of them.
    """
    described = read_machine(machine_path(machine))
    lines = [f"{described.path}: sound, {described.title}"]
    bare = [
        f"{name}.{key}" for name, shaft in described.shafts.items() for key, n in shaft.numbers.items() if n.u is None
    ]
    if bare:
        lines.append(f"without an uncertainty: {', '.join(bare)}")
    data: dict[str, Any] = {"machine": described.title, "without_uncertainty": bare, "recordings": []}
    findings = remarks_on_bench(described) if usual(described) else not_compared(described)
    if recordings is not None and usual(described):
        survey = "pmg doctor RECORDINGS --machine FILE"
        raise BenchError(str(recordings), "recordings in layout pmg.v1", "none", f"Look at them by '{survey}'.")
    if recordings is not None:
        case = case_of(described, recordings)
        fit, withheld = read_recordings(case)
        for kind, found in (("fitted", fit), ("withheld", withheld)):
            for one in () if found is None else found.each():
                m, unit = one.motion, case.axis.speed
                seconds = float(m.time[-1] - m.time[0])
                lines.append(
                    f"{one.name}: {kind}, {seconds:.1f} s, speed {m.speed.min():.3g} to {m.speed.max():.3g} {unit}, "
                    f"{case.axis.pushes} balance {m.force.min():.3g} to {m.force.max():.3g} {case.axis.push}"
                )
                data["recordings"].append({"name": one.name, "use": kind, "seconds": seconds})
        findings = (*findings, *_findings(fit), *_findings(withheld))
    return Outcome(data, tuple(lines), findings)


def _run(
    case: Case, file: Path, out: Path, seed: int | None, machine: Machine | None, progress: Progress | None
) -> Outcome:
    began = now()
    if out.exists() and not out.is_dir():
        raise BenchError(f"--report {out}", "a file", "a folder, or none yet", "Name a folder.")
    seed = SEED if seed is None else seed
    steps = Steps(progress, *STEPS)
    steps.begin(STEPS[0])
    recorded, withheld = read_recordings(case)
    steps.begin(STEPS[1])
    diagnosis = diagnose_terms(case, recorded, withheld, np.random.default_rng(seed))
    steps.begin(STEPS[2])
    diagnosis = replace(diagnosis, low_passes=try_low_passes(case, np.random.default_rng(seed)))
    steps.begin(STEPS[3])
    files = [file, *case.files]
    names = [path.name for path in files]
    labels = [path.name if names.count(path.name) == 1 else f"{path.parent.name}/{path.name}" for path in files]
    digests = {label: sha256_of(path) for label, path in zip(labels, files, strict=True)}
    causes = named_causes(diagnosis)
    document = terms_document(diagnosis) | {"causes": [cause.document for cause in causes]}
    document |= {"near": [cause.document for cause in near_causes(diagnosis)]}
    document |= {"seed": seed, "sha256": digests}
    sections: tuple[Section, ...] = ()
    if machine is not None:
        points = () if case.ratio is None else steady_points(recorded, machine, _inertia(diagnosis))
        compared = found_and_stated(diagnosis, machine)
        document |= machine_document(machine, points, compared)
        sections = machine_sections(machine, points, compared)
    write_atomic(out / DOCUMENT, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
    write_atomic(out / RESIDUALS, _residual_table(diagnosis).encode())
    page = write_report(_page(diagnosis, seed, digests, sections), out)
    written = [str(path) for path in (*page, out / DOCUMENT, out / RESIDUALS)]
    command = "pmg terms" if machine is None else "pmg run"
    leave_crate_of_files(out, command, tuple(files), (*page, out / DOCUMENT, out / RESIDUALS), began)
    data_out: dict[str, Any] = document | {"report": str(page[0]), "files": written}
    return Outcome(
        data_out,
        (
            *terms_lines(diagnosis),
            "",
            *cause_lines(causes, case.axis.push),
            *nearest_lines(diagnosis),
            f"report: {page[0]}",
        ),
        (
            *_findings(recorded),
            *_findings(withheld),
            *low_pass_remarks(diagnosis),
            *((OF_A_CASE,) if machine is None else not_compared(machine)),
        ),
        mismatch=diagnosis.verdict is not Verdict.CONSISTENT,
    )


def _findings(recorded: Recorded | None) -> tuple[Remark, ...]:
    return () if recorded is None else recorded.findings


def _inertia(diagnosis: TermsDiagnosis) -> float:
    """Inertia as the first shaft sees it: fitted, or known."""
    found = (e.value for e in diagnosis.steps[-1].fitted.estimates if e.term == "inertia")
    return next(found, diagnosis.case.fixed.get("inertia", 0.0))


def _residual_table(diagnosis: TermsDiagnosis) -> str:
    """Thinned samples of the fitted recordings, and what baseline, named terms and refinements leave, as CSV."""
    recorded = diagnosis.recorded
    truth = recorded.force + recorded.known
    last = (diagnosis.refinements or diagnosis.steps)[-1]
    models = (diagnosis.steps[0], diagnosis.steps[-1], last)
    motion = recorded.thin(np.c_[recorded.motion.position, recorded.motion.speed, recorded.motion.acceleration])
    columns = np.c_[recorded.time, motion, truth, *(truth - step.fitted.predict(recorded) for step in models)]
    axis = diagnosis.case.axis
    head = f"time [s],position [{axis.length}],speed [{axis.speed}],acceleration [{axis.acceleration}],"
    head += f"{axis.pushes} [{axis.push}],residual_baseline [{axis.push}],residual_named [{axis.push}]"
    rows = "\n".join(",".join(f"{value:.9g}" for value in row) for row in columns)
    return f"{head},residual_refined [{axis.push}]\n{rows}\n"


def _page(diagnosis: TermsDiagnosis, seed: int, digests: dict[str, str], own: tuple[Section, ...]) -> Report:
    first, *others = terms_sections(diagnosis)
    good = diagnosis.verdict is Verdict.CONSISTENT
    asks = "" if good else asked_of(diagnosis.verdict)
    return Report(
        title=diagnosis.case.title,
        subtitle=f"Terms of its {diagnosis.case.axis.pushes} balance: what the baseline lacks, and the proof",
        verdict=Headline(headline(diagnosis), "good" if good else "attention", asks=asks),
        sections=(first, *own, *others),
        sheet=machine_sheet(diagnosis),
        provenance=Facts(
            (
                *((f"SHA-256 of {name}", digest) for name, digest in digests.items()),
                ("Seed", str(seed)),
                ("Versions", versions(PACKAGES)),
            )
        ),
    )
