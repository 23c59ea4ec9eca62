"""The figures of a trial, each with its aim."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import binom, t

from pmg.pipeline.trials.score.rates import EDGES, DetectionCurve, Rate, count, fit_curve
from pmg.pipeline.trials.score.score import DiagnosisScore, Score

if TYPE_CHECKING:
    from collections.abc import Sequence

IN_LIBRARY = ("one", "two", "confounded")
"""Kinds whose every effect the library knows."""
ABOUT_ONE = (0.75, 1.5)
"""Sizes that count as about 1 sigma."""


@dataclass(frozen=True)
class Aim:
    """A range that a figure should lie in."""

    low: float = -math.inf
    high: float = math.inf

    def text(self, scale: float = 1.0, unit: str = "") -> str:
        """In words."""
        low, high = self.low * scale, self.high * scale
        if self.low == -math.inf:
            return f"at most {high:g}{unit}"
        return f"at least {low:g}{unit}" if self.high == math.inf else f"{low:g} to {high:g}{unit}"


@dataclass(frozen=True)
class Figured:
    """A figure with its interval and its aim.

    Parameters
    ----------
    id, what, unit : str
        What it is.
    value : float or None
        None where no campaign tells.
    interval : (low, high) or None
        At 95 %.
    of : int
        Campaigns behind it.
    hits : int or None
        For a rate, how many of them.
    aim : Aim or None
        Where it should lie.
    """

    id: str
    what: str
    unit: str
    value: float | None
    interval: tuple[float, float] | None
    of: int
    hits: int | None = None
    aim: Aim | None = None

    @property
    def shown(self) -> str:
        """Value and interval in words; rates in per cent."""
        if self.value is None:
            return "no campaign tells"
        scale, unit = self._scale
        ends = "" if self.interval is None else " ({:.3g} to {:.3g})".format(*(end * scale for end in self.interval))
        counted = f"{self.of} campaigns" if self.hits is None else f"{self.hits} of {self.of}"
        return f"{self.value * scale:.3g}{ends}{unit}, {counted}"

    @property
    def aim_shown(self) -> str:
        """The aim in words; empty without one."""
        return "" if self.aim is None else self.aim.text(*self._scale)

    @property
    def _scale(self) -> tuple[float, str]:
        if self.hits is not None:
            return 100.0, " %"
        return 1.0, f" {self.unit}" if self.unit else ""

    @property
    def met(self) -> bool | None:
        """Whether the aim is met: what the whole interval says; None without an aim, or where it allows either."""
        if self.aim is None or self.value is None or self.interval is None:
            return None
        low, high = self.interval
        if self.aim.low <= low and high <= self.aim.high:
            return True
        return False if high < self.aim.low or low > self.aim.high else None

    @property
    def state(self) -> str:
        """Whether the aim is met, in words; empty without one."""
        if self.aim is None:
            return ""
        return {True: "met", False: "not met", None: "cannot tell"}[self.met]

    @property
    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "id": self.id,
            "what": self.what,
            "unit": self.unit,
            "value": self.value,
            "interval": None if self.interval is None else [_finite(end) for end in self.interval],
            "hits": self.hits,
            "of": self.of,
            "aim": None if self.aim is None else [_finite(self.aim.low), _finite(self.aim.high)],
            "met": self.met,
        }


def detection(scores: Sequence[Score]) -> tuple[tuple[tuple[float, float, float, Rate], ...], DetectionCurve | None]:
    """Detected against size: bins (from, to, mean size, rate), and the likeliest curve; single effects only."""
    single = [
        score for score in scores if score.kind in ("one", "outside") and score.outcome is not DiagnosisScore.NOT_MADE
    ]
    size = np.array([score.reached for score in single])
    seen = np.array([score.detected for score in single], dtype=bool)
    bins = []
    for low, high in pairwise(EDGES):
        within = (size >= low) & (size < high)
        if within.any():
            bins.append((low, high, float(size[within].mean()), count(seen[within])))
    return tuple(bins), fit_curve(size, seen)


AIMS_IN_MOTION = {
    "size_50": None,
    "size_95": None,
    "located_at_1": Aim(low=0.9),
    "named_right_at_1": Aim(low=0.85),
    "right_or_set": Aim(low=0.95),
    "two_right": None,
    "confident_library": Aim(high=0.02),
    "confident_outside": Aim(high=0.05),
    "held_out": Aim(high=1.10),
    "parameter_error": None,
    "parameter_cover": None,
}
"""Aims of a trial of runs in motion where they are others, or none."""


def figures(scores: Sequence[Score], resolutions: Sequence[str], lifts: Sequence[str]) -> tuple[Figured, ...]:
    """Every figure, from the scores and from what further tests made of sets and of confounded designs."""
    made = [score for score in scores if score.outcome is not DiagnosisScore.NOT_MADE]
    clean = [score for score in made if score.kind == "clean"]
    library = [score for score in made if score.kind in IN_LIBRARY]
    outside = [score for score in made if score.kind == "outside"]
    one = [score for score in made if score.kind == "one"]
    about = [score for score in one if ABOUT_ONE[0] <= score.reached < ABOUT_ONE[1]]
    large = [score for score in one if score.reached >= ABOUT_ONE[0]]
    two = [score for score in made if score.kind == "two"]
    unclear = [score for score in made if score.recognised is not None]
    shown = [score for score in made if score.kind == "confounded" and score.recognised is None]
    seen_outside = [score for score in outside if score.detected]
    curve = detection(made)[1]
    right, either = (DiagnosisScore.RIGHT,), (DiagnosisScore.RIGHT, DiagnosisScore.RIGHT_SET)
    tested = [word for word in resolutions if word != "not tested"]
    wrong, alarm, out = (DiagnosisScore.WRONG,), (DiagnosisScore.FALSE_ALARM,), (DiagnosisScore.NOT_IN_LIBRARY,)
    errors = [score.held_out for score in made if score.held_out is not None]
    fitted = [score.parameter for score in made if score.parameter is not None]
    covers = [parameter.covers for parameter in fitted if parameter.covers is not None]
    places = [score.located for score in about if score.located is not None]
    many = f"one effect of {ABOUT_ONE[0]:g} sigma or more"
    return (
        _rate("false_alarm", "false alarms on clean campaigns", clean, alarm, Aim(high=0.05)),
        _size("size_50", curve, 0.50, Aim(high=0.17), len(one) + len(outside)),
        _size("size_95", curve, 0.95, Aim(high=0.30), len(one) + len(outside)),
        share("located_at_1", "located right, one effect of about 1 sigma", places),
        _rate("named_right_at_1", "named right, one effect of about 1 sigma", about, right, Aim(low=0.95)),
        _rate("named_right_above", f"named right, {many}", large, right),
        _rate("right_or_set", f"named right or in a set that holds it, {many}", large, either),
        _rate("two_right", "named right, two effects at once", two, right, Aim(low=0.85)),
        _rate("two_right_or_set", "named right or in a set that holds both, two effects", two, either),
        _rate("confident_library", "wrong and confident, effects of the library", library, wrong, Aim(high=0.01)),
        _rate("confident_outside", "wrong and confident, effects outside it", outside, wrong, Aim(high=0.04)),
        _rate("outside_told", "said not in library, effects outside it that were seen", seen_outside, out),
        middle("held_out", "error on withheld readings over the noise, median", errors, Aim(high=1.05)),
        middle("parameter_error", "relative error of a parameter, median", [p.relative for p in fitted], Aim(high=0.1)),
        share("parameter_cover", "95 % intervals of a parameter that hold the true value", covers, Aim(0.90, 0.98)),
        share(
            "confounded_told",
            "confounded design recognised, not guessed at",
            [bool(s.recognised) for s in unclear],
            Aim(low=1.0),
        ),
        _rate(
            "poor_shown",
            "poor design whose runs show the effect: named right or in a set that holds it",
            shown,
            either,
        ),
        share("resolved", "sets that the proposed test resolves", [word == "resolved" for word in tested]),
        share(
            "lifted",
            "hidden changes that the repeats of a confounded design bring to light",
            [word in ("resolved", "still a set") for word in lifts if word != "not tested"],
        ),
    )


def _rate(
    identifier: str, what: str, scores: list[Score], outcomes: tuple[DiagnosisScore, ...], aim: Aim | None = None
) -> Figured:
    return share(identifier, what, [score.outcome in outcomes for score in scores], aim)


def share(identifier: str, what: str, hits: Sequence[bool], aim: Aim | None = None) -> Figured:
    """A rate with its interval."""
    found = count(list(hits))
    return Figured(identifier, what, "", found.value, found.interval, found.of, found.hits, aim)


def _size(identifier: str, curve: DetectionCurve | None, probability: float, aim: Aim, of: int) -> Figured:
    what = f"size that is detected {probability:.0%} of the time"
    value = None if curve is None else curve.size(probability)
    return Figured(
        identifier, what, "sigma", value, None if curve is None else curve.interval(probability), of, None, aim
    )


def middle(identifier: str, what: str, values: Sequence[float], aim: Aim | None = None) -> Figured:
    """A median with its interval from order statistics."""
    if not values:
        return Figured(identifier, what, "", None, None, 0, None, aim)
    ordered = np.sort(np.array(values))
    interval = _order_interval(len(ordered))
    ends = None if interval is None else (float(ordered[interval[0]]), float(ordered[interval[1]]))
    return Figured(identifier, what, "", float(np.median(ordered)), ends, len(ordered), None, aim)


def mean(identifier: str, what: str, values: Sequence[float], aim: Aim | None = None) -> Figured:
    """A mean with Student's interval; none where all values are the same, as their scatter then tells nothing."""
    n = len(values)
    if not n:
        return Figured(identifier, what, "", None, None, 0, None, aim)
    middle_one, error = float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(n)) if n > 1 else 0.0
    half = float(t.ppf(0.975, n - 1)) * error if error else 0.0
    ends = (middle_one - half, middle_one + half) if error else None
    return Figured(identifier, what, "", middle_one, ends, n, None, aim)


def _order_interval(n: int) -> tuple[int, int] | None:
    """Places, from 0, of the values between which the median lies at 95 % or more; None for fewer than six values."""
    below = int(binom.ppf(0.025, n, 0.5))
    if below < 1:
        return None
    return below - 1, n - below


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
