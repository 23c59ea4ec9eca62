"""The texts that are compiled: the equations of one drivetrain, and the integrator that all drivetrains share."""

from __future__ import annotations

import ast
import inspect
from typing import TYPE_CHECKING

import sympy
from sympy.printing.pycode import PythonCodePrinter

from pmg.sim.dynamics import equations, rodas, run_values, segments, state
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pmg.sim.dynamics.tracing import Formulas

HEAD = '''"""Compiled by pmg: {what}; safe to delete."""

from __future__ import annotations

import math

import numpy as np
from numba import cfunc, njit, types

CACHE = {cache}
NONE, ONE, ROW = types.void, types.float64, types.Array(types.float64, 1, "C")
'''
_WHOLE = '@njit(cache=CACHE, nogil=True, error_model="numpy")\n'
_PART = '@njit(cache=CACHE, nogil=True, error_model="numpy", forceinline=True)\n'
"""Parts of the integrator that it calls at each step: put in place, so that a step costs no more than one function."""


def _decorator(given: str, makes: str) -> str:
    """What compiles a function of the equations, which the integrator calls by its address."""
    return f'@cfunc({makes}({given}), cache=CACHE, error_model="numpy")\n'


class _Printer(PythonCodePrinter):  # type: ignore[misc]  # untyped library
    """Formulas as Python that numba compiles: whole powers as products, roots as roots."""

    def _print_Pow(self, expr: sympy.Pow, rational: bool = False) -> str:  # noqa: N802  (name given by the library)
        base, exponent = expr.as_base_exp()
        if exponent.is_Integer and 2 <= int(exponent) <= 4 and base.is_Symbol:
            return "(" + "*".join([self._print(base)] * int(exponent)) + ")"
        if exponent == sympy.Rational(1, 2) or exponent == sympy.Float(0.5):
            return f"math.sqrt({self._print(base)})"
        if exponent == sympy.Rational(-1, 2) or exponent == sympy.Float(-0.5):
            return f"(1.0/math.sqrt({self._print(base)}))"
        return str(super()._print_Pow(expr, rational=rational))

    def _print__Lesser(self, expr: sympy.Function) -> str:  # noqa: N802  (name made by the library)
        return f"min({', '.join(map(self._print, expr.args))})"

    def _print__IsLess(self, expr: sympy.Function) -> str:  # noqa: N802  (name made by the library)
        less, more = map(self._print, expr.args)
        return f"(1.0 if {less} < {more} else 0.0)"


_PRINTER = _Printer({"fully_qualified_modules": True})


def _function(
    name: str,
    arguments: str,
    targets: Sequence[tuple[str, sympy.Expr]],
    inputs: Iterable[str],
    makes: str = "NONE",
) -> str:
    """A function that puts formulas into an array, common parts computed once."""
    common, whole = sympy.cse([expr for _, expr in targets], symbols=sympy.numbered_symbols("x"), order="none")
    used = {str(symbol) for expr in (*whole, *(part for _, part in common)) for symbol in expr.free_symbols}
    lines = [f"    {given} = {given[0]}[{given[1:]}]" for given in inputs if given in used]
    lines += [f"    {symbol} = {_PRINTER.doprint(part)}" for symbol, part in common]
    pairs = zip(targets, whole, strict=True)
    lines += [f"    {target} = {_PRINTER.doprint(expr)}" for (target, _), expr in pairs]
    rows = ", ".join("ROW" for _ in arguments.split(","))
    return f"{_decorator(rows, makes)}def {name}({arguments}):\n" + "\n".join(lines or ["    pass"]) + "\n\n\n"


def _elimination_order(pattern: set[tuple[int, int]], size: int) -> list[int]:
    """Order of diagonal pivots that creates little fill (Markowitz's count, updated as fill appears)."""
    left, filled, order = set(range(size)), set(pattern), []
    while left:
        rows = {k: [i for i in left if (i, k) in filled and i != k] for k in left}
        columns = {k: [j for j in left if (k, j) in filled and j != k] for k in left}
        pivot = min(sorted(left), key=lambda k: len(rows[k]) * len(columns[k]))
        filled |= {(i, j) for i in rows[pivot] for j in columns[pivot]}
        left.remove(pivot)
        order.append(pivot)
    return order


