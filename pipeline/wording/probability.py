"""Coverage of intervals, and how p-values are written: no further out than they are known."""

from __future__ import annotations

COVERAGE_FACTOR = 2.0
"""Factor of the expanded uncertainty U = 2u, about 95 %; error bars and bands reach as far."""
CONFIDENCE = 0.95
"""Probability that an interval, or an expanded uncertainty with its own factor, covers the value."""
SMALLEST = 1e-12
"""Nominal p-values below this are written as below this: no tail is known further out."""


def exact_interval(hits: int, of: int) -> tuple[float, float]:
    """Clopper and Pearson's interval of a rate, which holds the true one at least as often as it says."""
    from scipy import stats

    found = stats.binomtest(hits, of).proportion_ci(CONFIDENCE, method="exact")
    return float(found.low), float(found.high)


def nominal_p_text(p_value: float) -> str:
    """A p-value of a formula: ``= 0.03``, ``< 1e-12``."""
    return f"= {p_value:.2g}" if p_value >= SMALLEST else f"< {SMALLEST:.0g}"


def search_p_text(p_value: float, draws: int) -> str:
    """A p-value of the search over ``draws`` synthetic grids, no smaller than one in draws + 1: ``≤ 0.001``."""
    floor = 1.0 / (draws + 1.0)
    return f"≤ {floor:.1g}" if p_value <= floor * (1.0 + 1e-9) else f"= {p_value:.2g}"
