"""Recordings of a machine read, differentiated and thinned for the regression."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from scipy.io import loadmat
from scipy.io.matlab import MatReadError
from scipy.signal import decimate

from pmg.pipeline.diagnosis.balance.smoothing import Smoother
from pmg.pipeline.diagnosis.balance.term import Motion
from pmg.sim.errors import RecordingError, near_miss

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.case_file import Case
    from pmg.pipeline.diagnosis.balance.term import Motion, Term
    from pmg.sim.signals import Array

RATE_TOLERANCE = 0.01
"""Part by which a time step may differ from that of the stated rate."""

REST = 4.0
"""Standard deviations of the noise of the speed below which a machine counts as at rest."""

MATRIX_COLUMN = re.compile(r"(?P<variable>[^()]+)\(:, ?(?P<column>[0-9]+)\)")
"""A column of a matrix, as MATLAB writes it."""

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

    @property
    def coasts(self) -> bool:
        """Whether nothing drives the machine."""
        return not self.motion.force.any()

    @property
    def size(self) -> float:
        """Root of the sum of squares of the force; of that of the known terms where the machine coasts."""
        return float(np.linalg.norm(self.known if self.coasts else self.force + self.known))

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
    and every column of the regression are decimated by the same zero-phase filter. A speed that was recorded passes
    the same low-pass; where there is no position, it is the integral of it. The machine counts as at rest below
    `REST` standard deviations of what noise makes of the speed.

    References
    ----------
    A. Janot, M. Gautier, M. Brunot, 'Data Set and Reference Models of EMPS', 2019.
    """
    values = _channels(path, case)
    time, given = values["time"], case.prepare
    steps = np.diff(time) * given.rate_hz
    wrong = np.flatnonzero(np.abs(steps - 1.0) > RATE_TOLERANCE)
    if len(wrong):
        came = f"{len(wrong)} of {len(steps)} steps differ from 1/{given.rate_hz:g} s, "
        came += f"the first after {time[wrong[0]]:g} s"
        raise RecordingError(f"{path}: time", came, "even sampling at prepare.rate_Hz", "Correct rate or unit of time.")
    smoother = Smoother(given, float((time[-1] - time[0]) / max(len(time) - 1, 1)))
    drop = smoother.settles if given.drop is None else given.drop
    fewest = max(FEWEST * given.keep_every, 8 * given.order) + 2 * drop
    if len(time) < fewest:
        raise RecordingError(str(path), f"{len(time)} samples", f"{fewest} or more", "Record longer, or thin less.")
    position, speed, noise = smoother.moved(values.get("position"), values.get("velocity"))
    inner = slice(drop, -drop)
    motion = Motion(
        time[inner],
        position[inner],
        speed[inner],
        smoother.slope(speed)[inner],
        values.get("force", np.zeros_like(time))[inner],
        np.zeros(len(time) - 2 * drop),
        REST * noise if given.rest_speed is None else given.rest_speed,
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
    """Channels of a file in SI, all of one length and finite; without a force that is zero throughout."""
    table = _read(path)
    values = {}
    for kind, (channel, unit) in case.channels.items():
        factor = channel.factor
        if isinstance(factor, str):
            given = _column(path, table, factor)
            if len(given) != 1:
                came = f"{len(given)} values"
                raise RecordingError(f"{path}: {factor}", came, "one number", f"Give {case.axis.factor} as a number.")
            factor = float(given[0])
        values[kind] = _column(path, table, channel.name) * unit * factor
    if "force" in values and not values["force"].any() and "inertia" in case.fixed:
        del values["force"]  # it coasts
    lengths = {len(value) for value in values.values()}
    if len(lengths) > 1:
        came = ", ".join(f"{kind}: {len(value)}" for kind, value in values.items())
        raise RecordingError(str(path), f"channels of several lengths ({came})", "one length", "Export them together.")
    for kind, value in values.items():
        bad = np.flatnonzero(~np.isfinite(value))
        if len(bad):
            came = f"{len(bad)} values are no numbers, the first in row {bad[0] + 1}"
            raise RecordingError(
                f"{path}: {case.channels[kind][0].name}", came, "numbers", "Mend or cut the recording."
            )
        if float(np.ptp(value)) == 0.0:
            do = "Check the channel; of a machine that coasts, fix its inertia."
            raise RecordingError(f"{path}: {case.channels[kind][0].name}", "the same value throughout", "a signal", do)
    return values


def _read(path: Path) -> Mapping[str, np.ndarray[Any, Any]]:
    """Channels of a file as they stand there; words of a CSV file become numbers where they are asked for."""
    if not path.is_file():
        do = "Check record.folder, or name the folder of the recordings with --data."
        raise RecordingError(str(path), "no such file", "a recording (.mat or .csv)", do)
    kind = path.suffix.lower()
    try:
        if kind == ".mat":
            return {name: np.asarray(v) for name, v in loadmat(path).items() if not name.startswith("__")}
        if kind == ".csv":
            frame = pl.read_csv(path, infer_schema=False)
            return {name: frame[name].to_numpy() for name in frame.columns}
    except (ValueError, TypeError, NotImplementedError, MatReadError, pl.exceptions.PolarsError) as error:
        came = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise RecordingError(str(path), came, f"a readable {kind} file", "Export it anew (MATLAB: -v7).") from error
    raise RecordingError(str(path), f"a file of kind {kind or 'none'}", ".mat or .csv", "Convert the recording.")


def _column(path: Path, table: Mapping[str, np.ndarray[Any, Any]], name: str) -> Array:
    """A channel as numbers (n,); ``name(:,2)`` is the second column of a matrix."""
    asked = MATRIX_COLUMN.fullmatch(name)
    variable = name if name in table or asked is None else asked["variable"]
    if variable not in table:
        raise RecordingError(f"{path}: {name}", "no such channel", "a channel of the file", near_miss(name, table))
    found = table[variable]
    if found.dtype.kind == "O":
        found = _numbers(path, name, found)
    if found.dtype.kind not in "fiub":
        raise RecordingError(f"{path}: {name}", f"values of kind {found.dtype}", "numbers", "Correct the export.")
    shape = " x ".join(map(str, found.shape))
    if asked is not None and variable != name:
        column = int(asked["column"])
        if found.ndim != 2 or not 1 <= column <= found.shape[1]:
            raise RecordingError(f"{path}: {name}", f"a variable of {shape}", f"{column} columns", "Name one of them.")
        found = found[:, column - 1]
    if sum(n > 1 for n in found.shape) > 1:
        do = f'Name one of its columns: "{name}(:,1)".'
        raise RecordingError(f"{path}: {name}", f"a matrix of {shape}", "one row or column", do)
    return np.asarray(found, dtype=np.float64).ravel()


def _numbers(path: Path, name: str, words: np.ndarray[Any, Any]) -> Array:
    """Words of a column of a CSV file as numbers (n,); none is NaN."""
    column = pl.Series(words, dtype=pl.String).str.strip_chars()
    found = column.cast(pl.Float64, strict=False)
    bad = (found.is_null() & column.is_not_null() & (column != "")).arg_true()
    if len(bad):
        came = f"'{column[int(bad[0])]}' in row {int(bad[0]) + 1}"
        raise RecordingError(f"{path}: {name}", came, "a number", "Mend the row, or name another channel.")
    return found.fill_null(np.nan).to_numpy()