def _linear(pattern: Sequence[tuple[int, int]], size: int) -> tuple[str, int]:
    """Functions ``factor`` and ``solve`` of d I - J for a pattern of J, without a loop, and how many factors."""
    whole = set(pattern) | {(i, i) for i in range(size)}
    order = _elimination_order(whole, size)
    place = {k: at for at, k in enumerate(order)}
    at = {entry: n for n, entry in enumerate(pattern)}
    value: dict[tuple[int, int], str] = {}
    lines = []
    for i, j in sorted(whole):
        given = f"-j[{at[i, j]}]" if (i, j) in at else ""
        value[i, j] = f"m_{i}_{j}"
        lines.append(f"    m_{i}_{j} = {('d ' + given.replace('-', '- ')).strip() if i == j else given}")
    slots: dict[tuple[int, int], int] = {}
    lower: dict[int, list[int]] = {}
    upper: dict[int, list[int]] = {}
    for k in order:
        below = [i for i in order[place[k] + 1 :] if (i, k) in value]
        right = [j for j in order[place[k] + 1 :] if (k, j) in value]
        lower[k], upper[k] = below, right
        lines.append(f"    m_{k}_{k} = 1.0 / m_{k}_{k}")
        for i in below:
            lines.append(f"    m_{i}_{k} = m_{i}_{k} * m_{k}_{k}")
            for j in right:
                start = value.get((i, j))
                value[i, j] = f"m_{i}_{j}"
                lines.append(f"    m_{i}_{j} = {start + ' ' if start else ''}- m_{i}_{k} * m_{k}_{j}")
        for entry in ((k, k), *((i, k) for i in below), *((k, j) for j in right)):
            slots[entry] = len(slots)
    lines += [f"    lu[{slot}] = m_{i}_{j}" for (i, j), slot in slots.items()]
    text = f"{_decorator('ROW, ONE, ROW', 'NONE')}def factor(j, d, lu):\n" + "\n".join(lines) + "\n\n\n"
    ahead = [f"    b{k} = b[{k}]" for k in order]
    for k in order:
        ahead += [f"    b{i} -= lu[{slots[i, k]}] * b{k}" for i in lower[k]]
    for k in reversed(order):
        minus = "".join(f" - lu[{slots[k, j]}] * b{j}" for j in upper[k])
        ahead.append(f"    b{k} = (b{k}{minus}) * lu[{slots[k, k]}]")
    ahead += [f"    b[{k}] = b{k}" for k in range(size)]
    return text + f"{_decorator('ROW, ROW', 'NONE')}def solve(lu, b):\n" + "\n".join(ahead) + "\n\n\n", len(slots)


def _jacobian_formulas(given: Formulas) -> dict[tuple[int, int], sympy.Expr]:
    """Elements of the Jacobian that are not zero, by row and column."""
    found = {}
    for i, rate in enumerate(given.rates):
        for j, symbol in enumerate(given.state):
            if symbol in rate.free_symbols:
                slope = sympy.diff(rate, symbol)
                if slope != 0:
                    found[i, j] = slope
    return found


def integrator_text(cache: bool) -> str:
    """The module of the integrator; with `cache`, the compiled code is to be kept next to it."""
    kept = [_WHOLE + inspect.getsource(each) for each in (segments.follow, equations.evaluate, equations.solve_stage)]
    for node in ast.parse(inspect.getsource(rodas)).body:
        if isinstance(node, ast.FunctionDef):
            kept.append((_PART if node.name.startswith("_") else _WHOLE) + ast.unparse(node))
        elif isinstance(node, ast.Assign) or getattr(node, "module", "") in (run_values.__name__, state.__name__):
            kept.append(ast.unparse(node))
    head = HEAD.format(what="the integrator of the bench", cache=cache)
    return "\n\n".join((head, f"REVOLUTION = {REVOLUTION!r}", *kept)) + "\n"


def solver_text(given: Formulas, cache: bool) -> str:
    """The module of the equations of a drivetrain.

    Parameters
    ----------
    given : Formulas
        The equations.
    cache : bool
        Whether the compiled code is to be kept next to the module.
    """
    y, a, p = (tuple(map(str, symbols)) for symbols in (given.state, given.asked, given.parameters))
    inputs, size = (*y, *a, *p), len(given.state)
    jacobian = _jacobian_formulas(given)
    pattern = list(jacobian)
    linear, factors = _linear(pattern, size)
    v = [sympy.Symbol(f"v{k}", real=True) for k in range(len(a))]
    drift = [
        sum((sympy.diff(r, s) * w for s, w in zip(given.asked, v, strict=True)), sympy.Integer(0)) for r in given.rates
    ]
    phase = given.rates[state.STATES.index("phase")]
    sizes = (
        f"ENTRIES, FACTORS, SUMS = {len(pattern)}, {factors}, {len(given.sums)}\n"
        f"ROWS = {[i for i, _ in pattern]}\nCOLUMNS = {[j for _, j in pattern]}\n\n\n"
    )
    rates_of_set = [(f"out[{n}]", expr) for n, expr in enumerate(drift)]
    indexed = [(f"out[{n}]", expr) for n, expr in enumerate(given.rates)]
    powers = [(f"out[{n}]", e) for n, e in enumerate(given.sums)]
    slip = _function("slip_rate", "y, p", [("rate", phase)], (*y, *p), "ONE").rstrip() + "\n    return rate\n"
    return "".join(
        (
            HEAD.format(what="the equations of one structure of the bench", cache=cache),
            sizes,
            _function("rates", "y, a, p, out", indexed, inputs),
            _function("slopes", "y, a, p, out", [(f"out[{n}]", e) for n, e in enumerate(jacobian.values())], inputs),
            _function("drift", "y, a, v, p, out", rates_of_set, (*map(str, v), *inputs)),
            linear,
            _function("sums", "y, p, out", powers, (*y, *p)),
            slip,
        )
    )
