"""Recordings of a machine read, differentiated and thinned for the regression."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from scipy.io import loadmat
from scipy.io.matlab import MatReadError
from scipy.signal import butter, decimate, filtfilt

from pmg.pipeline.diagnosis.balance.term import Motion
from pmg.sim.errors import RecordingError, near_miss

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.case_file import Case
    from pmg.pipeline.diagnosis.balance.term import Motion, Term
    from pmg.sim.signals import Array

RATE_TOLERANCE = 0.01
"""Part by which a time step may differ from that of the stated rate."""

FEWEST = 1000
"""Fewest samples of a regression; below, neither noise nor structure can be judged."""


@dataclass(frozen=True)
class Recorded:
    """A recording ready for the regression.

    Parameters
    ----------
    name : str
        File name.
    motion : Motion
        At the full sample rate.
    keep_every : int
        Decimation.
    force : (n,) array
        Thinned force [N], known terms taken out.
    known : (n,) array
        Thinned force of the terms whose amplitude is known [N].
    """

    name: str
    motion: Motion
    keep_every: int
    force: Array
    known: Array

    def thin(self, columns: Array) -> Array:
        """Every column filtered and decimated like the force (parallel filtering)."""
        return _thin(columns, self.keep_every)

    def columns(self, term: Term[Motion], shape: float = float("nan")) -> Array:
        """Thinned columns of a term (n, amplitudes) [N per unit]."""
        return self.thin(term.columns(self.motion, shape))

    @property
    def time(self) -> Array:
        """Time of the thinned samples [s]."""
        return np.asarray(self.motion.time[:: self.keep_every])


def _thin(columns: Array, keep_every: int) -> Array:
    """Filtered without phase and decimated along the first axis."""
    if keep_every == 1:
        return columns
    return np.asarray(decimate(columns, keep_every, axis=0, zero_phase=True))


def read_recording(path: Path, case: Case) -> Recorded:
    """A recording read and prepared the way its case says.

    Raises
    ------
    RecordingError
        When the file or a channel is missing, not finite, of another rate, or too short.

    Notes
    -----
    Position passes a zero-phase Butterworth low-pass, speed and acceleration are central differences of it, and force
    and every column of the regression are decimated by the same zero-phase filter.

    References
    ----------
    A. Janot, M. Gautier, M. Brunot, 'Data Set and Reference Models of EMPS', 2019.
    """
    values = _channels(path, case)
    time, position, force = values["time"], values["position"], values["force"]
    given = case.prepare
    steps = np.diff(time) * given.rate_hz
    wrong = np.flatnonzero(np.abs(steps - 1.0) > RATE_TOLERANCE)
    if len(wrong):
        came = f"{len(wrong)} of {len(steps)} steps differ from 1/{given.rate_hz:g} s, "
        came += f"the first after {time[wrong[0]]:g} s"
        raise RecordingError(f"{path}: time", came, "even sampling at prepare.rate_Hz", "Correct rate or unit of time.")
    fewest = max(FEWEST * given.keep_every, 8 * given.order) + 2 * given.drop
    if len(time) < fewest:
        raise RecordingError(str(path), f"{len(time)} samples", f"{fewest} or more", "Record longer, or thin less.")
    h = float((time[-1] - time[0]) / (len(time) - 1))
    b, a = butter(given.order, given.low_pass_hz, fs=1.0 / h)
    smooth = filtfilt(b, a, position)
    speed, acceleration = np.zeros_like(smooth), np.zeros_like(smooth)
    speed[1:-1] = (smooth[2:] - smooth[:-2]) / (2.0 * h)
    acceleration[1:-1] = (speed[2:] - speed[:-2]) / (2.0 * h)
    inner = slice(given.drop, -given.drop)
    motion = Motion(
        time[inner],
        position[inner],
        speed[inner],
        acceleration[inner],
        force[inner],
        np.zeros(len(time) - 2 * given.drop),
        given.rest_speed_m_s,
    )
    return _with_model(path.name, motion, case)


def _with_model(name: str, motion: Motion, case: Case) -> Recorded:
    """The recording with what the baseline gives, and with the known terms taken out of the force."""
    terms = {term.identifier: term for term in case.library}
    columns = {key: terms[key].columns(motion, float("nan"))[:, 0] for key in case.baseline}
    known = np.zeros_like(motion.force)
    for key, value in case.fixed.items():
        known = known + value * columns[key]
    free = np.stack([columns[key] for key in case.baseline if key not in case.fixed], axis=1)
    thinned = _thin(np.c_[motion.force, known, free], case.prepare.keep_every)
    rest = thinned[:, 0] - thinned[:, 1]
    solution = np.linalg.lstsq(thinned[:, 2:], rest, rcond=None)[0]
    return Recorded(
        name, replace(motion, modelled=known + free @ solution), case.prepare.keep_every, rest, thinned[:, 1]
    )


def _channels(path: Path, case: Case) -> dict[str, Array]:
    """Time, position and force of a file in SI, all of one length and finite."""
    table = _read(path)
    values = {}
    for kind, channel in case.channels.items():
        values[kind] = _column(path, table, channel.name) * channel.scale
        factor = channel.factor
        if isinstance(factor, str):
            given = _column(path, table, factor)
            if len(given) != 1:
                came = f"{len(given)} values"
                raise RecordingError(f"{path}: {factor}", came, "one number", "Give newton_per_unit as a number.")
            factor = float(given[0])
        values[kind] = values[kind] * factor
    lengths = {len(value) for value in values.values()}
    if len(lengths) > 1:
        came = ", ".join(f"{kind}: {len(value)}" for kind, value in values.items())
        raise RecordingError(str(path), f"channels of several lengths ({came})", "one length", "Export them together.")
    for kind, value in values.items():
        bad = np.flatnonzero(~np.isfinite(value))
        if len(bad):
            came = f"{len(bad)} values are no numbers, the first in row {bad[0] + 1}"
            raise RecordingError(f"{path}: {case.channels[kind].name}", came, "numbers", "Mend or cut the recording.")
        if float(np.ptp(value)) == 0.0:
            raise RecordingError(
                f"{path}: {case.channels[kind].name}", "the same value throughout", "a signal", "Check the channel."
            )
    return values


def _read(path: Path) -> dict[str, Array]:
    if not path.is_file():
        do = "Check record.folder, or name the folder of the recordings with --data."
        raise RecordingError(str(path), "no such file", "a recording (.mat or .csv)", do)
    kind = path.suffix.lower()
    try:
        if kind == ".mat":
            return {name: np.asarray(v) for name, v in loadmat(path).items() if not name.startswith("__")}
        if kind == ".csv":
            frame = pl.read_csv(path)
            return {name: frame[name].to_numpy() for name in frame.columns}
    except (ValueError, TypeError, NotImplementedError, MatReadError, pl.exceptions.PolarsError) as error:
        came = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise RecordingError(str(path), came, f"a readable {kind} file", "Export it anew (MATLAB: -v7).") from error
    raise RecordingError(str(path), f"a file of kind {kind or 'none'}", ".mat or .csv", "Convert the recording.")


def _column(path: Path, table: dict[str, Array], name: str) -> Array:
    if name not in table:
        raise RecordingError(f"{path}: {name}", "no such channel", "a channel of the file", near_miss(name, table))
    if table[name].dtype.kind not in "fiub":
        raise RecordingError(f"{path}: {name}", f"values of kind {table[name].dtype}", "numbers", "Correct the export.")
    return np.asarray(table[name], dtype=np.float64).ravel()
