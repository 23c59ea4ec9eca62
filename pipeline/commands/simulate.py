"""The stage behind ``pmg simulate``: from a scenario file to tables, recordings and a report."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pmg.pipeline.chapters.simulated.simulation import simulation_report
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_files, now
from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.report.write import PAGE
from pmg.pipeline.settings.bench_in_force import bench_in_force, remarks_on_machine
from pmg.pipeline.simulate.files import simulation_files, write_simulation
from pmg.pipeline.simulate.findings import findings_of
from pmg.pipeline.simulate.inputs import gather_inputs, unproven_losses
from pmg.pipeline.simulate.scenario_file import read_scenario
from pmg.pipeline.simulate.scenario_mechanisms import switch_on_by_words
from pmg.pipeline.simulate.simulation import simulate
from pmg.pipeline.simulate.tables import summary_document
from pmg.sim.errors import BenchError
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION, SPEED_SUN

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pmg.pipeline.commands.provenance import Clock
    from pmg.pipeline.recording.remark import Remark
    from pmg.pipeline.simulate.inputs import Inputs
    from pmg.pipeline.simulate.scenario import Scenario
    from pmg.pipeline.simulate.scenario_file import ScenarioFile
    from pmg.pipeline.simulate.simulation import Run, Simulation
    from pmg.sim.bench import BenchParameters


def run_simulate(
    path: Path,
    out: Path,
    campaign: str | None = None,
    *,
    model: Path | None = None,
    switched: Sequence[str] = (),
    machine: str | None = None,
    beside: Path | None = None,
    clock: Clock = now,
) -> Outcome:
    """Simulate a scenario and write what comes out.

    Parameters
    ----------
    path : Path
        The scenario.
    out : Path
        Folder of the results; files of other origin in it are left alone.
    campaign : str, optional
        Name of the campaign in the recordings, instead of the scenario's.
    model : Path, optional
        A model file to take losses and mechanisms from, instead of the scenario's source of losses.
    switched : sequence of str
        Mechanisms to switch on, as ``id:key=value,key=value``.
    machine : str, optional
        Machine file, or the name of one that ships; the thesis bench by default.
    beside : Path, optional
        A second scenario: the page draws its run over that of the first. Nothing else of it is written.
    clock : callable
        Time of day, for the provenance.
    """
    began = clock()
    bench = bench_in_force(None, machine)
    file = _read(path, bench)
    if campaign:
        output = file.table.output.model_copy(update={"campaign": campaign})
        scenario = file.table.model_copy(update={"output": output})
    else:
        scenario = file.table
    inputs = gather_inputs(file, bench, model, switch_on_by_words(switched))
    second = None if beside is None else _read_beside(file, beside, bench)  # its faults come before a long run
    simulation = simulate(scenario, inputs)
    files, missing = simulation_files(simulation, scenario, bench)
    findings = findings_of(simulation, scenario, inputs) + missing
    findings += remarks_on_machine(machine)
    findings += unproven_losses(file) if model is None else ()
    digest = hashlib.sha256(file.text.encode()).hexdigest()
    source = {"file": path.name, "sha256": digest}
    provenance = [("Scenario", path.name), ("SHA-256 of the scenario", digest), ("Randomness", "none")]
    if model is not None:
        source["model"], source["model_sha256"] = model.name, sha256_of(model)
        provenance.append((f"SHA-256 of {model.name}", source["model_sha256"]))
    if switched:
        source["with"] = "; ".join(switched)
    other = None if second is None else second.run()
    if beside is not None:
        source["beside"], source["beside_sha256"] = beside.name, sha256_of(beside)
        provenance.append((f"SHA-256 of {beside.name}", source["beside_sha256"]))
    if other is not None:
        findings += other.findings
    overlaid = None if other is None else (other.name, other.run)
    report = simulation_report(simulation, scenario, inputs, findings, tuple(provenance), path.stem, overlaid)
    summary = summary_document(simulation, scenario, inputs, findings, source)
    written = write_simulation(out, files, report, summary)
    taken = (path, *(given for given in (model, beside) if given is not None))
    leave_crate_of_files(out, "pmg simulate", taken, tuple(written), began, clock)
    return Outcome(
        data={"out": str(out), "report": str(out / PAGE), "files": list(map(str, written)), "summary": summary},
        lines=(*_lines(simulation), f"report, tables, recordings: {out / PAGE}"),
        findings=findings,
        partial=simulation.partial or bool(missing) or (other is not None and other.partial),
    )


def _read(path: Path, bench: BenchParameters) -> ScenarioFile:
    """A scenario whose gear the machine has."""
    file = read_scenario(path)
    if file.table.bench.gear not in bench.stages:
        expected = f"{bench.stages[0]}, the stage of the machine"
        raise file.refusal(f"{file.table.bench.gear}", expected, "Correct the gear.", "bench", "gear")
    return file


@dataclass(frozen=True)
class _Overlaid:
    """The run of a second scenario: its name, itself, what is to be said of it, and whether it ended early."""

    name: str
    run: Run
    findings: tuple[Remark, ...]
    partial: bool


@dataclass(frozen=True)
class _Second:
    """A second scenario, read and checked: its file, its run in time alone, its inputs, what is known beforehand."""

    path: Path
    scenario: Scenario
    inputs: Inputs
    findings: tuple[Remark, ...]

    def run(self) -> _Overlaid:
        """The run; each remark on it names the file."""
        simulation = simulate(self.scenario, self.inputs)
        assert simulation.run is not None  # its [transient] was asked for
        found = (*findings_of(simulation, self.scenario, self.inputs), *self.findings)
        named = tuple(replace(remark, file=self.path.name) for remark in found)
        return _Overlaid(self.path.stem, simulation.run, named, simulation.partial)


def _read_beside(first: ScenarioFile, path: Path, bench: BenchParameters) -> _Second:
    """The scenario whose run is to be drawn over that of the first."""
    file = _read(path, bench)
    for where, asked in ((first.path, first.table.transient), (path, file.table.transient)):
        if asked is None:
            do = "Add [transient], or leave --beside out."
            raise BenchError(str(where), "no run in time", "a [transient] in both scenarios", do)
    output = file.table.output.model_copy(update={"formats": []})
    alone = file.table.model_copy(
        update={"output": output, "point": None, "grid": None, "pairs": None, "response": None}
    )
    return _Second(path, alone, gather_inputs(file, bench), unproven_losses(file))


def _lines(simulation: Simulation) -> tuple[str, ...]:
    """The results for people."""
    lines = [simulation.control.statement]
    points, run, answer = simulation.points, simulation.run, simulation.answer
    if points is not None:
        at, eta = points.grid.points, points.values["efficiency_total"]
        text = f", total efficiency {100.0 * eta[0]:.2f} %" if eta[0] == eta[0] else ""
        speed = float(SPEED_SUN.display(at.speed_sun[0]))
        lines.append(
            f"{len(at)} steady point{'s' if len(at) > 1 else ''}; first {at.name[0]}: sun {speed:.2f} rpm, "
            # to 1 mN m: no transducer of the bench tells less apart, and a fitted model settles no further digit
            f"{points.grid.torque_sun[0]:.3f} N m, ring {points.grid.torque_ring[0]:.3f} N m{text}"
        )
    if run is not None:
        trace = run.trace
        sun, ring = (float(SPEED_SUN.display(trace[f"speed_{name}_motor"][-1])) for name in SIDES)
        state = "stopped at a slipped pole" if trace.stopped is not None else "done"
        lines.append(f"run of {trace.time[-1]:g} s {state}: sun {sun:.2f} rpm, ring motor {ring:.2f} rpm")
    if answer is not None:
        text = ", ".join(f"{m.kind} {m.frequency / REVOLUTION:.4g} Hz" for m in answer.response.resonances)
        lines.append(f"resonances: {text or 'none'}")
    return tuple(lines)
