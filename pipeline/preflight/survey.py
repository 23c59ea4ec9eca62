"""A place looked through: recordings or a store, their test points and channels, and what is damaged."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from pmg.pipeline.grid.campaign import campaigns
from pmg.pipeline.grid.copies import without_copies
from pmg.pipeline.motion.judge import judge_motion
from pmg.pipeline.motion.stored import JudgedRun, judged_runs
from pmg.pipeline.orders.stored_lines import kept_orders
from pmg.pipeline.preflight.found import Asked, File, Survey
from pmg.pipeline.recording.calibration import read_calibration
from pmg.pipeline.recording.codes import Severity
from pmg.pipeline.recording.container.contents import open_container
from pmg.pipeline.recording.container.gathered import FIELDS_KEY
from pmg.pipeline.recording.events import read_steps
from pmg.pipeline.recording.findings import Code, Findings, UnusableRecordingError
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.recording.run import read_run
from pmg.pipeline.recording.run_records import Setpoints
from pmg.pipeline.recording.supplied import NOTHING, Supply
from pmg.pipeline.store.sources import find_recordings
from pmg.pipeline.store.store import MARK, Store
from pmg.sim.errors import StoreError
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, per_shaft

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.events import SequenceStep
    from pmg.pipeline.recording.run_records import RunInfo
    from pmg.pipeline.recording.supplied import Supplied
    from pmg.pipeline.store.manifest import Manifest, StoredWindow
    from pmg.sim.bench import BenchParameters

STEPS = "/test/step"
INDEX = "/index"
NEEDED = {
    **{f"torque of the {side}": ((f"/daq/torque_{side}/frequency", f"/daq/torque_{side}/edges"),) for side in SIDES},
    **{f"angle of the {side}": ((f"/daq/encoder_{side}/count",),) for side in SIDES},
}
"""Channels without which a recording gives no point, each with the topics of which one will do."""


def survey(
    place: Path, bench: BenchParameters, progress: Progress | None = None, supplied: Supplied = NOTHING
) -> Survey:
    """Content of a folder or a store.

    Parameters
    ----------
    place : Path
        A folder of recordings, one recording, or a store. Recordings are read once from end to end, their checksums
        compared; samples are decoded of runs in motion alone. Of a store the manifests alone are read.
    bench : BenchParameters
        Its machine.
    progress : callable, optional
        Told (done, total, name) after each recording.
    supplied : Supplied
        What is stated next to the recordings, used where they do not say it.

    Raises
    ------
    PmgError
        There is neither a recording nor a store.
    """
    if (place / MARK).is_file():
        return Survey(place, True, _files_of(Store(place)))
    paths, files = find_recordings(place), list[File]()
    base = place if place.is_dir() else place.parent
    known: dict[str, str] = {}
    for done, path in enumerate(paths, start=1):
        name = path.relative_to(base).as_posix()
        file = _look(path, name, bench, supplied)
        original = known.setdefault(file.sha256, name) if file.sha256 else name
        files.append(file if original == name else replace(file, copy=original))
        if progress is not None:
            progress(done, len(paths), name)
    return Survey(place, False, tuple(files))


def _look(path: Path, name: str, bench: BenchParameters, supplied: Supplied = NOTHING) -> File:
    """One recording, without its samples."""
    findings = Findings(name)
    supply = Supply(supplied, findings)
    size = path.stat().st_size if path.is_file() else 0
    try:
        container = open_container(path, lambda topic: topic == STEPS, findings)
    except UnusableRecordingError as error:
        return File(name, size, unusable=error.findings[-1].message)
    channels, sha256 = _channels(supply.channels(container.topics)), container.sha256
    before = len(findings.gathered)
    run = read_run(supply.run(container.metadata, path.stem), findings)
    calibration = read_calibration(supply.calibration(container.attachments), findings)
    refused = [f"{f.where}: {f.message}. {f.do}" for f in findings.gathered[before:] if f.severity == Severity.ERROR]
    if run is not None and run.manoeuvre.moves:
        return _look_moving(path, name, bench, supplied, channels)
    steps = read_steps(container.topics, findings)
    errors = [f"{f.where}: {f.message}" for f in findings.listed() if f.severity == Severity.ERROR]
    absent = [what for what, kinds in NEEDED.items() if not any(t in channels for kind in kinds for t in kind)]
    if run is None or calibration is None or absent:
        cut = next((f for f in findings.gathered if f.code is Code.TRUNCATED), None)
        if cut is not None:
            besides = [*refused[:1], *(f"no {what}" for what in absent)]
            why = " Besides: ".join([f"{cut.message}. {cut.do}", *("; ".join(besides),) * bool(besides)])
            return File(name, size, unusable=why, channels=channels, sha256=sha256)
        why = refused[0] if run is None or calibration is None else f"no {' and no '.join(absent)}"
        damage = next((known for known in errors if not any(why.startswith(known) for why in refused)), "")
        return File(name, size, unusable=why, damage=damage, channels=channels, sha256=sha256)
    points = _points(run, steps, name, _rate(container.topics))
    damage = errors[0] if errors else ""
    nominal = per_shaft(lambda side: calibration[side].nominal_torque)
    return File(name, size, points, "", damage, channels, not points, run.campaign, sha256, nominal=nominal)


def _look_moving(path: Path, name: str, bench: BenchParameters, supplied: Supplied, channels: tuple[str, ...]) -> File:
    """A recording of runs in motion, decoded: only its samples tell which shafts turn."""
    size = path.stat().st_size
    try:
        recording = read_recording(path, name, supplied, bench=bench)
    except UnusableRecordingError as error:
        return File(name, size, unusable=error.findings[-1].message, channels=channels)
    records, findings = judge_motion(recording, bench)
    run = recording.run
    moving = tuple(JudgedRun(run.configuration, run.drive, run.manoeuvre, record) for record in records)
    errors = [f for f in (*recording.findings, *findings) if f.severity == Severity.ERROR]
    damage = f"{errors[0].where}: {errors[0].message}" if errors else ""
    sha256 = recording.sha256
    return File(name, size, (), "", damage, channels, campaign=run.campaign, sha256=sha256, moving=moving)


def _channels(topics: Mapping[str, Topic]) -> tuple[str, ...]:
    """Topics with messages, and those that are fields of another one's messages."""
    found = {name for name, topic in topics.items() if topic.count}
    for topic in topics.values():
        for pair in topic.metadata.get(FIELDS_KEY, "").split(","):
            found.add(pair.partition("=")[2].strip())
        if topic.name.startswith("/daq/scan") and FIELDS_KEY not in topic.metadata:
            found |= {t for kinds in NEEDED.values() for kind in kinds for t in kind}
    return tuple(sorted(found - {""}))


