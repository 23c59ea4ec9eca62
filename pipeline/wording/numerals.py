"""Numbers as people read them: proper minus signs, and the digits an uncertainty deserves."""

from __future__ import annotations

import math
from decimal import Context, Decimal

MISSING = "–"
"""Shown where there is no value."""

_MINUS = "−"
_WIDE = Context(prec=800)
"""Enough digits for any two doubles side by side."""
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_DEFAULT_SPEC = ".4g"
_FINEST = -7
"""Smallest power of ten written out before a common factor is taken."""
_COARSEST = 7


def number(value: float, digits: int | None = None, spec: str = "") -> str:
    """A number with a proper minus sign; an en dash for NaN.

    Parameters
    ----------
    value : float
        What to show.
    digits : int, optional
        Decimals after the point.
    spec : str
        Format of the standard library instead, such as ``.3g`` or ``+.1f``.

    Returns
    -------
    str
        Four significant digits when neither is given.
    """
    if math.isnan(value):
        return MISSING
    if math.isinf(value):
        return "∞" if value > 0 else f"{_MINUS}∞"
    text = format(value, spec or (f".{digits}f" if digits is not None else _DEFAULT_SPEC))
    mantissa, _, exponent = text.partition("e")
    if mantissa.startswith("-") and not mantissa.strip("-0.,"):
        mantissa = mantissa[1:]
    mantissa = mantissa.replace("-", _MINUS)
    return f"{mantissa}×{_power_of_ten(int(exponent))}" if exponent else mantissa


def measured(value: float, u: float) -> str:
    """A value and its standard uncertainty, both cut at the second significant digit of the uncertainty.

    Very large and very small numbers share one power of ten: ``(1.234 ± 0.012)×10⁻⁹``.

    Parameters
    ----------
    value : float
        Best estimate.
    u : float
        Standard uncertainty, zero or more.
    """
    if not (math.isfinite(value) and math.isfinite(u)) or u == 0.0:
        return MISSING if math.isnan(value) else f"{number(value)} ± {number(u)}"
    quantum = _quantum(u)
    shown = (Decimal(repr(value)).quantize(quantum, context=_WIDE), _rounded(u, quantum))
    finest, coarsest = quantum.adjusted(), max(part.adjusted() for part in shown if part)
    if finest >= _FINEST and coarsest < _COARSEST:
        return " ± ".join(_plain(part) for part in shown)
    scaled = " ± ".join(_plain(part.scaleb(-coarsest, context=_WIDE)) for part in shown)
    return f"({scaled})×{_power_of_ten(coarsest)}"


def _quantum(u: float) -> Decimal:
    """One unit of the second significant digit of ``u`` after rounding."""
    exact = Decimal(repr(u))
    quantum = Decimal(1).scaleb(exact.adjusted() - 1)
    carried = exact.quantize(quantum, context=_WIDE).adjusted() > exact.adjusted()
    return quantum.scaleb(1) if carried else quantum


def _rounded(u: float, quantum: Decimal) -> Decimal:
    return Decimal(repr(u)).quantize(quantum, context=_WIDE)


def _plain(part: Decimal) -> str:
    return format(part if part else abs(part), "f").replace("-", _MINUS)


def _power_of_ten(exponent: int) -> str:
    return f"10{str(exponent).translate(_SUPERSCRIPTS)}"
