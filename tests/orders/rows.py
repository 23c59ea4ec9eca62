"""Lines as the order analysis reports them, of a fit in the unit of its signal."""

from __future__ import annotations

from pmg.pipeline.orders.fit import Orders
from pmg.pipeline.orders.lines import Group, Line
from pmg.pipeline.orders.row import LineFit, Made, OrderRow, fitted_row

ANY = Group((Line(1, 0, "any"),), 1.0)


def row_of(orders: Orders, place: int, at: int = 0) -> OrderRow:
    """The line of that group in that signal."""
    made = Made(rate=1.0, per_sample=0.0, factor=1.0, counted=0.0, from_index=False, u_zero=0.0)
    return fitted_row("torque_sun", orders.groups[place] if orders.groups else ANY, LineFit.of(orders, at, place), made)
