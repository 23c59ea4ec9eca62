"""Uncertainty carried through a formula: what differs from point to point, and what all points share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pmg.pipeline.fit.common_errors import CommonErrorSources
    from pmg.sim.signals import Array, Mask


@dataclass(frozen=True)
class Mean:
    """A mean over points and its two parts of standard uncertainty.

    Parameters
    ----------
    value : float
        The mean.
    independent : float
        What differs from point to point; falls with the root of their number.
    common : float
        What the points share; does not.
    points : int
        How many.
    """

    value: float
    independent: float
    common: float
    points: int

    @property
    def u(self) -> float:
        """Standard uncertainty, both parts together."""
        return float(np.hypot(self.independent, self.common))


@dataclass(frozen=True)
class Spread:
    r"""Uncertainty of q quantities at n points, as the effect of unit causes.

    Parameters
    ----------
    names : tuple of str
        The quantities.
    own : (q, n, 2) array
        Direct effect of one standard uncertainty of the point's own two torques, sun and ring.
    pull : (q, n, 2) array
        What the same does through the parameters that were fitted to it too.
    shared : dict of str to (q, n, r) array
        By group of inputs: what one standard uncertainty of each of r independent common causes does through that
        group. A cause that moves two groups stands in both, in the same place, so that their correlation is kept.
    without : tuple of (quantity, input)
        Inputs that have no stated uncertainty: what it may be is not in these figures.

    Notes
    -----
    First order (GUM 5.2.2): :math:`u^2(y) = \sum_{ij} c_i c_j u(x_i, x_j)`. With the covariance of the common inputs
    written as :math:`LL^T`, this is the sum of the squares of :math:`c^T L` over its columns, and sums or means of
    quantities are sums or means of these rows before they are squared.

    A reading that took part in a fit is correlated with it. The covariance of a quantity's direct part with what its
    own reading does to the fit, :math:`2\,\mathrm{own}\cdot\mathrm{pull}`, is counted with the independent part; it
    is negative for a residual. The independent part is taken as nothing where a reading all but fixes the fit by
    itself. In a mean, what a reading does to the other points' values through the fit is in the common part alone.
    """

    names: tuple[str, ...]
    own: Array
    pull: Array
    shared: dict[str, Array]
    without: tuple[tuple[str, str], ...] = ()

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups of common inputs."""
        return tuple(self.shared)

    def independent(self, name: str) -> Array:
        """Standard uncertainty that differs from point to point (n,)."""
        return np.asarray(np.sqrt(self._variance({name: 1.0})))

    def part(self, name: str, group: str) -> Array:
        """Standard uncertainty from one group of common inputs alone (n,)."""
        return np.asarray(np.linalg.norm(self.shared[group][self.names.index(name)], axis=-1))

    def common(self, name: str) -> Array:
        """Standard uncertainty that points share (n,), correlation between the groups included."""
        return np.asarray(np.linalg.norm(self._together(name), axis=-1))

    def u(self, name: str) -> Array:
        """Standard uncertainty, both parts together (n,)."""
        return np.hypot(self.independent(name), self.common(name))

    def total(self, weights: dict[str, float]) -> Array:
        """Standard uncertainty (n,) of a weighted sum of quantities of the same point."""
        shared = sum(weight * self._together(name) for name, weight in weights.items())
        return np.asarray(np.sqrt(self._variance(weights) + np.sum(np.square(shared), axis=-1)))

    def mean(self, name: str, values: Array, rows: Mask | slice = np.s_[:]) -> Mean:
        """Mean of a quantity over points.

        Parameters
        ----------
        name : str
            The quantity.
        values : (n,) array
            Its values.
        rows : mask or slice
            Which points.
        """
        shared, chosen = self._together(name)[rows], values[rows]
        independent = float(np.sqrt(np.sum(self._variance({name: 1.0})[rows]))) / len(chosen)
        return Mean(float(chosen.mean()), independent, float(np.linalg.norm(shared.mean(axis=0))), len(chosen))

    def lacking(self, name: str) -> tuple[str, ...]:
        """Inputs of a quantity that have no stated uncertainty."""
        return tuple(source for quantity, source in self.without if quantity == name)

    def _variance(self, weights: dict[str, float]) -> Array:
        """Variance of a weighted sum of quantities that differs from point to point (n,)."""
        zero = np.zeros(self.own.shape[1:])
        own = sum((weight * self.own[self.names.index(name)] for name, weight in weights.items()), zero)
        pull = sum((weight * self.pull[self.names.index(name)] for name, weight in weights.items()), zero)
        return np.asarray(np.maximum(np.sum(own**2 + 2.0 * own * pull, axis=-1), 0.0))

    def _together(self, name: str) -> Array:
        at = self.names.index(name)
        return np.asarray(sum((part[at] for part in self.shared.values()), np.zeros((*self.own.shape[1:-1], 1))))


def propagate_uncertainty(
    names: tuple[str, ...],
    by_torque: tuple[Array, Array],
    by_parameter: Array,
    causes: CommonErrorSources,
    constants: tuple[tuple[str, Array], ...] = (),
    without: tuple[tuple[str, str], ...] = (),
) -> Spread:
    """The spread of quantities from their derivatives.

    Parameters
    ----------
    names : tuple of str
        The q quantities.
    by_torque : tuple of two (q, n) arrays
        Derivatives to the point's own torque readings of sun and ring.
    by_parameter : (q, n, k) array
        Derivatives to the k fitted parameters of `causes`.
    causes : Causes
        What the n points share, restricted to them.
    constants : tuple of (group, (q, n) array)
        Effect of one standard uncertainty of each further constant.
    without : tuple of (quantity, input)
        Inputs without a stated uncertainty.
    """
    own = np.stack([direct * u for direct, u in zip(by_torque, causes.u, strict=True)], axis=-1)
    pull = np.stack(
        [
            np.einsum("qnk,kn->qn", by_parameter, influence) * u
            for influence, u in zip(causes.influence, causes.u, strict=True)
        ],
        axis=-1,
    )
    q, n = by_torque[0].shape
    transducers, fitted = len(causes.transducers), causes.root.shape[1]
    r = transducers + fitted + len(constants)
    shared = {"transducers": np.zeros((q, n, r))}
    for t, cause in enumerate(causes.transducers):
        shared["transducers"][:, :, t] = (
            by_torque[0] * cause.sun + by_torque[1] * cause.ring + by_parameter @ causes.moved[:, t]
        )
    for group, members in causes.groups:
        effect = np.zeros((q, n, r))
        effect[:, :, transducers : transducers + fitted] = by_parameter[:, :, members] @ causes.root[members]
        shared[group] = effect
    for i, (group, column) in enumerate(constants, transducers + fitted):
        shared.setdefault(group, np.zeros((q, n, r)))[:, :, i] = column
    return Spread(names, own, pull, shared, without)


def slope(function: Callable[[Array], Array], at: Array, step: Array | float) -> Array:
    """Central difference of a function of one input: exact for formulas up to the second degree in it."""
    return np.asarray((function(at + step) - function(at - step)) / (2.0 * np.asarray(step)))


def slopes(function: Callable[[Array], Array], at: Array, steps: Sequence[float]) -> Array:
    """Central differences (..., k) of a function of k numbers, one after the other."""
    columns = []
    for i, step in enumerate(steps):
        shift = np.zeros(len(at))
        shift[i] = step
        columns.append((function(at + shift) - function(at - shift)) / (2.0 * step))
    return np.stack(columns, axis=-1)
