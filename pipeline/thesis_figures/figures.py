"""The published figures: what each is, its printed value and digits, and where it stands. Each is declared once."""

from __future__ import annotations

import math
from dataclasses import replace

from pmg.pipeline.thesis_figures.claim import Other, PublishedFigure, Unit
from pmg.pipeline.thesis_figures.tables import LOADS, SPEEDS, TORQUE_SUN, point_name
from pmg.sim import signals

NONE = Unit("")
WATT = Unit.of(signals.LOSS_TOTAL)
PERCENT = Unit.of(signals.EFFICIENCY_TOTAL)
SPEED = Unit.of(signals.SPEED_SUN)
TORQUE = Unit.of(signals.TORQUE_SUN)
SECOND = Unit("s")
HYSTERESIS = Unit.of(signals.RESIDUAL)
EDDY = Unit("1e-4 N m s/rad", 1e-4)
EXCESS = Unit("1e-3 N m (s/rad)^1/2", 1e-3)


def _several(
    rows: tuple[tuple[str, str, float, int, Unit], ...], group: str, place: str
) -> tuple[PublishedFigure, ...]:
    return tuple(PublishedFigure(f"{group}.{id_}", what, v, d, unit, place) for id_, what, v, d, unit in rows)


def _again(figures: tuple[PublishedFigure, ...], group: str, text: str) -> tuple[PublishedFigure, ...]:
    """The same figures under another assumption."""
    return tuple(replace(f, id=f"{group}.{f.id.partition('.')[2]}", what=f"{f.what} ({text})") for f in figures)


AT_IMPLIED = "c = 2.2965e-4"
"""Mark of rows that use the eddy constant which the power chain implies."""

DESIGN = (
    *_several(
        (
            ("ratio-1", "speed ratio of gear 1, magnitude", 2.6, 1, NONE),
            ("ratio-2", "speed ratio of gear 2, magnitude", 1.57, 2, NONE),
            ("pull-out-sun-1", "pull-out torque, gear 1, sun", 2.57, 2, TORQUE),
            ("pull-out-ring-1", "pull-out torque, gear 1, ring", 6.68, 2, TORQUE),
            ("pull-out-carrier-1", "pull-out torque, gear 1, carrier, magnitude", 9.25, 2, TORQUE),
            ("pull-out-sun-2", "pull-out torque, gear 2, sun", 3.46, 2, TORQUE),
            ("pull-out-ring-2", "pull-out torque, gear 2, ring", 5.43, 2, TORQUE),
            ("pull-out-carrier-2", "pull-out torque, gear 2, carrier, magnitude", 8.89, 2, TORQUE),
        ),
        "design",
        "table 3.1",
    ),
    *(
        PublishedFigure(
            f"design.share-{shaft}-{i}", f"bearing {i}: part of the {shaft}'s losses", v, 1, PERCENT, "table 5.2"
        )
        for shaft, first, values in (("sun", 1, (31.1, 45.6, 23.3)), ("ring", 3, (6.8, 35.4, 35.4, 13.3, 9.1)))
        for i, v in enumerate(values, first)
    ),
)

GRIDS = (
    PublishedFigure("grids.ratio", "ratio that the measured torques imply, dT_r/dT_s", 2.6, 1, NONE, "section 4.4.1"),
    PublishedFigure("grids.sun-624-1.56", "measured sun torque, 624 rpm, 1.56 N m", 0.7141, 4, TORQUE, "table 6.1"),
    PublishedFigure("grids.ring-624-1.56", "measured ring torque, 624 rpm, 1.56 N m", 1.5155, 4, TORQUE, "table 6.1"),
    PublishedFigure(
        "grids.ring-1248-1.56",
        "measured ring torque, 1248 rpm, 1.56 N m",
        1.5500,
        4,
        TORQUE,
        "table 6.3",
        other=Other(1.57, 2, "table A.5"),
    ),
    PublishedFigure(
        "grids.negative", "points with negative magnetic loss at K_corr = 1", 1, 0, NONE, "section 4.4.2", math.inf
    ),
    PublishedFigure("grids.rule", "K_corr by the rule: no negative magnetic loss", 0.90, 2, NONE, "section 4.2.4"),
    PublishedFigure(
        "grids.eta-magnetic",
        "largest measured magnetic efficiency at K_corr = 0.9",
        -math.inf,
        0,
        PERCENT,
        "section 4.2.4",
        100.0,
    ),
)


