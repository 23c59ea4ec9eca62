"""The stage behind ``pmg doctor``: what a set of recordings permits, stated before anything is run."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pmg.pipeline.analysis.outputs import analysed_campaign
from pmg.pipeline.commands.config import run_check
from pmg.pipeline.commands.design import audit_words
from pmg.pipeline.commands.machines.machine import check_machine
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import THESIS_OPTIONS
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.importers.supply import read_supply
from pmg.pipeline.machine.machine_file import MACHINE_SCHEMA, read_machine
from pmg.pipeline.machine.magnetic import usual
from pmg.pipeline.machine.shipped import machine_path
from pmg.pipeline.model.model_file import MOTION_SCHEMA, SCHEMA, Model
from pmg.pipeline.model.read_motion_model import read_any_model
from pmg.pipeline.preflight.abilities import NO, Design, abilities, zero_ability
from pmg.pipeline.preflight.environment import BAD, OK, environment
from pmg.pipeline.preflight.motion import motion_abilities, motion_summary
from pmg.pipeline.preflight.rehearsal import audit, rehearse
from pmg.pipeline.preflight.survey import survey
from pmg.pipeline.preflight.unlike_machine import unlike_the_machine
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.recording.supplied import NOTHING
from pmg.pipeline.settings.bench_in_force import bench_in_force
from pmg.pipeline.store.sources import PUBLISHED, passed_over
from pmg.pipeline.wording.plurals import counted
from pmg.sim.bench import load_bench

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.design.audit import Audit
    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.preflight.found import Survey
    from pmg.sim.bench import BenchParameters


def run_doctor(
    place: Path, store: Path | None, progress: Progress | None, chart: Path | None, machine: str | None
) -> Outcome:
    """What anything that 'pmg run' or 'pmg report' takes permits: recordings, a store, grids, or one of their files.

    Parameters
    ----------
    place, store, progress, chart, machine
        As of `_of_recordings`; `place` may be a folder of grids, or a machine, model or campaign file too.
    """
    if place.suffix.lower() == ".toml" and place.is_file():
        return _file(place)
    if all((place / name).is_file() for name in PUBLISHED):
        return _grids(place)
    if machine is not None and not usual(read_machine(machine_path(machine))):
        return check_machine(machine, place)
    return _of_recordings(place, store, progress, chart, machine)


def _file(path: Path) -> Outcome:
    """Whether a TOML file is sound, by the schema it names; a campaign file names none."""
    text = path.read_text(encoding="utf-8", errors="replace")
    if MACHINE_SCHEMA in text:
        return check_machine(str(path), None)
    if SCHEMA not in text and MOTION_SCHEMA not in text:
        return run_check(path)
    model = read_any_model(path, load_bench())
    if isinstance(model, Model):
        parts = [f"{part.kind.title} ({part.shaft})" for part in model.parts]
    else:
        parts = [cause.term.title for cause in model.causes]
    line = f"{path}: sound, a model with {' and '.join(parts) if parts else 'no mechanism beyond the baseline'}"
    return Outcome({"model": str(path), "mechanisms": parts}, (line,))


def _grids(folder: Path) -> Outcome:
    """How far the analysis of published grids comes."""
    bench = load_bench()
    grid = read_published(folder, bench)
    analysis = analyse(grid, THESIS_OPTIONS, bench)
    neutral = int(grid.points.neutral.sum())
    lines = [f"published grids: {counted(neutral, 'neutral point')}, {counted(len(grid) - neutral, 'engaged point')}"]
    lines += [f"  no      {fault.where}: {fault.advice}" for fault in analysis.missing]
    lines += [] if analysis.missing else ["  yes     loss curves, calibration, power balance, diagnosis"]
    lines += ["  no      order analysis, drift and noise floor from recordings: grids hold means alone"]
    findings = [Remark("warning", "grid", f"hole in the grid: {hole}") for hole in analysis.lacking]
    data = {"place": str(folder), "kind": "grids", "neutral": neutral, "engaged": len(grid) - neutral}
    return Outcome(data, tuple(lines), tuple(findings))


def _of_recordings(
    place: Path,
    store: Path | None,
    progress: Progress | None = None,
    chart: Path | None = None,
    machine: str | None = None,
) -> Outcome:
    """Abilities of recordings, or of a store.

    Parameters
    ----------
    place : Path
        A folder of recordings, one recording, or a store.
    store : Path, optional
        Where the store would be.
    progress : callable, optional
        Told (done, total, name) after each recording.
    chart : Path, optional
        File that states what recordings lack: run, calibration, channels under other names.
    machine : str, optional
        Machine file, or the name of one that ships; that of the store by default, or the thesis bench.

    Raises
    ------
    PmgError
        There is neither a recording nor a store.
    """
    bench = bench_in_force(place if place.is_dir() else None, machine)
    found = survey(place, bench, progress, NOTHING if chart is None else read_supply(chart))
    size = sum(file.size for file in found.files)
    checks = environment(place if found.stored else store, 0 if found.stored else size)
    campaigns = [_campaign(found.of(name), name, bench) for name in found.campaigns]
    possible = any(row["state"] != NO for part in campaigns for row in part["chapters"])
    findings = [Remark("error", f.name, f"unusable: {f.unusable}") for f in found.files if f.unusable and not f.copy]
    findings += [
        Remark("warning", file.name, f"the same bytes as {file.copy}: counts once") for file in found.files if file.copy
    ]
    findings += [Remark("warning", file.name, file.damage) for file in found.files if file.damage]
    findings += [Remark("warning", each.file, f"{each.message}. {each.do}") for each in passed_over(place)]
    findings += unlike_the_machine(found.usable, bench)
    findings += [Remark("warning", check.what, check.description) for check in checks if check.state != OK]
    findings += [
        Remark("warning", part["campaign"], f"hole in the grid: {hole}") for part in campaigns for hole in part["holes"]
    ]
    data: dict[str, Any] = {
        "place": str(place),
        "kind": "store" if found.stored else "recordings",
        "recordings": len(found.files),
        "usable": len(found.usable),
        "copies": sum(bool(file.copy) for file in found.files),
        "damaged": sum(bool(file.damage) for file in found.usable),
        "bytes": size,
        "campaigns": campaigns,
        "environment": [asdict(check) for check in checks],
    }
    lines = [_head(found, size)]
    for part in campaigns:
        lines += _lines(part)
    lines += ["this machine", *(f"  {check.state:<8}{check.what:<30}{check.description}" for check in checks)]
    kept = analysed_campaign(place) if found.stored and not found.files else None
    if kept is not None:
        lines[0] = f"a store with the analysis of {kept}, made of grids: ready for 'pmg compare' and 'pmg report'"
        possible = True
    nothing = not possible or any(check.state == BAD for check in checks)
    if not possible:
        lines.append("nothing can be run with these recordings")
    return Outcome(data, tuple(lines), tuple(findings), failed=nothing)


_HOW = (
    "each read once, checksums compared, no sample decoded",
    "checksums compared, samples of runs in motion alone decoded",
)


def _head(found: Survey, size: int) -> str:
    how = "from the manifests of the store" if found.stored else _HOW[bool(found.moving)]
    damaged, copies = sum(bool(f.damage) for f in found.usable), sum(bool(f.copy) for f in found.files)
    unusable = sum(bool(f.unusable) and not f.copy for f in found.files)
    counts = f"{len(found.usable)} usable, {damaged} of them damaged, {unusable} not usable"
    counts += f", {copies} copied" if copies else ""
    return f"{counted(len(found.files), 'recording')}, {size / 1e6:.1f} MB: {counts} ({how})"


def _campaign(found: Survey, name: str, bench: BenchParameters) -> dict[str, Any]:
    points = found.points
    rehearsed = rehearse(points, bench) if points else None
    seen = None if rehearsed is None else audit(rehearsed, bench)
    design = Design.of(points)
    moving = bool(found.moving) and not design.neutral + design.engaged
    told = (zero_ability(design),) if moving else abilities(found, rehearsed, bench)
    told += motion_abilities(found.moving) if found.moving else ()
    return {
        "campaign": name,
        "points": asdict(design),
        "design": design.summary(),
        "without_set_points": sum(file.untold for file in found.usable),
        "chapters": [asdict(ability) for ability in told],
        "moving": list(motion_summary(found.moving)),
        "holes": [] if rehearsed is None else list(rehearsed.lacking),
        "mechanisms": None if seen is None else _mechanisms(seen),
    }


def _mechanisms(seen: Audit) -> dict[str, Any]:
    return {
        "told": audit_words(seen),
        "seen": sorted({row.candidate.identifier for row in seen.visible if not row.unseen}),
        "unseen": sorted({row.candidate.identifier for row in seen.visible if row.unseen}),
        "look_alikes": [
            {
                "ids": [pair.one.identifier, pair.other.identifier],
                "shafts": [pair.one.shaft, pair.other.shaft],
                "test": None if pair.plan is None else pair.plan.description,
            }
            for pair in seen.alike
        ],
    }


def _lines(part: dict[str, Any]) -> list[str]:
    lines = [f"campaign {part['campaign']}: {part['design']}"]
    if part["without_set_points"]:
        lines.append(f"  {counted(part['without_set_points'], 'recording')} without set-points: not counted here")
    lines += [f"  in motion: {line}" for line in part["moving"]]
    if part["moving"] and not (part["points"]["neutral"] or part["points"]["engaged"]):
        lines.append("  no steady point: the chapters of the steady grid are not possible")
    for row in part["chapters"]:
        lines.append(f"  {row['state']:<8}{row['chapter']:<30}{row['why']}")
        if row["unlock"]:
            lines.append(
                f"{'':<40}record: {row['unlock']}" if row["state"] != "unknown" else f"{'':<40}{row['unlock']}"
            )
    if part["mechanisms"] is not None:
        lines.append(f"  mechanisms, by set-points and a noise of 1 mN m: {part['mechanisms']['told']}")
        lines += [
            f"{'':<10}{' and '.join(f'{i} ({s})' for i, s in zip(pair['ids'], pair['shafts'], strict=True))}: "
            + (pair["test"] or "no known test tells them apart")
            for pair in part["mechanisms"]["look_alikes"]
        ]
    return lines