def _rate(topics: Mapping[str, Topic]) -> float:
    """Sample rate that an encoder declares [Hz]; 0 where none does."""
    texts = [topic.metadata.get("rate_hz", "") for name, topic in topics.items() if name.startswith("/daq/encoder")]
    try:
        return max(map(float, filter(None, texts)), default=0.0)
    except ValueError:
        return 0.0


def _points(run: RunInfo, steps: tuple[SequenceStep, ...], name: str, rate: float) -> tuple[Asked, ...]:
    begin = run.started_at.timestamp()

    def asked(point: str, setpoints: Setpoints, seconds: float = 0.0) -> Asked:
        configuration = str(run.configuration)
        return Asked(run.campaign, name, point, configuration, run.drive, run.gear, setpoints, begin + seconds)

    measured = [step for step in steps if step.phase == "MEASURE"]
    if measured:
        first = measured[0].sample
        return tuple(asked(s.point, s.setpoints, (s.sample - first) / rate if rate else 0.0) for s in measured)
    if (
        run.setpoints.speed_sun is None
        and run.setpoints.speed_ring is None
        and run.configuration is not Configuration.ZERO
    ):
        return ()
    return (asked(run.point or name, run.setpoints),)


def _files_of(store: Store) -> tuple[File, ...]:
    """The recordings of a store; a window that two of them hold counts once, as in the analysis."""
    manifests = tuple(store.manifests())
    ingested = [m for m in manifests if m.ingested]
    named = campaigns(ingested)
    once = [m for n in named for m in without_copies([m for m in ingested if m.campaign == n])]
    return tuple(_stored(store, manifest) for manifest in (*once, *(m for m in manifests if not m.ingested)))


def _stored(store: Store, manifest: Manifest) -> File:
    """A recording of a store, from its manifest and from the lines that the ingest kept."""
    errors = [finding for finding in manifest.findings if finding.severity is Severity.ERROR]
    first = f"{errors[0].where}: {errors[0].message}" if errors else ""
    if not manifest.ingested:
        return File(manifest.file, 0, unusable=first or "not usable")
    try:
        kept = kept_orders(store, manifest)
    except StoreError as error:
        return File(manifest.file, 0, unusable=str(error))
    channels: tuple[str, ...] = ()
    if kept is not None:
        index = [f"/daq/encoder_{side}{INDEX}" for side, place in kept.document["index"].items() if place is not None]
        channels = (*kept.table["signal"].unique().sort().to_list(), *index)
    points = tuple(
        Asked(
            manifest.campaign,
            manifest.file,
            window.point,
            window.configuration,
            window.drive,
            window.gear,
            _asked_or_measured(window),
            window.started_at_s,
            window.accepted,
        )
        for window in manifest.windows
    )
    size, moving = manifest.size or 0, judged_runs([replace(manifest, windows=())])
    untold = not points and not moving
    nominal = per_shaft(lambda side: manifest.calibration[side].nominal_torque)
    of = manifest.campaign
    return File(manifest.file, size, points, "", first, channels, untold, of, moving=moving, nominal=nominal)


def _asked_or_measured(window: StoredWindow) -> Setpoints:
    """Set-points of a window, with its means where it names none."""
    asked, sun, ring = window.setpoints, window.means.sun, window.means.ring
    load = ring.torque if window.configuration is Configuration.ENGAGED else None
    return Setpoints(
        _known(sun.speed) if asked.speed_sun is None else asked.speed_sun,
        _known(ring.speed) if asked.speed_ring is None else asked.speed_ring,
        _known(load) if asked.torque_ring is None else asked.torque_ring,
    )


def _known(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value
