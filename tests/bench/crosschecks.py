"""`./pmgw bench crosschecks`: planted contradictions that are named, and false alarms on campaigns without any."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.grid.crosschecks.catalogue import CheckedCampaign
from pmg.pipeline.grid.crosschecks.checked import checked_campaign
from pmg.pipeline.store.store import Store
from pmg.pipeline.trials.record import write_case
from pmg.pipeline.trials.score.case_list import draw_lots
from pmg.sim.bench import load_bench
from tests.grid.checked_campaign import FAULTS, MORE_FAULTS, sound_campaign, write_campaign


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(prog="pmgw bench crosschecks", description=__doc__)
    parser.add_argument("--campaigns", type=int, default=10, help="campaigns of the trial, through recordings")
    parser.add_argument("--strata", default="clean", help="kinds of campaigns, as of pmg prove")
    parser.add_argument("--seed", type=int, default=20261122, help="of the campaigns")
    parser.add_argument("--recordings", type=Path, nargs="*", default=[], help="folders of more campaigns")
    given = parser.parse_args()
    out = sys.stdout.write
    out("Planted in a campaign of 38 synthetic recordings, one fault at a time.\n\n")
    for fault in (*FAULTS, *MORE_FAULTS):
        with tempfile.TemporaryDirectory() as name:
            runs = sound_campaign()
            fault.plant(runs)
            found = _checked(write_campaign(Path(name), runs), Path(name) / "store")
        named = sorted({remark.check for remark in found.findings})
        codes = {finding.code.value for m in found.manifests for finding in m.findings if finding.severity == "error"}
        told = fault.check in named if fault.check else bool(codes)
        words = ", ".join([*named, *sorted(codes)])
        out(f"{fault.what:45} {fault.check or 'in the file':17} {'named' if told else 'MISSED':7} {words}\n")
    out("\nCampaigns in which nothing contradicts: findings by check, of how many recordings.\n\n")
    total: Counter[str] = Counter()
    files = 0
    folders = [(str(folder), folder) for folder in given.recordings]
    for what, folder in folders:
        with tempfile.TemporaryDirectory() as name:
            files += _told(what, _checked(folder, Path(name) / "store"), total)
    for lot in draw_lots(given.campaigns, given.seed, tuple(given.strata.split(","))):
        with tempfile.TemporaryDirectory() as name:
            place = Path(name) / "recordings"
            place.mkdir()
            write_case(lot.draw(), place, lot.rng("measure"))
            files += _told(f"trial campaign {lot.number}", _checked(place, Path(name) / "store"), total)
    out(f"\nall: {dict(total) or 'nothing'} of {files} recordings\n")


def _checked(folder: Path, place: Path) -> CheckedCampaign:
    store = Store(place)
    ingest(folder, store, workers=1)
    return checked_campaign(store, None, load_bench())[1]


def _told(what: str, found: CheckedCampaign, total: Counter[str]) -> int:
    counts = Counter(f"{remark.check} ({remark.severity})" for remark in found.findings)
    total.update(counts)
    sys.stdout.write(f"{what:45} {len(found.manifests):4} recordings  {dict(counts) or 'nothing'}\n")
    sys.stdout.flush()
    return len(found.manifests)


if __name__ == "__main__":
    main()
