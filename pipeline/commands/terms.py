"""The stage behind ``pmg terms``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.chapters.explained.balance import terms_sections
from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.commands.compare_and_diagnose import SEED
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_files, now
from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.document import headline, terms_document, terms_lines
from pmg.pipeline.diagnosis.balance.recorded import read_recording
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.report.document import Facts, Report
from pmg.pipeline.report.document import Headline as Headline
from pmg.pipeline.report.write import write_report

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis

DOCUMENT = "terms.json"
"""The diagnosis as JSON."""

RESIDUALS = "residuals.csv"
"""Residuals of the models, sample by sample."""


def run_terms(case_file: Path, out: Path, data: Path | None = None, seed: int | None = None) -> Outcome:
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
    """
    began = now()
    seed = SEED if seed is None else seed
    case = read_case(case_file, data)
    recorded = read_recording(case.fit, case)
    withheld = None if case.withheld is None else read_recording(case.withheld, case)
    diagnosis = diagnose_terms(case, recorded, withheld, np.random.default_rng(seed))
    files = [case_file, case.fit, *([] if case.withheld is None else [case.withheld])]
    digests = {path.name: sha256_of(path) for path in files}
    document = terms_document(diagnosis) | {"seed": seed, "sha256": digests}
    write_atomic(out / DOCUMENT, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
    write_atomic(out / RESIDUALS, _residual_table(diagnosis).encode())
    page = write_report(_page(diagnosis, seed, digests), out)
    written = [str(path) for path in (*page, out / DOCUMENT, out / RESIDUALS)]
    leave_crate_of_files(out, "pmg terms", tuple(files), (*page, out / DOCUMENT, out / RESIDUALS), began)
    data_out: dict[str, Any] = document | {"report": str(page[0]), "files": written}
    return Outcome(
        data_out,
        (*terms_lines(diagnosis), "", f"report: {page[0]}"),
        (*recorded.findings, *(() if withheld is None else withheld.findings)),
        mismatch=diagnosis.verdict is not Verdict.CONSISTENT,
    )


def _residual_table(diagnosis: TermsDiagnosis) -> str:
    """Thinned samples of the fitted recording, and what baseline, named terms and refinements leave, as CSV."""
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


def _page(diagnosis: TermsDiagnosis, seed: int, digests: dict[str, str]) -> Report:
    state = "good" if diagnosis.verdict in (Verdict.CONSISTENT, Verdict.NAMED) else "attention"
    return Report(
        title=diagnosis.case.title,
        subtitle=f"Terms of its {diagnosis.case.axis.pushes} balance: what the baseline lacks, and the proof",
        verdict=Headline(headline(diagnosis), "good" if state == "good" else "attention"),
        sections=terms_sections(diagnosis),
        provenance=Facts(
            (
                *((f"SHA-256 of {name}", digest) for name, digest in digests.items()),
                ("Seed", str(seed)),
                ("Versions", versions(PACKAGES)),
            )
        ),
    )
