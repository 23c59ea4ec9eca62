"""The diagnosis of runs in motion on concealed campaigns: false alarms, names, places, withheld runs, times.

./pmgw bench motion --kinds A --campaigns 20 --seed 7
./pmgw bench motion --kinds B,D --sizes 1,2,4 --campaigns 60 --seed 7 --workers 2 --out cases.json

Each campaign is drawn from the bench of `pmg.pipeline.trials.motion`, whose laws, integrator and drives share nothing
with the models. What is concealed is compared with the answer after it was given.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis, diagnose_motion
from pmg.pipeline.trials.motion.nature import draw_motion_case, measure_motion_case
from pmg.pipeline.trials.motion.strata import MotionStratum, motion_strata
from pmg.pipeline.wording.probability import exact_interval
from pmg.sim.bench import load_bench


@dataclass(frozen=True)
class Task:
    """A campaign to draw: the seed of the run, its number, its stratum."""

    seed: int
    number: int
    stratum: MotionStratum


def run(task: Task) -> dict[str, Any]:
    """One campaign drawn, measured and diagnosed."""
    rng = np.random.default_rng([task.seed, task.number])
    case = draw_motion_case(rng, task.stratum)
    runs = tuple(measure_motion_case(case, rng))
    began = time.perf_counter()
    found = diagnose_motion(case.campaign, runs, load_bench(), np.random.default_rng(task.number))
    return {
        "number": task.number,
        "kind": task.stratum.kind,
        "size": task.stratum.size,
        "concealed": sorted({name for name, _ in task.stratum.effects}),
        "verdict": str(found.verdict),
        "p_value": found.mismatch.p_value,
        "named": sorted({fit.identifier for fit in best_of(found)}),
        "told": sorted(told(found)),
        "withheld": None
        if found.held_out is None
        else found.held_out.rmse_after / (found.held_out.expected_after or 1.0),
        "seconds": time.perf_counter() - began,
    }


def best_of(found: MotionDiagnosis) -> tuple[Any, ...]:
    """Fits that are named or lead a set."""
    return found.naming.best.fits if found.verdict.names and found.naming is not None else ()


def told(found: MotionDiagnosis) -> set[str]:
    """Every id that the answer says may be."""
    if not found.verdict.names or found.naming is None:
        return set()
    return {fit.identifier for each in (found.naming.best, *found.naming.rivals) for fit in each.fits}


def rate(hits: list[bool]) -> str:
    """A rate with its interval."""
    if not hits:
        return "-"
    low, high = exact_interval(sum(hits), len(hits))
    return f"{sum(hits)} of {len(hits)} ({100 * low:.0f} to {100 * high:.0f} %)"


def table(rows: list[dict[str, Any]]) -> str:
    """What the campaigns come to, by kind and size."""
    heads = "kind | size | campaigns | seen | named right | right or in set | wrong and confident | withheld / noise"
    lines = [f"| {heads} |", "|---" * (heads.count("|") + 1) + "|"]
    for kind, size in sorted({(row["kind"], row["size"]) for row in rows}):
        these = [row for row in rows if (row["kind"], row["size"]) == (kind, size)]
        named = [row["verdict"] == Verdict.NAMED for row in these]
        right = [n and row["named"] == row["concealed"] for n, row in zip(named, these, strict=True)]
        inside = [bool(row["told"]) and set(row["concealed"]) <= set(row["told"]) for row in these]
        wrong = [n and not r for n, r in zip(named, right, strict=True)]
        proof = [row["withheld"] for row in these if row["withheld"] is not None]
        cells = [
            kind,
            f"{size:g}",
            str(len(these)),
            rate([row["verdict"] != Verdict.CONSISTENT for row in these]),
            rate(right),
            rate(inside),
            rate(wrong),
            f"{np.median(proof):.2f}" if proof else "-",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    seconds = [row["seconds"] for row in rows]
    lines.append(f"\ntime of a diagnosis: median {np.median(seconds):.0f} s, longest {max(seconds):.0f} s")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(prog="pmgw bench motion", description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument(
        "--kinds", default="A,B", help="A clean, B one effect, C two, D outside the library, E poor designs"
    )
    parser.add_argument("--sizes", default="", help="sizes of effects in sigma, all by default: 1,2,4")
    parser.add_argument("--campaigns", type=int, default=20)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, help="a JSON file for the answers")
    asked = parser.parse_args()
    sizes = {float(each) for each in asked.sizes.split(",") if each}
    strata = [
        s for s in motion_strata() if s.kind in asked.kinds.split(",") and (not sizes or s.size in sizes or not s.size)
    ]
    if not strata:
        parser.error(f"no kind of campaign is {asked.kinds} of size {asked.sizes}; expected kinds of A to E")
    order = np.random.default_rng(asked.seed).permutation(len(strata))
    tasks = [Task(asked.seed, k, strata[order[k % len(strata)]]) for k in range(asked.campaigns)]
    rows = []
    with ProcessPoolExecutor(asked.workers) as pool:
        for row in pool.map(run, tasks):
            rows.append(row)
            answer = f"{row['verdict']} {' + '.join(row['named'])}"
            print(
                f"{len(rows)}/{len(tasks)} {' + '.join(row['concealed']) or 'clean'} {row['size']:g}: {answer}",
                file=sys.stderr,
            )
            if asked.out:
                asked.out.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print(table(rows))


if __name__ == "__main__":
    main()
