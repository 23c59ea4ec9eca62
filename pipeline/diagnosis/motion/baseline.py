"""The baseline in motion: its constants fitted together with their data sheet, and its columns."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from pmg.pipeline.diagnosis.motion.constants import start_name
from pmg.pipeline.diagnosis.motion.rows import held_beside, linear_columns, rotor_state, torque_of
from pmg.pipeline.diagnosis.motion.stance import encoder_columns, stance_columns

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.pipeline.diagnosis.motion.noise.turn_origins import TurnOrigins
    from pmg.pipeline.diagnosis.motion.rows import RotorRows, RotorState
    from pmg.pipeline.motion.lag import Lag
    from pmg.sim.signals import Array

ITERATIONS = 12
"""Steps of Gauss and Newton at most."""

HALVINGS, GROWS = 8, 1.05
"""Times a step is halved at most, and growth of the sum of squares from which on it is: a constant far off its data
sheet, or a large cause, bends the rows so much that a whole step leads away."""

SETTLED = 0.02
"""Step over standard error below which the constants are settled."""

OF_READING = ("zero", "skew", "ripple")
"""How the names of those constants begin that belong to the reading: a lag of the torque does not change them."""

STRAIGHT = 10.0
"""Step over standard error up to which the columns of the constants stay as they are: they change by a thousandth."""


@dataclass(frozen=True)
class MotionBaseline:
    """Constants of the bench in motion, and what they give for each stretch.

    Parameters
    ----------
    sheet : DataSheet
        What the constants are.
    values : (k,) array
        Their values.
    stretches : tuple of RotorRows
        Rows, one stretch after the other.
    instruments : tuple of RotorRows
        The same rows with signals freed from noise.
    beside : tuple of (n,) array
        Torque that mechanisms beside the baseline make at the fine samples of each stretch [N m]; none where empty.
    amounts : (a,) array
        Their amplitudes; of a lag, its time over that for which it was worked out.
    lags : tuple of Lag
        Transducers that lag.
    of_noise : tuple of (n,) array
        Torque that mechanisms make of the noise of the angles [N m]; `beside` is made of signals freed from it.
    stiffer : tuple of float
        Stiffness that mechanisms add to the magnetic spring on the rotor of each stretch, mean over the run [N m/rad];
        empty where none does.
    origins : tuple of TurnOrigins
        By what runs were aligned whose counters begin their turns anew.
    """

    sheet: DataSheet
    values: Array
    stretches: tuple[RotorRows, ...]
    instruments: tuple[RotorRows, ...] = ()
    beside: tuple[Array, ...] = ()
    amounts: Array = field(default_factory=lambda: np.zeros(0))
    lags: tuple[Lag, ...] = ()
    of_noise: tuple[Array, ...] = ()
    stiffer: tuple[float, ...] = ()
    origins: tuple[TurnOrigins, ...] = ()

    @cached_property
    def clean(self) -> MotionBaseline:
        """The same constants on signals freed from noise, of which columns are made."""
        stretches = self.instruments or self.stretches
        return MotionBaseline(self.sheet, self.values, stretches, lags=self.lags)

    @cached_property
    def states(self) -> tuple[RotorState, ...]:
        """State of the rotor of each stretch."""
        return tuple(rotor_state(stretch, self.sheet, self.values) for stretch in self.stretches)

    @property
    def held(self) -> MotionBaseline:
        """The same constants on the readings of shafts that are held while others turn, these freed from noise."""
        return MotionBaseline(self.sheet, self.values, held_beside(self.clean.stretches))

    def more_stiffness(self, place: int) -> float:
        """What mechanisms add to the magnetic spring on the rotor of a stretch [N m/rad]."""
        return self.stiffer[place] if self.stiffer else 0.0

    def predicted(self, place: int) -> Array:
        """Torque that the transducer of a stretch should show [N m], (n,)."""
        state = self.states[place]
        return self.stretches[place].of_rows(torque_of(state, linear_columns(state)))

    def missing(self, place: int) -> Array:
        """Measured torque of a stretch less that of the constants [N m], (n,)."""
        stretch = self.stretches[place]
        noise = stretch.of_rows(self.of_noise[place]) if self.of_noise else 0.0
        return np.asarray(stretch.torque - self.predicted(place) - noise)

    def left(self, place: int) -> Array:
        """The same less that of the mechanisms beside the constants [N m], (n,)."""
        other = self.stretches[place].of_rows(self.beside[place]) if self.beside else 0.0
        return np.asarray(self.missing(place) - other)

    def columns(self, place: int) -> Array:
        """Change of a stretch's torque per change of each constant (n, k)."""
        state = self.states[place]
        slopes = linear_columns(state)
        slopes |= encoder_columns(state) | stance_columns(state)
        fine, found = np.stack(list(slopes.values()), 1), np.zeros((len(state.stretch), len(self.sheet)))
        of_torque = [not name.startswith(OF_READING) for name in slopes]
        for lag in self.lags:
            if lag.side == state.stretch.side and not state.stretch.at_rest:
                fine[:, of_torque] = lag.of(fine[:, of_torque], state.stretch.run.fine_rate)
        found[:, [self.sheet.at(name) for name in slopes]] = state.stretch.of_rows(fine)
        return found