def _damping(k: str, b: float, c: float, r_squared: float, rmse: float) -> tuple[PublishedFigure, ...]:
    text, group, place = f"at K_corr {k}", f"damping-{k}", "table 6.8"
    return (
        PublishedFigure(f"{group}.b", f"hysteresis b {text}", b, 3, HYSTERESIS, place, size=0.570),
        PublishedFigure(f"{group}.c", f"eddy c {text}", c, 2, EDDY, place),
        PublishedFigure(f"{group}.d", f"excess d {text}", 0.0, 3, EXCESS, place, size=1.0),
        PublishedFigure(f"{group}.r-squared", f"R2 {text}", r_squared, 4, NONE, place, size=1.0 - r_squared),
        PublishedFigure(f"{group}.rmse", f"RMSE {text}", rmse, 4, WATT, place),
    )


DAMPING = (
    *_damping("0.90", 0.0, 1.04, 0.9230, 0.6243),
    *_damping("0.85", 0.0, 1.63, 0.9739, 0.4747),
    *_damping("0.80", 0.0, 2.22, 0.9910, 0.3449),
    *_damping("0.75", 0.570, 2.77, 0.9960, 0.2757),
)

_DIFFERENCES = tuple(
    PublishedFigure(
        f"torques.{name}", f"48 sun torques, {told} difference", 0.0, 4, TORQUE, "tables 6.2, 6.3", size=0.3722
    )
    for name, told in (("rms", "rms"), ("largest", "largest"))
)
TORQUES = (
    *_DIFFERENCES,
    *_again(_DIFFERENCES, "torques-implied", AT_IMPLIED),
    PublishedFigure("torques.ratio", "ratio that the 48 printed points imply", 2.6, 1, NONE, "tables 6.2, 6.3"),
)

POINTS = tuple(
    PublishedFigure(
        f"point.{point_name(speed, load)}",
        f"sun torque at {signals.SPEED_SUN.display(speed):.0f} rpm, load {load:.2f} N m",
        float(TORQUE_SUN[i, j]),
        4,
        TORQUE,
        "table 6.2" if i < 2 else "table 6.3",
    )
    for j, speed in enumerate(SPEEDS)
    for i, load in enumerate(LOADS)
)

_CHAIN = (
    *_several((("electric-in", "electric supply", 198.7, 1, WATT),), "chain", "section 6.4.3"),
    *_several(
        (
            ("motor-in", "loss of the sun motor", 7.83, 2, WATT),
            ("mechanical-in", "power into the gearbox", 190.87, 2, WATT),
            ("sun-bearings", "loss of the sun bearings", 20.25, 2, WATT),
            ("gear", "loss of the magnetic gear", 10.13, 2, WATT),
            ("ring-bearings", "loss of the ring bearings", 15.56, 2, WATT),
            ("mechanical-out", "power out of the gearbox", 144.93, 2, WATT),
            ("motor-out", "loss of the ring motor", 10.35, 2, WATT),
            ("electric-out", "useful electric power", 134.58, 2, WATT),
            ("relative-sun", "relative bearing, sun side", 4.72, 2, WATT),
            ("relative-ring", "relative bearing, ring side", 1.06, 2, WATT),
            ("eta-total", "total efficiency at 1872 rpm, 1.95 N m", 75.93, 2, PERCENT),
            ("eta-electric", "electric efficiency", 67.73, 2, PERCENT),
            ("all", "sum of all losses", 64.12, 2, WATT),
            ("share-motor-in", "share of all losses: sun motor", 12.21, 2, PERCENT),
            ("share-sun-bearings", "share of all losses: sun bearings", 31.58, 2, PERCENT),
            ("share-gear", "share of all losses: magnetic gear", 15.80, 2, PERCENT),
            ("share-ring-bearings", "share of all losses: ring bearings", 24.27, 2, PERCENT),
            ("share-motor-out", "share of all losses: ring motor", 16.16, 2, PERCENT),
            ("split-sun", "share of bearing losses: sun", 43.37, 2, PERCENT),
            ("split-relative", "share of bearing losses: relative", 16.14, 2, PERCENT),
            ("split-ring", "share of bearing losses: ring", 40.49, 2, PERCENT),
        ),
        "chain",
        "section 6.4.3",
    ),
)
CHAIN = tuple(
    replace(f, other=Other(190.89, 2, "equation 6.7")) if f.id == "chain.mechanical-in" else f for f in _CHAIN
)
PRODUCTS = (
    PublishedFigure(
        "printed.power-in",
        "product of the printed sun torque and speed",
        190.89,
        2,
        WATT,
        "equation 6.7",
        other=Other(190.87, 2, "figure 6.18"),
    ),
    PublishedFigure(
        "printed.eddy",
        "c that the printed loss of the magnetic gear implies",
        2.22,
        2,
        EDDY,
        "table 6.9",
        other=Other(2.2963, 3, "10.13 W at 1872 rpm, section 6.4.3"),
    ),
)

