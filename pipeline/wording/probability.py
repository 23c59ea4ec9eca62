"""How p-values are told: no further out than they are known."""

from __future__ import annotations

SMALLEST = 1e-12
"""Nominal p-values below this are told as below this: no tail is known further out."""


def told_nominal(p_value: float) -> str:
    """A p-value of a formula: ``= 0.03``, ``< 1e-12``."""
    return f"= {p_value:.2g}" if p_value >= SMALLEST else f"< {SMALLEST:.0g}"


def told_search(p_value: float, draws: int) -> str:
    """A p-value of the search over ``draws`` synthetic grids, no smaller than one in draws + 1: ``≤ 0.001``."""
    floor = 1.0 / (draws + 1.0)
    return f"≤ {floor:.1g}" if p_value <= floor * (1.0 + 1e-9) else f"= {p_value:.2g}"
