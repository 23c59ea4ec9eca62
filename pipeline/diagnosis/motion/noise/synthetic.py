"""Synthetic noise of the rows of a campaign in motion: what a search over them finds in it is chance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.mismatch import DRAWS
from pmg.pipeline.diagnosis.motion.noise.row_noise import wander_at_knots

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.motion.compressed import Compressed
    from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise
    from pmg.sim.signals import Array


def synthetic_noise(parts: Sequence[Compressed], noise: Sequence[RowNoise], rng: np.random.Generator) -> Array:
    """Synthetic noise of rows (m, draws), white but for what goes on from run to run and what follows an order.

    Parameters
    ----------
    parts : sequence of Compressed
        Each stretch in its coordinates, one after the other.
    noise : sequence of RowNoise
        Of each.
    rng : numpy.random.Generator
        Draws it.

    Notes
    -----
    Rows are white together with the noise that the angles are thought to make. Steps of the encoders are no white noise
    where they follow an order, as in a shaft that swings about a speed that is held: in place of that noise each draw
    mixes the ways in which counting anew makes them, alike in both balances of a run.
    """
    found: list[Array] = []
    taken: dict[str, Array] = {}
    for part, each, wander in zip(parts, noise, wander_at_knots(noise, rng, DRAWS), strict=True):
        if part.run not in taken:
            counted = part.of_steps.shape[1]
            taken[part.run] = rng.standard_normal((counted, DRAWS)) / np.sqrt(counted)
        of_wander = part.of_wander @ each.wander.covariance(each.knots) @ part.of_wander.T
        squares, vectors = np.linalg.eigh(np.eye(len(part.y)) - of_wander - part.of_angles)
        rest = vectors @ (np.sqrt(np.maximum(squares, 0.0))[:, None] * rng.standard_normal((len(part.y), DRAWS)))
        found.append(part.of_wander @ wander + rest + part.of_steps @ taken[part.run])
    return np.vstack(found)
