"""Known reasons why a published figure does not come out of the rounded tables."""

from __future__ import annotations

from fnmatch import fnmatchcase

_GEAR = (
    "The 10.13 W of the power chain need c = 2.2965e-4 N m s/rad; table 6.9 prints 2.22e-4, which gives 9.79 W. Every "
    "figure that contains this loss differs by it; the rows with the other constant show what is left."
)
_MOTORS = (
    "As the thesis reckons its motors: a torque constant of 1.19 N m/A beside a back-EMF constant of 1.0219 V s/rad, "
    "which makes power in one motor and removes it in the other, and on the ring joule and friction losses that enter "
    "as gains. The figure follows from that, not from a motor."
)
_TORQUES = (
    "The printed torques follow one polynomial of degree four in speed to 0.14 mN m; ours run up to 2 mN m beside "
    "it. The terms of the thesis's curves are not printed: the interval holds for a cubic on the sun and a quartic "
    "on the ring, and other terms move the torques by as much as the rounding does."
)
_RUN = (
    "The speed answers with 8 rpm to each mN m. Counting the motor's rotor in the shaft, which the torque loop "
    "otherwise hides, lowers the speed after 20 s by 5 rpm, towards what is printed."
)
_SHARES = (
    "Between the transducers the bearings take 79 % at the highest speed and more below; with both motors counted 56 % "
    "there. No one sum of losses has both ends."
)
_TWICE = "The text rounds to 147 and 193 W; its own products of torque and speed are 144.93 and 190.90 W."
_BALANCE = (
    "83 % at the highest speed by the thesis's own powers and speeds; above 85 % at all but the two highest speeds."
)

NOTES: tuple[tuple[str, str], ...] = (
    ("chain*.motor-*", _MOTORS),
    ("chain*.share-motor-*", _MOTORS),
    ("chain*.electric-*", _MOTORS),
    ("chain*.eta-electric", _MOTORS),
    ("chain*.all", _MOTORS),
)
"""Pattern of ids, and what holds whether the figure comes out or not."""

REASONS: tuple[tuple[str, str], ...] = (
    (
        "grids.ring-1248-1.56",
        "Table 6.3 repeats the measured torque with more digits and has 1.5500 where table A.5 has 1.57. Its "
        "neighbours, 1.54 and 1.55, speak for 1.55.",
    ),
    (
        "grids.eta-magnetic",
        "From the rounded tables the rule gives a K_corr of 0.88, and at 0.90 one point or more is above 100 %: one "
        "unit of the last digit of a torque moves it further than that.",
    ),
    (
        "damping-*.c",
        "The rounded tables give more than is printed at every K_corr. It does not depend on the terms of the loss "
        "curves: with a cubic term in them their residual drops out of this fit. The power chain of section 6.4.3 "
        "needs a constant above the printed one, too.",
    ),
    (
        "damping-*.rmse",
        "Rounding of the torques to 0.01 N m alone scatters the loss power by 0.5 W rms, as much as the fit leaves.",
    ),
    (
        "damping-*.r-squared",
        "Judged by its distance from 1. Rounding of the torques alone scatters the loss power by 0.5 W rms.",
    ),
    ("damping-0.75.b", "Rounding decides whether b leaves its bound at this K_corr."),
    ("torques*.ratio", ""),
    ("torques*", _TORQUES),
    ("point*", _TORQUES),
    (
        "chain*.mechanical-in",
        "Printed as 190.87 W in the power chain and as 190.89 W in equation 6.7, whose printed factors give 190.90 W.",
    ),
    ("chain.*", _GEAR),
    ("printed.power-in", "0.9738 N m at 1872 rpm are 190.90 W; the power chain prints 190.87 W."),
    ("printed.eddy", _GEAR),
    ("steady.user", _TWICE),
    ("steady.input", _TWICE),
    ("steady.torque-*", _BALANCE),
    (
        "steady.eta-magnetic",
        "At this point 0.5875 N m bring 115.2 W; less 20.25 W in the sun bearings, the gear's 10.13 W leave 89.3 %. "
        "Said to be approximate, and read off a drawing.",
    ),
    ("steady.share-*", _SHARES),
    (
        "steady.difference*",
        "Rounding moves the efficiency of one measured point by up to 1.6 points, more than the means that are "
        "printed.",
    ),
    (
        "run*.settled",
        "485 rpm is called steady. The speed follows with a time constant of 8 s; after 20 s it is still 4 rpm short.",
    ),
    (
        "run*.locked",
        "All states start at zero, as written: in the middle of a magnetic well, where nothing has to lock. The drawn "
        "oscillation needs another start phase, and the height of the map, which is called scaled down; neither is "
        "given.",
    ),
    ("run*.loss", ""),
    ("run*", _RUN),
)
"""Pattern of ids, and why the figure may differ; the first that fits counts."""


def remarks_on(id_: str, *, differs: bool) -> tuple[str, ...]:
    """Remarks on a figure, whether or not it differs from what is printed."""
    lists = (NOTES, REASONS) if differs else (NOTES,)
    found = (next((text for pattern, text in known if fnmatchcase(id_, pattern)), "") for known in lists)
    return tuple(text for text in found if text)
