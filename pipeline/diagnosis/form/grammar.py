"""Short forms that a structure may have: products of one or two factors.

They carry no physics. A form has at most two factors, of at most two covariates, with at most two constants that enter
nonlinearly.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.form.atoms import ATOMS, DECAY, ONE, PLAIN, SIGN, SWING, Atom, FormCovariate, levels

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from pmg.sim.signals import Array

THINNED = 12
"""Constants of a factor in a product from which a fit starts, at most; alone it starts from all."""

MOST_CONSTANTS = 2
"""Constants of a form that enter nonlinearly, at most."""


@dataclass(frozen=True)
class Form:
    """A product of one or two factors.

    Parameters
    ----------
    factors : tuple of (Atom, Covariate)
        In the order in which they are written.
    """

    factors: tuple[tuple[Atom, FormCovariate], ...]

    @cached_property
    def name(self) -> str:
        """Unique among the forms of a location."""
        return " × ".join(
            atom.name if atom is ONE else f"{atom.name} of {covariate.symbol}" for atom, covariate in self.factors
        )

    @property
    def covariates(self) -> tuple[FormCovariate, ...]:
        """Covariates of the formula, each once."""
        return tuple({c.symbol: c for atom, c in self.factors if atom is not ONE}.values())

    @property
    def linear(self) -> int:
        """Constants that enter linearly."""
        return max(len(atom.branches) for atom, _ in self.factors)

    @property
    def nonlinear(self) -> int:
        """Constants that do not."""
        return sum(len(atom.constants) for atom, _ in self.factors)

    @property
    def searched(self) -> tuple[bool, ...]:
        """Which of the nonlinear constants are refined beyond the grid."""
        return tuple(atom.searched for atom, _ in self.factors for _ in atom.constants)

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of all constants, linear ones first."""
        linear = ("c",) if self.linear == 1 else ("a", "b")
        letters = [letter for atom, _ in self.factors for letter in atom.constants]
        return (*linear, *(f"{letter}{i}" for i, letter in enumerate(letters, start=1)))

    @property
    def units(self) -> tuple[str, ...]:
        """Units of all constants."""
        powers: dict[str, Fraction] = {}
        for atom, covariate in self.factors:
            powers[covariate.unit] = powers.get(covariate.unit, Fraction(0)) + atom.power
        below = [
            f"({unit})" if power == 1 else f"({unit})^({power})" if power.denominator > 1 else f"({unit})^{power}"
            for unit, power in powers.items()
            if power
        ]
        unit = "N m" + (f"/{below[0]}" if len(below) == 1 else f"/[{' '.join(below)}]" if below else "")
        return (*(unit,) * self.linear, *(c.unit for atom, c in self.factors for _ in atom.constants))

    def starts(self) -> Array:
        """Nonlinear constants from which fits start (g, k)."""
        grids = [atom.grid(c.values) for atom, c in self.factors]
        if len(grids) > 1:
            grids = [
                _thinned(grid) if atom.constants and atom is not SWING else grid
                for grid, (atom, _) in zip(grids, self.factors, strict=True)
            ]
        return np.array([np.concatenate(rows) for rows in product(*grids)])

    def places(self, which: int) -> Array:
        """Every value of a nonlinear constant that is not searched."""
        owners = [(atom, covariate) for atom, covariate in self.factors for _ in atom.constants]
        atom, covariate = owners[which]
        return np.asarray(atom.grid(covariate.values)[:, 0])

    def columns(self, constants: Array) -> Array:
        """Values (n, g, linear) per unit of the linear constants, for nonlinear constants (g, k)."""
        out: list[Array] | None = None
        first = 0
        for atom, covariate in self.factors:
            own = constants[:, first : first + len(atom.constants)].T
            first += len(atom.constants)
            branches = [
                np.broadcast_to(b, (len(b), len(constants))) for b in atom.value(covariate.values[:, None], *own)
            ]
            out = branches if out is None else [left * right for left in out for right in branches]
        assert out is not None
        return np.stack(out, axis=2)

    def formula(self, constants: Iterable[str] | None = None) -> str:
        """The form in the syntax of sympy, with the names of its constants or with what is given for them."""
        words = list(self.symbols if constants is None else constants)
        linear, rest = words[: self.linear], words[self.linear :]
        terms = [""]
        for atom, covariate in self.factors:
            own, rest = rest[: len(atom.constants)], rest[len(atom.constants) :]
            magnitude = f"Abs({covariate.symbol})" if covariate.signed else covariate.symbol
            lines = [b.format(*own, x=covariate.symbol, m=magnitude) for b in atom.branches]
            lines = [t[1:] if t.startswith("1/") else f"*{t}" for t in lines]
            terms = [f"{term}{t}" for term in terms for t in lines] if atom is not ONE else terms
        return " + ".join(f"{size}{term}" for size, term in zip(linear, terms, strict=True))


def _thinned(grid: Array) -> Array:
    if len(grid) <= THINNED or grid.shape[1] > 1:
        return grid
    return np.asarray(grid[np.linspace(0, len(grid) - 1, THINNED).astype(int)])


def text_of(formula: str) -> str:
    """A formula for people: powers raised, products with a dot, minus signs."""
    out = formula.replace("**", "^").replace("*", "·").replace("2·pi", "2π").replace("-", "−")
    return out.replace("Abs(", "abs(").replace("Heaviside(", "step(")


def forms(covariates: tuple[FormCovariate, ...]) -> tuple[Form, ...]:
    """Every form of these covariates; the first ones of the list lead, so pairs hold one of the first two."""
    found = [Form(((ONE, covariates[0]),))] if covariates else []
    for covariate in covariates:
        found += _of_one(covariate)
    for (i, first), (_, second) in combinations(enumerate(covariates), 2):
        if i < 2 and first.name != second.name:
            found += _of_two(first, second)
    return tuple(found)


def _possible(atom: Atom, covariate: FormCovariate) -> bool:
    """Whether the covariate has enough levels for the factor, and both signs for a sign."""
    if atom is SIGN:
        return covariate.signed
    if covariate.memory and atom not in PLAIN:
        return False
    return len(levels(np.abs(covariate.values))) >= 2 + len(atom.constants) + len(atom.branches)


def _of_one(covariate: FormCovariate) -> Iterator[Form]:
    able = [atom for atom in ATOMS if _possible(atom, covariate)]
    for atom in able:
        yield Form(((atom, covariate),))
        if covariate.signed and atom is not SIGN:
            yield Form(((SIGN, covariate), (atom, covariate)))
        if atom in PLAIN and DECAY in able:
            yield Form(((atom, covariate), (DECAY, covariate)))


def _of_two(first: FormCovariate, second: FormCovariate) -> Iterator[Form]:
    for left, right in product(ATOMS, ATOMS):
        nonlinear = len(left.constants) + len(right.constants)
        swings = (left is SWING) + (right is SWING)
        if nonlinear > MOST_CONSTANTS or swings > 1 or (swings and nonlinear > 1):
            continue
        if (first.memory or second.memory) and not (left in PLAIN and right in PLAIN):
            continue
        if _possible(left, first) and _possible(right, second):
            yield Form(((left, first), (right, second)))
