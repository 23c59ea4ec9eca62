"""Known reasons why a published figure does not come out of the rounded tables."""

from __future__ import annotations

from fnmatch import fnmatchcase

GEAR_CONSTANT = (
    "The 10.13 W of the power chain need c = 2.2965e-4 N m s/rad; table 6.9 prints 2.22e-4, which gives 9.79 W. Every "
    "figure that contains this loss differs by it; the rows with the other constant show what is left."
)
"""Remark on what hangs on the eddy constant, of which the source states two."""

_MOTORS = (
    "As the thesis reckons its motors: a torque constant of 1.19 N m/A beside a back-EMF constant of 1.0219 V s/rad, "
    "which makes power in one motor and removes it in the other, and on the ring joule and friction losses that enter "
    "as gains. The figure follows from that, not from a motor."
)
_TORQUES = (
    "The printed torques follow one polynomial of degree four in speed to 0.14 mN m; ours run up to 2 mN m beside "
    "it. Which terms the source's curves have is not printed: the interval holds for a cubic on the sun and a quartic "
    "on the ring, and a quartic on the sun with a cubic on the ring moves the torques at 156 to 780 rpm by 0.2 to "
    "0.3 mN m."
)
_DAMPING = (
    "With bisquare weights on the means over the four loads, which the source does not state: it names least squares. "
    "Found by trying what gives its constants, R2 and RMSE at all four K_corr: all lie within 1.5 standard deviations "
    "of the rounding. Ruled out: least squares, whose c is 2.6 to 3.4 standard deviations too high at K_corr 0.80 to "
    "0.90 and changes by 11.21 +- 0.06 per unit of K_corr whatever the engaged torques were, where 11.8 +- 0.1 is "
    "printed. Worse: bisquare over the 48 points (RMSE at 0.75 off by 2.4), least absolute residuals (1.8)."
)
_RUN = (
    "The speed answers with 8 rpm to each mN m. With the loss look-ups recovered from the 48 printed torques it is "
    "488.7 rpm; with the motor's rotor counted in the sun's shaft besides, which the torque loop otherwise hides, "
    "484.7 +- 0.1 rpm, as printed. The chapter on the run in time has every choice."
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
    ("damping-*", _DAMPING),
)
"""Pattern of ids, and what holds whether the figure comes out or not."""

REASONS: tuple[tuple[str, str], ...] = (
    (
        "grids.ring-1248-1.56",
        "Table 6.3 repeats the measured torque with more digits and has 1.5500 where table A.5 has 1.57. Its "
        "neighbours, 1.54 and 1.55, speak for 1.55, which is used.",
    ),
    (
        "grids.eta-magnetic",
        "With the ring torques of tables 6.2 and 6.3 the rule gives a K_corr of 0.889, and at 0.90 one point or more "
        "is above 100 %: one unit of the last digit of a sun torque moves it further than that.",
    ),
    (
        "damping-*.rmse",
        "Rounding of the sun torques to 0.01 N m alone scatters the mean loss power by up to 0.3 W, as much as the fit "
        "leaves.",
    ),
    ("damping-*.r-squared", "Judged by its distance from 1; rounding of the sun torques alone moves it by more."),
    (
        "damping-*.[cd]",
        "Rounding of the sun torques decides which speed is left out, and with it b, c and d: b and d leave their "
        "bound in some draws.",
    ),
    ("damping-0.80.b", "Rounding decides whether b leaves its bound at this K_corr."),
    ("damping-0.75.b", "Rounding decides whether b leaves its bound at this K_corr."),
    ("torques*.ratio", ""),
    ("torques*", _TORQUES),
    ("point*", _TORQUES),
    (
        "chain*.mechanical-in",
        "Printed as 190.87 W in the power chain and as 190.89 W in equation 6.7, whose printed factors give 190.90 W.",
    ),
    ("chain.*", GEAR_CONSTANT),
    ("printed.power-in", "0.9738 N m at 1872 rpm are 190.90 W; the power chain prints 190.87 W."),
    ("printed.eddy", GEAR_CONSTANT),
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
        "Rounding of the sun torque moves the efficiency of one measured point by up to 1.1 points, more than the "
        "means that are printed.",
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