def start_baseline(sheet: DataSheet, stretches: tuple[RotorRows, ...]) -> MotionBaseline:
    """The baseline of the data sheet, with each pole angle where the torque of the gear puts it."""
    values = sheet.expected.copy()
    rough = MotionBaseline(sheet, values, stretches)
    for state in rough.states:
        if state.stretch.coupled and state.stretch.side == "ring":
            peak = sheet.poles.ring * values[sheet.at("pull_out")]
            carried = np.arcsin(np.clip(state.stretch.shaft.torque / peak, -1.0, 1.0))
            values[sheet.at(start_name(state.stretch.run.run.name))] = float(np.median(carried - state.pole_angle))
    return MotionBaseline(sheet, values, stretches)


def fit_baseline(
    start: MotionBaseline,
    white: Callable[[int, Array], Array],
    extra: Callable[[MotionBaseline], list[Array]] | None = None,
    spread: Array | None = None,
) -> tuple[MotionBaseline, Array]:
    """The constants fitted to the rows together with their data sheet, and their covariance (k, k).

    Parameters
    ----------
    start : MotionBaseline
        Where the search starts; with its amplitudes, where there are further columns.
    white : callable
        Whitens columns (n, j) of a stretch, given its place.
    extra : callable, optional
        Further columns (n, a + 1) at the fine samples of each stretch of a baseline; the amplitude of the last is 1.
    spread : (a,) array, optional
        Standard uncertainties of the other amplitudes about zero; infinite where they are free.

    Notes
    -----
    Steps of Gauss and Newton. Columns are made anew after a step that is large beside the standard errors, and such a
    step is halved while it makes the sum of squares grow.
    """
    amounts = np.zeros(0) if extra is None else start.amounts
    spread = np.full(len(amounts), np.inf) if spread is None else spread
    found, at, k = replace(start, beside=(), amounts=amounts), None, len(start.sheet)
    left = _whitened_left(found, white)
    for _ in range(ITERATIONS):
        if at is None:
            at = _linearised(found, white, extra, spread)
            found = at.beside(found, found.amounts)
            left = _whitened_left(found, white) if at.others else left
        along = at.of_sheet.T @ _off(found, spread)
        along += sum(columns.T @ rows for columns, rows in zip(at.columns, left, strict=True))
        moved = at.covariance @ along
        errors, part = np.sqrt(np.diag(at.covariance)[:k]), 1.0
        far = bool(np.any(np.abs(moved[:k]) > STRAIGHT * errors + 1e-12))
        before = _squares(found, spread, left)
        for _ in range(HALVINGS if far else 1):
            values, amounts = found.values + part * moved[:k], found.amounts + part * moved[k:]
            reached = at.beside(replace(found, values=values), amounts)
            left = _whitened_left(reached, white)
            if not far or _squares(reached, spread, left) < GROWS * before:
                break
            part *= 0.5
        found = reached
        if np.all(np.abs(moved[:k]) <= SETTLED * errors + 1e-12):
            break
        if far:
            at = None
    return found, (at or _linearised(found, white, extra, spread)).covariance


def _whitened_left(found: MotionBaseline, white: Callable[[int, Array], Array]) -> list[Array]:
    """What constants and mechanisms leave of each stretch, whitened (n,)."""
    return [white(place, found.left(place)[:, None])[:, 0] for place in range(len(found.stretches))]


def _off(found: MotionBaseline, spread: Array) -> Array:
    """What is known of constants and amplitudes less their values (s,), in its standard uncertainties."""
    return np.concatenate([found.sheet.off(found.values), -(found.amounts / spread)[np.isfinite(spread)]])


def _squares(found: MotionBaseline, spread: Array, left: list[Array]) -> float:
    """Sum of squares that is left, of the rows and of what is known."""
    off = _off(found, spread)
    return float(off @ off) + sum(float(rows @ rows) for rows in left)


@dataclass(frozen=True)
class _Linearised:
    """A baseline about some values of its constants, whitened.

    Parameters
    ----------
    columns : tuple of (n, k + a) array
        Of each stretch: change of its rows per change of the constants and of the amplitudes beside them.
    of_sheet : (s, k + a) array
        The same of what is known.
    others : tuple of (n, a + 1) array
        Columns of mechanisms at the fine samples, the last one of amplitude 1; empty without mechanisms.
    covariance : (k + a, k + a) array
        Of constants and amplitudes.
    """

    columns: tuple[Array, ...]
    of_sheet: Array
    others: tuple[Array, ...]
    covariance: Array

    def beside(self, found: MotionBaseline, amounts: Array) -> MotionBaseline:
        """A baseline with mechanisms of some amplitudes (a,) beside it."""
        return replace(found, beside=tuple(columns @ np.r_[amounts, 1.0] for columns in self.others), amounts=amounts)


def _linearised(
    found: MotionBaseline,
    white: Callable[[int, Array], Array],
    extra: Callable[[MotionBaseline], list[Array]] | None,
    spread: Array,
) -> _Linearised:
    others = () if extra is None else tuple(extra(found.clean))
    of_sheet = block_diag(found.sheet.rows, np.diag(1.0 / spread)[np.isfinite(spread)])
    columns = []
    for place, stretch in enumerate(found.stretches):
        own = [stretch.of_rows(each[:, :-1]) for each in others[place : place + 1]]
        columns.append(white(place, np.hstack([found.clean.columns(place), *own])))
    squares = of_sheet.T @ of_sheet + sum(each.T @ each for each in columns)
    length = np.sqrt(np.diag(squares))
    acting = np.flatnonzero(length)
    held = np.ix_(acting, acting)
    scale = np.outer(length[acting], length[acting])
    covariance = np.zeros_like(squares)
    covariance[held] = np.linalg.pinv(squares[held] / scale, rcond=1e-13, hermitian=True) / scale
    return _Linearised(tuple(columns), of_sheet, others, covariance)
