"""The bench on one page: every number with its source, and what follows from the pole numbers of its gears."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, fields
from itertools import takewhile
from typing import TYPE_CHECKING, Any

from pmg.pipeline.machine.pole_numbers import cogging_factor, operating_modes, space_harmonics
from pmg.pipeline.wording.units import MILLI
from pmg.sim.bench import SourcedQuantity
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.machine.pole_numbers import OperatingMode, SpaceHarmonic
    from pmg.sim.bench import BenchParameters

SAME_WORK = 24
"""Letters with which citations of one work begin alike."""


def shown_bench(bench: BenchParameters) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The bench on one page, as JSON and in lines; a number without an uncertainty is marked so."""
    return _numbers_document(bench) | gears_document(bench), (*gear_lines(bench), *_number_lines(bench))


def _numbers_document(bench: BenchParameters) -> dict[str, Any]:
    return {
        "numbers": {
            section.name: {
                name: {"value": float(number), "unit": number.unit, "u": number.u, "source": number.source.citation}
                for name, number in _numbers(getattr(bench, section.name))
            }
            for section in fields(bench)
            if _has_numbers(bench, section.name)
        }
    }


def gears_document(bench: BenchParameters) -> dict[str, Any]:
    """What follows from the pole numbers of each stage, as JSON."""
    return {"gears": {str(stage): _gear_document(bench, stage) for stage in bench.stages}}


def _gear_document(bench: BenchParameters, stage: int) -> dict[str, Any]:
    gear, q = bench.gear(stage), int(bench.carrier.iron_poles)
    pairs = gear.pole_pairs
    return {
        "pole_pairs": {"sun": pairs.sun, "ring": pairs.ring},
        "iron_poles": q,
        "iron_poles_are_the_sum": q == pairs.sun + pairs.ring,
        "ratio": -gear.ratio,
        "period_rad": {"sun": REVOLUTION / pairs.sun, "ring": REVOLUTION / pairs.ring},
        "cogging_factor": {"sun": cogging_factor(pairs.sun, q), "ring": cogging_factor(pairs.ring, q)},
        "modes": [asdict(mode) for mode in operating_modes(gear, q)],
        "harmonics": [asdict(wave) for wave in space_harmonics(gear, q)],
    }


def _has_numbers(bench: BenchParameters, section: str) -> bool:
    if section.startswith("gear") and int(section[-1]) not in bench.stages:
        return False
    return any(True for _ in _numbers(getattr(bench, section)))


def _numbers(section: object) -> Iterator[tuple[str, SourcedQuantity]]:
    for name, value in vars(section).items() if hasattr(section, "__dict__") else ():
        if isinstance(value, SourcedQuantity):
            yield name, value


def gear_lines(bench: BenchParameters) -> Iterator[str]:
    """What follows from the pole numbers of each stage, for people."""
    for stage in bench.stages:
        yield from _gear_lines(bench, stage)


def _work_of_most(bench: BenchParameters) -> str:
    """The work that most numbers are taken from, as their citations begin; empty where each has another."""
    sections = (getattr(bench, s.name) for s in fields(bench) if _has_numbers(bench, s.name))
    every = [number.source.citation for section in sections for _, number in _numbers(section)]
    ((begins, _),) = Counter(citation[:SAME_WORK] for citation in every).most_common(1)
    parts = zip(*(citation.split(", ") for citation in every if citation.startswith(begins)), strict=False)
    return ", ".join(part[0] for part in takewhile(lambda part: len(set(part)) == 1, parts))


def _number_lines(bench: BenchParameters) -> Iterator[str]:
    work = _work_of_most(bench)
    if work:
        yield ""
        yield f"places in brackets are of: {work}"
    for section in (s.name for s in fields(bench) if _has_numbers(bench, s.name)):
        yield ""
        yield section
        numbers = dict(_numbers(getattr(bench, section)))
        width = max(map(len, numbers))
        for name, number in numbers.items():
            spread = " (no uncertainty stated)" if number.u is None else f" ± {number.u:.2g}"
            unit = "" if number.unit == "1" else f" {number.unit}"
            place = number.source.citation.removeprefix(f"{work}, ")
            yield f"  {name:<{width}} = {float(number):.6g}{unit}{spread}  [{place}]"


def _gear_lines(bench: BenchParameters, stage: int) -> Iterator[str]:
    gear, q = bench.gear(stage), int(bench.carrier.iron_poles)
    pairs = gear.pole_pairs
    sign = "=" if q == pairs.sun + pairs.ring else "is not"
    factors = ", ".join(f"{side} {cogging_factor(p, q):g}" for side, p in (("sun", pairs.sun), ("ring", pairs.ring)))
    periods = ", ".join(f"{side} {360 / p:.4g} degrees" for side, p in (("sun", pairs.sun), ("ring", pairs.ring)))
    yield ""
    yield f"gear {stage}: {q} iron poles {sign} {pairs.sun} + {pairs.ring} pole pairs (eq. 2.7)"
    yield f"  speed ratio sun to ring, carrier fixed: {-gear.ratio:.4g} (eq. 2.8)"
    yield f"  period of the torque maps: {periods} (eq. 2.15, 2.16)"
    yield f"  cogging factor C_f: {factors}; 1 is the least ripple (eq. 2.17)"
    yield "  operating modes without losses (table 2.2); speeds at 1000 rpm of the input, torques at pull-out"
    yield f"    {'input':<8}{'output':<9}{'fixed':<9}{'ratio':>8}" + "".join(
        f"{name:>13}" for name in ("sun rpm", "ring rpm", "carrier rpm", "sun N m", "ring N m", "carrier N m")
    )
    yield from map(_mode_line, operating_modes(gear, q))
    yield "    with the sun fixed, table 2.2 prints a minus sign and the inverse; equation 2.8 gives these ratios"
    yield "  waves that carry torque (eq. 2.12, 2.13)"
    yield from (_wave_line(wave) for wave in space_harmonics(gear, q) if wave.drives is not None)


def _mode_line(mode: OperatingMode) -> str:
    numbers = "".join(f"{speed / MILLI:>13.1f}" for speed in mode.speeds)
    numbers += "".join(f"{torque:>13.2f}" for torque in mode.torques)
    return f"    {mode.input:<8}{mode.output:<9}{mode.fixed:<9}{mode.ratio:>8.4g}{numbers}"


def _wave_line(wave: SpaceHarmonic) -> str:
    return (
        f"    {wave.of} magnets, m = {wave.magnet}, j = {wave.modulation:+d}: {wave.pole_pairs} pole pairs at "
        f"{wave.speed:+.4g} turns a turn of the {wave.of}; drives the {wave.drives}"
    )
