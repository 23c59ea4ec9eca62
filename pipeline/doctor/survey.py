"""What a place holds: recordings or a store, their test points and channels, and what is damaged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.inventory import find_recordings
from pmg.pipeline.orders.kept import kept_orders
from pmg.pipeline.recording import Severity, UnusableRecordingError
from pmg.pipeline.recording.beside import COILS
from pmg.pipeline.recording.calibration import SIDES, read_calibration
from pmg.pipeline.recording.container.contents import open_container
from pmg.pipeline.recording.container.gathered import FIELDS_KEY
from pmg.pipeline.recording.events import read_steps
from pmg.pipeline.recording.findings import Findings
from pmg.pipeline.recording.run import Setpoints, read_run
from pmg.pipeline.store import MARK, Store
from pmg.sim.grid import Configuration

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.events import Step
    from pmg.pipeline.recording.run import RunInfo
    from pmg.pipeline.store import Manifest

STEPS = "/test/step"
TEMPERATURES = "/daq/temperature/"
INDEX = "/index"
NEEDED = {
    **{f"torque of the {side}": ((f"/daq/torque_{side}/frequency", f"/daq/torque_{side}/edges"),) for side in SIDES},
    **{f"angle of the {side}": ((f"/daq/encoder_{side}/count",),) for side in SIDES},
}
"""Channels without which a recording gives nothing, each with the topics of which one will do."""


@dataclass(frozen=True)
class Asked:
    """A test point as it was asked for.

    Parameters
    ----------
    campaign, file, point : str
        Where it is from.
    configuration, drive : str
        ``neutral``, ``engaged`` or ``zero``; side that drives.
    gear : int
        1 or 2.
    setpoints : Setpoints
        Speeds [rad/s] and ring torque [N m].
    started_at : float
        Start [s since 1970, UTC].
    accepted : bool
        False where a window was judged and rejected.
    """

    campaign: str
    file: str
    point: str
    configuration: str
    drive: str
    gear: int
    setpoints: Setpoints
    started_at: float
    accepted: bool = True


@dataclass(frozen=True)
class File:
    """One recording.

    Parameters
    ----------
    name : str
        Its file.
    size : int
        Length [bytes].
    points : tuple of Asked
        Test points whose set-points are known.
    unusable : str
        Why it gives nothing; empty where it gives something.
    damage : str
        The first of what is lost or contradictory in it; empty for a sound one.
    channels : tuple of str
        Its topics.
    untold : bool
        Whether it names no set-points, so that its plateaus have to be found in the samples.
    campaign : str
        Campaign it belongs to; empty where that cannot be read.
    """

    name: str
    size: int
    points: tuple[Asked, ...] = ()
    unusable: str = ""
    damage: str = ""
    channels: tuple[str, ...] = ()
    untold: bool = False
    campaign: str = ""

    @property
    def coils(self) -> bool:
        """Whether search coils were recorded, or lines of theirs kept."""
        return any(name.startswith((COILS, "flux_")) for name in self.channels)


@dataclass(frozen=True)
class Survey:
    """A place.

    Parameters
    ----------
    place : Path
        Where it is.
    stored : bool
        Whether it is a store; else recordings.
    files : tuple of File
        Its recordings.
    """

    place: Path
    stored: bool
    files: tuple[File, ...]

    @property
    def usable(self) -> tuple[File, ...]:
        """Recordings that give something."""
        return tuple(file for file in self.files if not file.unusable)

    @property
    def campaigns(self) -> dict[str, int]:
        """Number of usable recordings by campaign, the largest first."""
        names = [file.campaign for file in self.usable]
        return {name: names.count(name) for name in sorted(set(names), key=lambda n: (-names.count(n), n))}

    def of(self, campaign: str) -> Survey:
        """The usable recordings of one campaign."""
        return Survey(self.place, self.stored, tuple(file for file in self.usable if file.campaign == campaign))

    @property
    def points(self) -> tuple[Asked, ...]:
        """Test points of all usable recordings, in the order of time."""
        return tuple(sorted((p for file in self.usable for p in file.points), key=lambda p: (p.started_at, p.point)))

    def recorded(self, word: str) -> int:
        """Recordings with a channel that begins or ends with a word."""
        return sum(any(c.startswith(word) or c.endswith(word) for c in file.channels) for file in self.usable)


def survey(place: Path, progress: Callable[[int, int, str], None] | None = None) -> Survey:
    """What a place holds.

    Parameters
    ----------
    place : Path
        A folder of recordings, one recording, or a store. Recordings are read once from end to end, their checksums
        compared; samples are not decoded. Of a store the manifests alone are read.
    progress : callable, optional
        Told (done, total, name) after each recording.

    Raises
    ------
    PmgError
        There is neither a recording nor a store.
    """
    if (place / MARK).is_file():
        store = Store(place)
        return Survey(place, True, tuple(_stored(store, manifest) for manifest in store.manifests()))
    paths, files = find_recordings(place), []
    base = place if place.is_dir() else place.parent
    for done, path in enumerate(paths, start=1):
        name = path.relative_to(base).as_posix()
        files.append(look(path, name))
        if progress is not None:
            progress(done, len(paths), name)
    return Survey(place, False, tuple(files))


def look(path: Path, name: str) -> File:
    """One recording, without its samples."""
    findings = Findings(name)
    size = path.stat().st_size if path.is_file() else 0
    try:
        container = open_container(path, lambda topic: topic == STEPS, findings)
    except UnusableRecordingError as error:
        return File(name, size, unusable=error.findings[-1].message)
    channels = _channels(container.topics)
    run = read_run(container.metadata, findings)
    calibration = read_calibration(container.attachments, findings)
    steps = read_steps(container.topics, findings)
    errors = [f"{f.where}: {f.message}" for f in findings.told() if f.severity == Severity.ERROR]
    absent = [what for what, kinds in NEEDED.items() if not any(t in channels for kind in kinds for t in kind)]
    if run is None or calibration is None or absent:
        why = errors[0] if run is None or calibration is None else f"no {' and no '.join(absent)}"
        return File(name, size, unusable=why, channels=channels)
    points = _points(run, steps, name, _rate(container.topics))
    damage = errors[0] if errors else ""
    return File(name, size, points, "", damage, channels, not points, run.campaign)


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


def _points(run: RunInfo, steps: tuple[Step, ...], name: str, rate: float) -> tuple[Asked, ...]:
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


def _stored(store: Store, manifest: Manifest) -> File:
    """A recording of a store, from its manifest and from the lines that the ingest kept."""
    document: Mapping[str, Any] = manifest.document
    errors = [f for f in document["findings"] if f["severity"] == Severity.ERROR]
    first = f"{errors[0]['where']}: {errors[0]['message']}" if errors else ""
    if not manifest.ingested:
        return File(document["file"], 0, unusable=first or "not usable")
    run, kept = document["run"], kept_orders(store, manifest)
    channels: tuple[str, ...] = ()
    if kept is not None:
        index = [f"/daq/encoder_{side}{INDEX}" for side, place in kept.document["index"].items() if place is not None]
        channels = (*kept.table["signal"].unique().sort().to_list(), *index)
    points = tuple(
        Asked(
            run["campaign"],
            document["file"],
            window["point"],
            window["configuration"],
            window["drive"],
            window["gear"],
            _asked_or_measured(window),
            window["started_at_s"],
            window["accepted"],
        )
        for window in document["windows"]
    )
    return File(document["file"], document["size"], points, "", first, channels, not points, run["campaign"])


def _asked_or_measured(window: Mapping[str, Any]) -> Setpoints:
    """Set-points of a window, with its means where it names none."""
    given, means = window["setpoints"], window["means"]
    found = {
        "speed_sun": means["sun"]["speed"],
        "speed_ring": means["ring"]["speed"],
        "torque_ring": means["ring"]["torque"] if window["configuration"] == Configuration.ENGAGED else None,
    }
    return Setpoints(**{name: found[name] if given[name] is None else given[name] for name in found})
