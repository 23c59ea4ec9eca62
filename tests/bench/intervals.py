"""`./pmgw bench intervals`: how often the 95 % interval of a named size holds the truth, by effect and by size.

Only effects to which one parameter of the library corresponds are concealed; of those, sizes that were named right
count. Laws are those of a trial, so that the true value is the constant that comes nearest to what the effect did.
"""

from __future__ import annotations

import argparse
import os

from pmg.pipeline.files.parallel import map_over
from pmg.pipeline.trials.laws import CHOICES, USUAL
from pmg.pipeline.trials.score.case_list import Lot
from pmg.pipeline.trials.score.rates import count
from pmg.pipeline.trials.score.run_case import ROUTES, CaseTask, run_case
from pmg.pipeline.trials.score.score import PARAMETERS, WITHOUT_ONE, ParameterScore, judge
from pmg.pipeline.trials.strata import strata
from tests.bench.speed import report

SIZES = (1.0, 2.0, 4.0)
"""Sizes of an effect [sigma]."""


def lots(rounds: int, seed: int, laws: str) -> list[Lot]:
    """Campaigns with one effect whose law has one parameter; each effect, shaft and size once a round."""
    chosen = [s for s in strata() if s.kind == "one" and s.size in SIZES and s.effects[0][0] in PARAMETERS]
    drawn = [Lot(number, stratum, seed, laws) for number, stratum in enumerate(chosen * rounds)]
    return [lot for lot in drawn if lot.draw().truth["effects"][0]["knobs"].get("law") not in WITHOUT_ONE]


def coverage(title: str, found: list[ParameterScore]) -> None:
    """Print how many intervals hold the truth."""
    inside = count([covers for parameter in found if (covers := parameter.covers) is not None])
    low, high = inside.interval or (0.0, 1.0)
    report(f"  {title}", str(inside.of), f"  {inside.hits} inside ({low:.1%} to {high:.1%})")


def main() -> None:
    """Read the arguments, run, print."""
    parser = argparse.ArgumentParser(prog="pmgw bench intervals")
    parser.add_argument("--rounds", type=int, default=20, help="times each effect, shaft and size is drawn")
    parser.add_argument("--seed", type=int, default=20261126)
    parser.add_argument("--laws", choices=CHOICES, default=USUAL)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    drawn = lots(asked.rounds, asked.seed, asked.laws)
    named: list[tuple[float, ParameterScore]] = []
    for task, result in map_over(run_case, [CaseTask(lot, ROUTES[0], "", "", False) for lot in drawn], asked.workers):
        parameter = judge(task.lot.draw().truth, result["diagnosis"]).parameter
        if parameter is not None:
            named.append((task.lot.stratum.size, parameter))
    report(f"95 % intervals of sizes named right, of {len(drawn)} campaigns", "intervals", "inside")
    coverage("all", [parameter for _, parameter in named])
    for size in SIZES:
        coverage(f"{size:g} sigma", [parameter for own, parameter in named if own == size])
    for identifier in PARAMETERS:
        coverage(identifier, [parameter for _, parameter in named if parameter.identifier == identifier])


if __name__ == "__main__":
    main()
