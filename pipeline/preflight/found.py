"""Content of a place: the test points asked for, the recordings they are from, all of them together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.recording.auxiliary_channels import COILS

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.motion.stored import JudgedRun
    from pmg.pipeline.recording.run_records import Setpoints
    from pmg.sim.shafts import PerShaft


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

    @property
    def key(self) -> tuple[str, float, str]:
        """The part that is the same in two files of one run."""
        return self.campaign, self.started_at, self.point


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
    sha256 : str
        Hash of its bytes; empty where it could not be read.
    copy : str
        The file before it that has the same bytes; empty where there is none.
    moving : tuple of JudgedRun
        Its runs in motion.
    nominal : PerShaft of float or None
        Nominal torques that its calibration states [N m]; None where it is not known.
    """

    name: str
    size: int
    points: tuple[Asked, ...] = ()
    unusable: str = ""
    damage: str = ""
    channels: tuple[str, ...] = ()
    untold: bool = False
    campaign: str = ""
    sha256: str = ""
    copy: str = ""
    moving: tuple[JudgedRun, ...] = ()
    nominal: PerShaft[float] | None = None

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
        """Recordings that give something, each once."""
        return tuple(file for file in self.files if not file.unusable and not file.copy)

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
        """Test points of all usable recordings, in the order of time; of a run in two files those of the first."""
        every, first = [p for file in self.usable for p in file.points], dict[tuple[str, float, str], str]()
        for point in every:
            first.setdefault(point.key, point.file)
        kept = every if self.stored else [p for p in every if p.file == first[p.key]]
        return tuple(sorted(kept, key=lambda p: (p.started_at, p.point)))

    @property
    def moving(self) -> tuple[JudgedRun, ...]:
        """Runs in motion of all usable recordings, in the order of time; one in two files counts once."""
        every = [run for file in self.usable for run in file.moving]
        once = {(run.record.started_at_s, run.record.point): run for run in reversed(every)}
        return tuple(once[key] for key in sorted(once))

    def recorded(self, word: str) -> int:
        """Recordings with a channel that begins or ends with a word."""
        return sum(any(c.startswith(word) or c.endswith(word) for c in file.channels) for file in self.usable)
