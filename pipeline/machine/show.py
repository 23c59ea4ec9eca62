"""A machine in lines: what its file says, what it leaves out; a new file to begin from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.machine.channel import COMMANDS
from pmg.pipeline.machine.gear_page import gear_lines, gears_document
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.machine_text import for_other_records
from pmg.pipeline.machine.magnetic import bench_of, remarks_on_bench, usual
from pmg.pipeline.machine.shipped import machine_path, shipped
from pmg.sim.errors import BenchError, near_miss

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from pmg.pipeline.machine.machine import Machine, MachineShaft
    from pmg.pipeline.machine.quantity import Stated


def new_machine(file: Path, like: str) -> tuple[str, ...]:
    """Write a machine file to begin from; what to do with it, in lines.

    Raises
    ------
    BenchError
        The file is there already, or no machine of that name ships.
    """
    known = shipped()
    if like not in known:
        raise BenchError(f"--like {like}", "unknown", f"one of {', '.join(known)}", near_miss(like, known))
    if file.exists():
        raise BenchError(str(file), "a file that is there", "a new one", "Choose another name; nothing was written.")
    text = for_other_records(known[like].read_text(encoding="utf-8"))
    write_atomic(file, text.encode())
    return (
        f"{file}: begun from {like}. Put the numbers of your machine and the channels of its recordings in it, then:",
        f"  pmg machine check {file} RECORDINGS",
        f"  pmg run RECORDINGS --machine {file} --report REPORT",
    )


def listed_machines() -> tuple[dict[str, Any], tuple[str, ...]]:
    """Machines that ship, as JSON and in lines."""
    titles = {name: read_machine(path).title for name, path in shipped().items()}
    width = max(len(name) for name in titles)
    return {"machines": titles}, tuple(f"{name:<{width}}  {title}" for name, title in titles.items())


def shown_machine(which: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """A machine as JSON and in lines.

    Raises
    ------
    BenchError
        Its file is not there, or not sound.
    """
    machine = read_machine(machine_path(which))
    if not usual(machine):
        return _document(machine) | {"remarks": []}, (machine.title, *_lines(machine))
    bench, remarks = bench_of(machine), tuple(remark.message for remark in remarks_on_bench(machine))
    document = _document(machine) | gears_document(bench) | {"remarks": list(remarks)}
    return document, (machine.title, *_lines(machine), *gear_lines(bench), *remarks)


def _document(machine: Machine) -> dict[str, Any]:
    gear = machine.gear
    return {
        "title": machine.title,
        "shafts": {name: _of_shaft(shaft) for name, shaft in machine.shafts.items()},
        "gear": None
        if gear is None
        else {
            "kind": gear.kind,
            "input": gear.input,
            "output": gear.output,
            "ratio": gear.ratio,
            "numbers": _of(gear.numbers),
        },
    }


def _of_shaft(shaft: MachineShaft) -> dict[str, Any]:
    channels = {kind: {"name": c.name, "unit": c.unit, "sign": c.sign} for kind, (c, _) in shaft.channels.items()}
    return {"moves": "turns" if shaft.axis.turn else "slides", "numbers": _of(shaft.numbers), "channels": channels}


def _of(numbers: Mapping[str, Stated]) -> dict[str, Any]:
    return {
        name: {"value": n.value, "unit": n.unit, "u": n.u, "source": n.source} for name, n in sorted(numbers.items())
    }


def _lines(machine: Machine) -> Iterator[str]:
    gear = machine.gear
    if gear is not None:
        yield ""
        yield f"gear: {gear.kind}, {gear.input} to {gear.output}, {gear.ratio:.6g} turns of {gear.input} to one"
        yield from _numbers(gear.numbers)
    for name, shaft in machine.shafts.items():
        yield ""
        yield f"{name}: {'turns' if shaft.axis.turn else 'slides'}"
        yield from _numbers(shaft.numbers)
        for kind, (channel, _) in shaft.channels.items():
            word = shaft.axis.pushes if kind == "force" else kind
            turned = ", counted the other way" if channel.sign < 0 else ""
            each = f", {channel.factor} {shaft.axis.push} each" if channel.unit in COMMANDS else ""
            yield f"  {word} = channel '{channel.name}' in {channel.unit}{each}{turned}"
    records = machine.records
    yield ""
    if records is None:
        yield "recordings: layout pmg.v1"
    else:
        yield f"recordings: {records.rate_hz:g} Hz, low-passed at {records.low_pass_hz:g} Hz"


def _numbers(numbers: Mapping[str, Stated]) -> Iterator[str]:
    width = max((len(name) for name in numbers), default=0)
    for name, number in numbers.items():
        source = f"  [{number.source}]" if number.source else ""
        yield f"  {name:<{width}} = {number.written()}{source}"
