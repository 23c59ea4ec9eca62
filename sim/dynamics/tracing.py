"""The equations of a drivetrain as formulas: its own code, run on symbols instead of numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from pmg.sim.dynamics.account import integrand_parts
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.state import STATES, SetPoints
from pmg.sim.dynamics.structure import parts, walk

if TYPE_CHECKING:
    from collections.abc import Callable


class _IsLess(sympy.Function):  # type: ignore[misc]  # untyped library
    """1 where the first number is less than the second, else 0; its jumps have no slope."""

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """None."""
        del argindex
        return sympy.Integer(0)


class _Lesser(sympy.Function):  # type: ignore[misc]  # untyped library
    """The lesser of two numbers, whose slope is that of the one it is: no branch to nest in another one."""

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """Share of that number in the slope."""
        first = _IsLess(*self.args)
        return first if argindex == 1 else 1 - first


_CALLS: dict[str, Callable[..., sympy.Expr]] = {
    "sin": sympy.sin,
    "cos": sympy.cos,
    "tanh": sympy.tanh,
    "sqrt": sympy.sqrt,
    "exp": sympy.exp,
    "log": sympy.log,
    "absolute": sympy.Abs,
    "minimum": _Lesser,
    "maximum": lambda a, b: -_Lesser(-a, -b),
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "true_divide": lambda a, b: a / b,
    "power": lambda a, b: a**b,
    "negative": lambda a: -a,
}


def _plain(value: Any) -> sympy.Expr:  # noqa: ANN401  (a number of any kind)
    """As a formula; whole and half numbers stay exact, so that powers are products and roots, and ones vanish."""
    if isinstance(value, _Traced):
        return value.formula
    number = float(value)
    return sympy.Rational(round(2.0 * number), 2) if (2.0 * number).is_integer() else sympy.Float(number, 17)


class _Traced:
    """A number that remembers how it was made; NumPy's functions and the operators work on it."""

    __slots__ = ("formula",)
    __array_priority__ = 1000.0

    def __init__(self, formula: sympy.Expr) -> None:
        self.formula = formula

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: object, **_: object) -> _Traced:
        if method != "__call__" or ufunc.__name__ not in _CALLS:
            raise TypeError(f"the equations use numpy.{ufunc.__name__}, which has no formula in {__name__}")
        return _Traced(_CALLS[ufunc.__name__](*(_plain(value) for value in inputs)))

    def __bool__(self) -> bool:
        if self.formula.is_positive:
            return True
        raise TypeError(f"the equations ask whether {self.formula} is zero; make that a flag of the constants")

    def __add__(self, other: object) -> _Traced:
        return _Traced(self.formula + _plain(other))

    def __radd__(self, other: object) -> _Traced:
        return _Traced(_plain(other) + self.formula)

    def __sub__(self, other: object) -> _Traced:
        return _Traced(self.formula - _plain(other))

    def __rsub__(self, other: object) -> _Traced:
        return _Traced(_plain(other) - self.formula)

    def __mul__(self, other: object) -> _Traced:
        return _Traced(self.formula * _plain(other))

    def __rmul__(self, other: object) -> _Traced:
        return _Traced(_plain(other) * self.formula)

    def __truediv__(self, other: object) -> _Traced:
        return _Traced(self.formula / _plain(other))

    def __rtruediv__(self, other: object) -> _Traced:
        return _Traced(_plain(other) / self.formula)

    def __pow__(self, other: object) -> _Traced:
        return _Traced(self.formula ** _plain(other))

    def __neg__(self) -> _Traced:
        return _Traced(-self.formula)


@dataclass(frozen=True)
class Formulas:
    """The equations as formulas in the symbols ``y``, ``a`` and ``p``.

    Parameters
    ----------
    state, asked, parameters : tuple of Symbol
        The 20 states, the four numbers of `SetPoints`, the parameters.
    rates : tuple of Expr
        Time derivative of each state.
    sums : tuple of Expr
        Powers that are summed over a run.
    """

    state: tuple[sympy.Symbol, ...]
    asked: tuple[sympy.Symbol, ...]
    parameters: tuple[sympy.Symbol, ...]
    rates: tuple[sympy.Expr, ...]
    sums: tuple[sympy.Expr, ...]


def formulas(drivetrain: Drivetrain) -> Formulas:
    """Formulas of the equations of motion and of the powers, by running them on symbols."""
    parameters: list[sympy.Symbol] = []

    def symbol(_: float) -> _Traced:
        parameters.append(sympy.Symbol(f"p{len(parameters)}", positive=True))
        return _Traced(parameters[-1])

    def ignore(_: str) -> None:
        return None

    constants, losses, coupling = parts(drivetrain)
    traced = object.__new__(Drivetrain)
    traced.__dict__.update(
        constants=walk(constants, symbol, ignore),
        losses=tuple(walk(law, symbol, ignore) for law in losses),
        coupling=walk(coupling, symbol, ignore),
    )
    state = tuple(sympy.Symbol(f"y{i}", real=True) for i in range(len(STATES)))
    asked = tuple(sympy.Symbol(f"a{i}", real=True) for i in range(len(SetPoints._fields)))
    on = [_Traced(y) for y in state]
    rates = traced.rates(on, SetPoints(*(_Traced(a) for a in asked)))
    sums = integrand_parts(traced, on)
    return Formulas(state, asked, tuple(parameters), tuple(map(_plain, rates)), tuple(_plain(value) for value in sums))
