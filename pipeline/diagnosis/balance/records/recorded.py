"""Recordings ready for the regression: filtered and thinned, one after the other, known terms taken out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import butter, sosfiltfilt

from pmg.pipeline.diagnosis.balance.case import OUTPUT
from pmg.pipeline.diagnosis.balance.library.term import KNOWN, NOISY, OF_NONE, OUT, RECORDING, Motion
from pmg.pipeline.diagnosis.balance.records.consistency import check_known, check_seen
from pmg.pipeline.diagnosis.balance.records.smoothing import DECIMATION, kept
from pmg.pipeline.diagnosis.balance.records.standing import moves, rest_findings

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.library.term import Term
    from pmg.pipeline.recording.findings import Finding
    from pmg.sim.signals import Array, Mask

SLOW_PART = 0.2
"""Part of the band of the regression in which an acceleration counts as slow."""

REST = 4.0
"""Standard deviations of the noise of the speed below which a machine counts as at rest."""

ROUNDED = 2.0
"""Periods of the low-pass over which it rounds off how friction changes as a machine stops or sets out."""

SHORT = 20
"""Samples of a record up to which its acceleration is not parted."""

TURNS = 4
"""Times that known faults and a baseline beside them are taken anew: a baseline that hides one changes it."""

VANISHES = 1e-9
"""Part of a column that is left of it where it is the same throughout each recording, and only rounding remains."""


@dataclass(frozen=True)
class Recorded:
    """Recordings ready for the regression, one after the other.

    Parameters
    ----------
    names : tuple of str
        File names.
    motion : Motion
        At the full sample rate.
    keep_every : int
        Decimation.
    used : (t,) array of bool
        Thinned samples at which the machine does not stand; n of them.
    force : (n,) array
        Thinned force [N, N m], known terms taken out; zero of a machine that coasts.
    known : (n,) array
        Thinned force of the terms whose amplitude is known [N, N m].
    findings : tuple of Finding
        What was lost in reading them.
    own_zeros : bool
        Whether each recording has a zero of its own: the mean of each is then taken out of force and columns.
    baseline : (k,) array
        Amplitudes of the free terms of the baseline that `Motion.modelled` is made with.
    unsure : (n, u) array
        Thinned force of known terms that have an error, a standard error of each [N, N m].
    own_noise : (n,) array
        Standard deviation that a row has beside the noise of all [N, N m]; empty until it is known.
    """

    names: tuple[str, ...]
    motion: Motion
    keep_every: int
    used: Mask
    force: Array
    known: Array
    findings: tuple[Finding, ...] = ()
    own_zeros: bool = False
    baseline: Array = field(default_factory=lambda: np.zeros(0))
    unsure: Array = field(default_factory=lambda: np.zeros((0, 0)))
    own_noise: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def name(self) -> str:
        """What they are called together."""
        return self.names[0] if len(self.names) == 1 else f"{len(self.names)} recordings"

    def noise_of_rows(self, shared: float) -> Array:
        """Standard deviation of the noise of each row (n,) where all share some [N, N m]."""
        return np.hypot(shared, self.own_noise if len(self.own_noise) else np.zeros(len(self.force)))

    @property
    def coasts(self) -> bool:
        """Whether nothing drives the machine."""
        return not self.motion.force.any()

    @property
    def size(self) -> float:
        """Root of the sum of squares of the force; of that of the known terms where the machine coasts."""
        return float(np.linalg.norm(self.known if self.coasts else self.force + self.known))

    @property
    def starts(self) -> tuple[int, ...]:
        """Thinned sample that is used with which each recording begins."""
        return _starts_of([int(used.sum()) for used in self._used])

    @property
    def breaks(self) -> tuple[int, ...]:
        """Thinned sample that is used with which each stretch without a rest begins."""
        apart = np.flatnonzero(self.used)
        after_rest = np.flatnonzero(np.diff(apart) > 1) + 1
        return tuple(sorted({*self.starts, *after_rest.tolist()} - {len(apart)}))

    @property
    def _used(self) -> list[Mask]:
        """Which thinned samples of each recording are used."""
        lengths = np.diff([*self.motion.starts, len(self.motion.time)])
        return np.split(self.used, np.cumsum(-(-lengths // self.keep_every))[:-1])

    def thin(self, columns: Array) -> Array:
        """Every column filtered and decimated like the force (parallel filtering), within each recording."""
        parts = zip(np.split(columns, self.motion.starts[1:]), self._used, strict=True)
        return np.concatenate(
            [self._centred(kept(part, self.keep_every)[:: self.keep_every][used]) for part, used in parts]
        )

    def _centred(self, columns: Array) -> Array:
        """Without their mean, where each recording has a zero of its own."""
        if not self.own_zeros:
            return columns
        left = columns - columns.mean(axis=0)
        gone = np.linalg.norm(left, axis=0) < VANISHES * np.linalg.norm(columns, axis=0)
        return np.where(gone, 0.0, left)

    def slow(self, values: Array, *, thinned: bool = True) -> Array:
        """The slow part of a signal (n,), thinned or at the full rate, within each recording."""
        every, starts = (1, self.breaks) if thinned else (self.keep_every, self.motion.starts)
        low, least = butter(2, SLOW_PART / every, output="sos"), SHORT * every
        parts = np.split(values, starts[1:])
        return np.concatenate([sosfiltfilt(low, part) if len(part) > least else part for part in parts])

    def columns(self, term: Term[Motion], shape: float = float("nan")) -> Array:
        """Thinned columns of a term (n, amplitudes), per unit."""
        return self.thin(term.columns(self.motion, shape))

    @property
    def time(self) -> Array:
        """Time of the thinned samples [s]."""
        return self.at_rows(self.motion.time)

    @property
    def elapsed(self) -> Array:
        """Time of the thinned samples since their recording began [s]."""
        return self.at_rows(self.motion.elapsed)

    def at_rows(self, values: Array) -> Array:
        """Values at the thinned samples, not filtered."""
        parts = zip(np.split(values, self.motion.starts[1:]), self._used, strict=True)
        return np.concatenate([part[:: self.keep_every][used] for part, used in parts])

    def each(self) -> tuple[Recorded, ...]:
        """The recordings one by one."""
        m, ends = self.motion, (*self.motion.starts, len(self.motion.time))
        thin = (*self.starts, len(self.force))
        found = []
        for k, (name, used) in enumerate(zip(self.names, self._used, strict=True)):
            few = slice(*thin[k : k + 2])
            motion = m.part(slice(*ends[k : k + 2]))
            own = {key: getattr(self, key)[few] for key in ("force", "known", "unsure", "own_noise")}
            found.append(replace(self, names=(name,), motion=motion, used=used, **own))
        return tuple(found)


def _starts_of(lengths: Sequence[int]) -> tuple[int, ...]:
    """Place with which each of several parts begins."""
    return tuple(int(start) for start in np.cumsum([0, *lengths])[:-1])


def joined(motions: Sequence[Motion]) -> Motion:
    """Motions one after the other; time goes on from one to the next."""
    first, h = motions[0], motions[0].sample_time
    times, end = [], first.time[0]
    for motion in motions:
        times.append(motion.time - motion.time[0] + end)
        end = times[-1][-1] + h

    def whole(values: Callable[[Motion], Array]) -> Array:
        return np.concatenate([values(motion) for motion in motions])

    return Motion(
        np.concatenate(times),
        whole(lambda m: m.position),
        whole(lambda m: m.speed),
        whole(lambda m: m.acceleration),
        whole(lambda m: m.force),
        whole(lambda m: m.modelled),
        max(motion.rest_speed for motion in motions),
        _starts_of([len(motion.time) for motion in motions]),
        {key: whole(lambda m, key=key: m.besides[key]) for key in first.besides},  # type: ignore[misc]  # bound now
        max(motion.even_acceleration for motion in motions),
    )


def _referred(motion: Motion, case: Case, of: Recorded | None) -> Motion:
    """With the references of columns, of its own or of other recordings, and what begins at an angle of its own."""
    referred = motion.referred() if of is None else replace(motion, references=of.motion.references)
    turned = "position" in case.channels or (f"{OUTPUT}position" in case.channels and "velocity" not in case.channels)
    if turned:
        return referred
    own = np.searchsorted(motion.starts, np.arange(len(motion.time)), side="right") - 1.0
    recording: Array = (own if of is None else np.full(len(own), OF_NONE)).astype(np.float64)
    return replace(referred, besides={**referred.besides, RECORDING: recording})


def _noisy_part(recorded: Recorded) -> Array:
    """What is noise in the acceleration (n,).

    Between two torques all of its fast part: what acts there unrecorded moves the machine, too.
    """
    m = recorded.motion
    if OUT in m.besides:
        return m.acceleration - recorded.slow(m.acceleration, thinned=False)
    return m.besides.get(NOISY, np.zeros_like(m.acceleration))


def with_known(
    names: Sequence[str], motion: Motion, case: Case, findings: Sequence[Finding], of: Recorded | None = None
) -> Recorded:
    """Recordings with what the baseline gives, and with the known terms taken out of the force.

    The baseline is fitted to them, or is that of other recordings. What it gives is freed from noise of the
    acceleration: the force that its columns are to explain holds that noise, too.
    """
    every = case.prepare.keep_every
    spoilt = max(round(ROUNDED / case.prepare.low_pass_hz / motion.sample_time), DECIMATION * every)
    used = moves(motion, spoilt)
    few = np.concatenate([part[::every] for part in np.split(used, motion.starts[1:])])
    stands = rest_findings(", ".join(names), motion, used)
    plain = Recorded(tuple(names), motion, every, few, motion.force, motion.force, (*findings, *stands), case.own_zeros)
    motion = _referred(motion, case, of)
    terms = {term.key: term for term in case.library}
    columns = {key: terms[key].columns(motion, float("nan"))[:, 0] for key in case.baseline}
    known = np.zeros_like(motion.force)
    for key, value in case.fixed.items():
        known = known + value * columns[key]
    plain = replace(plain, motion=motion)
    check_known(plain.name, motion, case)
    known = known + sum(each.of(motion) for each in case.known if not each.term.of_model)
    found = _freed(plain, case, columns, known, of)
    faults, distorted = [each for each in case.known if each.term.of_model], np.zeros_like(known)
    for _ in range(TURNS if faults else 0):  # each distorts what the rest gives, which is known better each time
        rest = replace(found.motion, modelled=found.motion.modelled - distorted)
        distorted = np.asarray(sum(each.of(rest) for each in faults))
        found = _freed(plain, case, columns, known + distorted, of)
    seen = [e for e in case.known if e.error > 0.0 and not (e.term.needs_drive and found.coasts)]
    unsure = [found.thin(e.error * e.term.columns(found.motion, e.shape)) for e in seen]
    return replace(found, unsure=np.hstack([np.zeros((len(found.force), 0)), *unsure]))


def inertia_of(case: Case, amplitudes: Array) -> float:
    """Inertia of a baseline whose free terms have some amplitudes (k,) [kg, kg m2]; zero without one."""
    freed = [key for key in case.baseline if key not in case.fixed]
    return float({**case.fixed, **dict(zip(freed, amplitudes, strict=True))}.get("inertia", 0.0))


def _freed(plain: Recorded, case: Case, columns: Mapping[str, Array], known: Array, of: Recorded | None) -> Recorded:
    """Recordings with a known force (n,) taken out, and what the baseline gives by the columns of its terms (n,)."""
    motion, freed = plain.motion, [key for key in case.baseline if key not in case.fixed]
    free = np.stack([columns[key] for key in freed], axis=1)
    few = plain.thin(np.c_[motion.force, known, free])
    if case.own_zeros:
        check_seen(plain.name, few[:, 2:], freed)
    rest = few[:, 0] - few[:, 1]
    found = replace(
        plain, motion=replace(motion, besides={**motion.besides, KNOWN: known}), force=rest, known=few[:, 1]
    )
    amplitudes = of.baseline if of is not None else np.asarray(np.linalg.lstsq(few[:, 2:], rest, rcond=None)[0])
    return modelled_by(found, case, free, amplitudes)


def modelled_by(
    recorded: Recorded, case: Case, free: Array, amplitudes: Array, further: Array | None = None
) -> Recorded:
    """Recordings with what the rest gives, which a fault of the drive or of a reading distorts.

    By columns (n, k) of the free terms of the baseline at the full rate, and their amplitudes; and further forces (n,).
    """
    motion = recorded.motion
    modelled = motion.besides[KNOWN] + free @ amplitudes - inertia_of(case, amplitudes) * _noisy_part(recorded)
    modelled = modelled if further is None else modelled + further
    return replace(recorded, motion=replace(motion, modelled=modelled), baseline=amplitudes)
