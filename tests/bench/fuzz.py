"""`./pmgw bench fuzz`: mutations of a recording and of texts that pmg reads, and the count of each outcome."""

from __future__ import annotations

import argparse
import sys
from collections import Counter

import numpy as np

from tests.recording.mutations import FAULTS, KINDS, Outcome, mutate, outcome, specimens
from tests.recording.text_mutations import SPECIMENS, TextOutcome, text_outcomes


def main() -> int:
    """Print a table for each file; the exit code says whether any outcome is a fault."""
    parser = argparse.ArgumentParser(prog="pmgw bench fuzz", description=__doc__)
    parser.add_argument("--mutations", type=int, default=10_000, help="mutations of each file, the four kinds alike")
    parser.add_argument("--texts", type=int, default=500, help="mutations of each text, the ten kinds alike")
    parser.add_argument("--seed", type=int, default=20260401)
    given = parser.parse_args()
    faults = 0
    for number, specimen in enumerate(specimens() if given.mutations else ()):
        rng = np.random.default_rng([given.seed, number])
        counts = {kind: Counter[Outcome]() for kind in KINDS}
        for place in range(given.mutations):
            kind = KINDS[place % len(KINDS)]
            counts[kind][outcome(mutate(kind, specimen, rng), specimen.truth)] += 1
        sys.stdout.write(f"{specimen.name}: {len(specimen.data)} bytes, {specimen.truth.messages.total()} messages\n")
        sys.stdout.write(f"  {'outcome':62}" + "".join(f"{kind:>11}" for kind in KINDS) + "\n")
        for found in Outcome:
            row = "".join(f"{counts[kind][found]:11}" for kind in KINDS)
            sys.stdout.write(f"  {found.value:62}{row}\n")
        faults += sum(counts[kind][fault] for kind in KINDS for fault in FAULTS)
    for number, text in enumerate(SPECIMENS if given.texts else ()):
        found_in = text_outcomes(text, given.texts, np.random.default_rng([given.seed, 100 + number]))
        sys.stdout.write(f"{text.name}: {len(text.text)} characters\n")
        sys.stdout.write(f"  {'outcome':25}" + "".join(f"{kind:>11}" for kind in found_in) + "\n")
        for ended in TextOutcome:
            row = "".join(f"{count[ended]:11}" for count in found_in.values())
            sys.stdout.write(f"  {ended.value:25}{row}\n")
        sys.stdout.flush()
        faults += sum(count[TextOutcome.CRASHED] + count[TextOutcome.HUNG] for count in found_in.values())
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
