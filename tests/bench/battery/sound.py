"""False alarms: what is said of campaigns in which nothing is wrong."""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.grid.crosschecks.checked import checked_campaign
from pmg.pipeline.store.store import Store
from pmg.pipeline.trials.record import write_case
from pmg.pipeline.trials.score.case_list import draw_lots
from pmg.sim.bench import load_bench


def false_alarms(recordings: Sequence[Path], campaigns: int, strata: str, seed: int) -> None:
    """Print, of folders of recordings and of campaigns of the trial, how many files and which findings."""
    total: Counter[str] = Counter()
    for folder in recordings:
        total += _told(folder.name, folder)
    for lot in draw_lots(campaigns, seed, tuple(strata.split(","))):
        with tempfile.TemporaryDirectory() as name:
            write_case(lot.draw(), Path(name), lot.rng("measure"))
            total += _told(f"trial campaign {lot.number}", Path(name))
    sys.stdout.write(f"\nall: {dict(total)}\n")


def _told(what: str, folder: Path) -> Counter[str]:
    """Files of one campaign, those of them that are named at each level, and findings by check or code."""
    with tempfile.TemporaryDirectory() as name:
        store = Store(Path(name))
        ingest(folder, store, workers=1)
        checked = checked_campaign(store, None, load_bench())[1]
    counts = Counter(f"{remark.check} ({remark.severity})" for remark in checked.findings)
    named = {(remark.where.partition(": ")[0], str(remark.severity)) for remark in checked.findings}
    for manifest in checked.manifests:
        grave = [f for f in manifest.findings if f.severity != "info"]
        counts.update(f"{finding.code.value} ({finding.severity})" for finding in grave)
        named |= {(manifest.file, str(finding.severity)) for finding in grave}
    counts.update(f"files at level {severity}" for _, severity in named)
    sys.stdout.write(f"{what:45} {len(checked.manifests):4} recordings  {dict(counts) or 'nothing'}\n")
    sys.stdout.flush()
    return counts + Counter(files=len(checked.manifests))
