"""The baseline in motion: its constants fitted together with their data sheet, and its columns."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.held_out import solve
from pmg.pipeline.diagnosis.motion.constants import start_name
from pmg.pipeline.diagnosis.motion.rows import encoder_columns, linear_columns, rotor_state

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.pipeline.diagnosis.motion.rows import RotorRows, RotorState
    from pmg.sim.signals import Array

ITERATIONS = 8
"""Steps of Gauss and Newton at most."""

SETTLED = 0.02
"""Step over standard error below which the constants are settled."""


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
        Their amplitudes.
    """

    sheet: DataSheet
    values: Array
    stretches: tuple[RotorRows, ...]
    instruments: tuple[RotorRows, ...] = ()
    beside: tuple[Array, ...] = ()
    amounts: Array = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def clean(self) -> MotionBaseline:
        """The same constants on signals freed from noise, of which columns are made."""
        return MotionBaseline(self.sheet, self.values, self.instruments or self.stretches)

    @cached_property
    def states(self) -> tuple[RotorState, ...]:
        """State of the rotor of each stretch."""
        return tuple(rotor_state(stretch, self.sheet, self.values) for stretch in self.stretches)

    def predicted(self, place: int) -> Array:
        """Torque that the transducer of a stretch should show [N m], (n,)."""
        return self._predicted(self.states[place])

    def _at_fine(self, state: RotorState) -> Array:
        columns = linear_columns(state, self.sheet, self.values)
        return np.asarray(sum(self.values[self.sheet.at(name)] * column for name, column in columns.items()))

    def _predicted(self, state: RotorState) -> Array:
        return state.stretch.of_rows(self._at_fine(state))

    def missing(self, place: int) -> Array:
        """Measured torque of a stretch less that of the constants [N m], (n,)."""
        return self.stretches[place].torque - self.predicted(place)

    def left(self, place: int) -> Array:
        """The same less that of the mechanisms beside the constants [N m], (n,)."""
        other = self.stretches[place].of_rows(self.beside[place]) if self.beside else 0.0
        return np.asarray(self.missing(place) - other)

    def columns(self, place: int) -> Array:
        """Change of a stretch's torque per change of each constant (n, k)."""
        state = self.states[place]
        linear, found = linear_columns(state, self.sheet, self.values), np.zeros((len(state.stretch), len(self.sheet)))
        linear |= encoder_columns(state, self.sheet, self.values)
        found[:, [self.sheet.at(name) for name in linear]] = state.stretch.of_rows(np.stack(list(linear.values()), 1))
        for name in self._bent(state.stretch):
            at = self.sheet.at(name)
            step = 1e-3 * self.sheet.constants[at].spread if np.isfinite(self.sheet.spread[at]) else 1e-4
            ends = []
            for moved in (step, -step):
                values = self.values.copy()
                values[at] += moved
                ends.append(self._predicted(rotor_state(state.stretch, self.sheet, values)))
            found[:, at] = (ends[0] - ends[1]) / (2.0 * step)
        return found

    def _bent(self, stretch: RotorRows) -> tuple[str, ...]:
        """Constants to which the torque of a stretch is not proportional."""
        if stretch.at_rest:
            return ()
        if not stretch.coupled:
            return (f"compliance_{stretch.side}",)
        return ("compliance_sun", "compliance_ring", start_name(stretch.run.run.name))


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
) -> tuple[MotionBaseline, Array]:
    """The constants fitted to the rows together with their data sheet, and their covariance (k, k).

    Parameters
    ----------
    start : MotionBaseline
        Where the search starts.
    white : callable
        Whitens columns (n, j) of a stretch, given its place.
    extra : callable, optional
        Further columns (n, j) at the fine samples of each stretch of a baseline, whose amplitudes are free.
    """
    found, covariance = start, np.zeros((0, 0))
    known = np.isfinite(start.sheet.spread)
    for _ in range(ITERATIONS):
        blocks = []
        others = [] if extra is None else extra(found.clean)
        for place in range(len(found.stretches)):
            own = [found.stretches[place].of_rows(columns) for columns in others[place : place + 1]]
            parts = [found.clean.columns(place), *own, found.missing(place)[:, None]]
            blocks.append(white(place, np.hstack(parts)))
        prior = np.zeros((int(known.sum()), blocks[0].shape[1]))
        spread = found.sheet.spread[known]
        prior[np.arange(len(prior)), np.flatnonzero(known)] = 1.0 / spread
        prior[:, -1] = (found.sheet.expected - found.values)[known] / spread
        rows = np.vstack([*blocks, prior])
        moved = solve(rows[:, :-1], rows[:, -1])
        k = len(found.sheet)
        covariance = np.linalg.pinv(rows[:, :-1].T @ rows[:, :-1], rcond=1e-13, hermitian=True)
        beside = tuple(columns @ moved[k:] for columns in others)
        found = replace(found, values=found.values + moved[:k], beside=beside, amounts=moved[k:])
        if np.all(np.abs(moved[:k]) <= SETTLED * np.sqrt(np.diag(covariance)[:k]) + 1e-12):
            break
    return found, covariance