STEADY = (
    *_several(
        (
            ("total", "total loss", 46, 0, WATT),
            ("bearings", "bearing loss", 36, 0, WATT),
            ("gear", "loss of the magnetic gear", 10, 0, WATT),
            ("eta", "total efficiency", 76, 0, PERCENT),
            ("power-magnetic", "largest share of the magnetic gear in the loss power", 22, 0, PERCENT),
        ),
        "steady",
        "section 6.4.1",
    ),
    PublishedFigure(
        "steady.user", "power at the ring", 147, 0, WATT, "section 6.4.1", other=Other(144.93, 2, "equation 6.8")
    ),
    PublishedFigure(
        "steady.input", "power at the sun", 193, 0, WATT, "section 6.4.1", other=Other(190.87, 2, "figure 6.18")
    ),
    PublishedFigure(
        "steady.torque-share",
        "smallest share of the bearings in the loss torque",
        85,
        0,
        PERCENT,
        "section 6.4.1",
        until=math.inf,
        other=Other(83, 0, "the powers of section 6.4.3 over their speeds"),
    ),
    PublishedFigure(
        "steady.torque-magnetic",
        "largest share of the magnetic gear in the loss torque",
        15,
        0,
        PERCENT,
        "section 6.4.1",
        other=Other(17, 0, "the powers of section 6.4.3 over their speeds"),
    ),
    PublishedFigure(
        "steady.eta-magnetic",
        "smallest magnetic efficiency",
        88,
        0,
        PERCENT,
        "section 6.4.2",
        other=Other(89.3, 1, "table 6.2 at 1872 rpm with the losses of section 6.4.3"),
    ),
    PublishedFigure(
        "steady.eta-magnetic-next", "second smallest magnetic efficiency", 90, 0, PERCENT, "section 6.4.2", math.inf
    ),
    PublishedFigure(
        "steady.share-least",
        "smallest share of the bearings, motors left out",
        60,
        -1,
        PERCENT,
        "chapter 7",
        other=Other(78, 0, "what the 22 % of section 6.4.1 leave"),
    ),
    PublishedFigure(
        "steady.share-most", "largest share of the bearings, motors left out", 80, -1, PERCENT, "chapter 7"
    ),
    PublishedFigure(
        "steady.share-all",
        "share of the bearings at 1872 rpm, 1.95 N m, motors in",
        60,
        -1,
        PERCENT,
        "chapter 7",
        until=80,
    ),
    *(
        PublishedFigure(
            f"steady.difference-{load:.2f}",
            f"mean difference of the total efficiency, load {load:.2f} N m",
            value,
            2,
            PERCENT,
            "section 6.5.2",
        )
        for load, value in zip(LOADS, (0.50, 0.33, 0.27, 0.21), strict=True)
    ),
    PublishedFigure("steady.difference", "largest of these four", -math.inf, 1, PERCENT, "chapter 7", 0.5),
)

RUN = (
    PublishedFigure("run.sun", "sun speed after 20 s", 485, 0, SPEED, "section 6.3.2"),
    PublishedFigure("run.ring", "ring speed after 20 s", -187, 0, SPEED, "section 6.3.2"),
    PublishedFigure("run.power-in", "power into the magnetic gear after 20 s", 48.4, 1, WATT, "section 6.3.3"),
    PublishedFigure("run.power-out", "power out of the magnetic gear after 20 s", 47.7, 1, WATT, "section 6.3.3"),
    PublishedFigure("run.loss", "damping loss after 20 s", 0.7, 1, WATT, "section 6.3.3"),
    PublishedFigure("run.settled", "sun speed once it is steady", 485, 0, SPEED, "section 6.3.2"),
    PublishedFigure("run.locked", "gear locked from", 0.4, 1, SECOND, "section 6.3.1", 0.6),
)

MANY = ("point", "point-implied")
"""Groups of many figures of one kind, which a short table sums up."""

FIGURES: tuple[PublishedFigure, ...] = (
    *DESIGN,
    *GRIDS,
    *DAMPING,
    *TORQUES,
    *CHAIN,
    *_again(CHAIN, "chain-implied", AT_IMPLIED),
    *PRODUCTS,
    *STEADY,
    *RUN,
    *_again(RUN, "run-implied", AT_IMPLIED),
    *POINTS,
    *_again(POINTS, "point-implied", AT_IMPLIED),
)
"""Every figure, in the order of the report."""
