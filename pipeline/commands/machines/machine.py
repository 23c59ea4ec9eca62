"""The stages behind ``pmg machine``: a machine file begun, shown, checked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.commands.machines.terms import findings_of
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.diagnosis.balance.machine.found_and_stated import not_compared
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.balance.records.zero import zero_lines
from pmg.pipeline.machine.gear_page import shown_bench
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.magnetic import remarks_on_bench, usual
from pmg.pipeline.machine.shipped import machine_path
from pmg.pipeline.machine.show import listed_machines, new_machine, shown_machine
from pmg.pipeline.settings.bench_in_force import bench_in_force
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from pathlib import Path


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
        lines += zero_lines(case)
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
        findings = (*findings, *findings_of(fit), *findings_of(withheld))
    return Outcome(data, tuple(lines), findings)
