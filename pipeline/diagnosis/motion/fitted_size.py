"""The size of a named mechanism as one number, with what its law adds to its uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from pmg.pipeline.diagnosis.balance.fitting import fit_term
from pmg.pipeline.diagnosis.motion.candidates.beside import lags_of
from pmg.pipeline.diagnosis.motion.constants import SKEW
from pmg.pipeline.motion.lag import EQUAL_LAGS, FIRST_ORDER, Lag
from pmg.pipeline.wording.numerals import measured
from pmg.pipeline.wording.units import MILLI, SMALL
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
    from pmg.pipeline.diagnosis.balance.library.term import Term
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array

LIKELY_LAW = 0.5
"""Part of a cause's gain that another law of the same mechanism must have for its size to count as possible."""

LIKELY_WHEN_LATE = 0.98
"""The same of what comes late, whose time the rows tell closely."""

FORM_OF_LAG = 0.02
"""Relative standard uncertainty of the time of a lag from its form: it is told from a skew by the second power of a
frequency, to which sampling, its order and the damping of a coupling add a little."""

IN_ALL = "in all"
"""Name of a size that is a sum."""

IN_MILLI = {"N m": "mN m", "N m/s": "mN m/s", "s": "ms", "rad": "mrad"}
"""Units of which small sizes are given in thousandths."""


@dataclass(frozen=True)
class FittedSize:
    """The size of a mechanism.

    Parameters
    ----------
    name : str
        What it is the size of; empty where the mechanism has no other.
    value, error : float
        Size and its standard error, in SI units; of the error, `of_law` is what comes from the law not being known.
    unit : str
        SI unit; 1 without one.
    of_law : float
        Range of the sizes by the laws that the mechanism may have, which counts as a standard uncertainty: the true law
        may be none of them.
    remark : str
        What follows the number.
    poles : PerShaft of int, optional
        Of a torque on the pole angle: pole pairs of the rotors, each of which feels it as many times.
    """

    name: str
    value: float
    error: float
    unit: str
    of_law: float = 0.0
    remark: str = ""
    poles: PerShaft[int] | None = None

    @property
    def sentence(self) -> str:
        """As people read it."""
        small = self.unit in IN_MILLI and abs(self.value) < SMALL
        scale, unit = (MILLI, IN_MILLI[self.unit]) if small else (1.0, self.unit)

        def told(times: int = 1) -> str:
            number = measured(times * self.value / scale, times * self.error / scale)
            return number if unit == "1" else f"{number} {unit}"

        noise = math.sqrt(max(self.error**2 - self.of_law**2, 0.0))
        form = (
            f"the form of the law, not known, makes {self.of_law / scale:.2g} of the error, noise {noise / scale:.2g}"
        )
        of_rotors = () if self.poles is None else self.poles.items()
        rotors = ", ".join(f"{told(times)} on the {side} rotor" for side, times in of_rotors)
        where = f" on the pole angle ({rotors})" if rotors else ""
        size = f"{self.name} {told()}".lstrip()
        return f"Fitted: {size}{self.remark}{where}{f'; {form}' if self.of_law else ''}."


def fitted_size(
    fit: TermFit, values: Array, covariance: Array, poles: PerShaft[int], of_law: float = 0.0
) -> FittedSize:
    """The size of a fitted mechanism: the amplitude of a wave, the time of a delay, the sum, or what is known best.

    Parameters
    ----------
    fit : TermFit
        The mechanism.
    values, covariance : (p,) and (p, p) array
        Its parameters, amplitudes then shape, and their covariance.
    poles : PerShaft of int
        Pole pairs of the rotors.
    of_law : float
        What its law adds to the standard error of a sum or a delay.
    """
    term, count = cast("MotionTerm", fit.candidate), len(fit.amplitudes)
    felt = poles if term.of_pole_angle else None
    remark = ""
    if term.whole:
        (quantity,), error = term.parameters[count:], math.sqrt(float(covariance[count, count]))
        if term.is_lag:
            told = lags_of((fit,))[0].told_from_delay
            error = math.hypot(
                error, FORM_OF_LAG * fit.shape if told else SKEW
            )  # else its skew stays on its data sheet
        lag, error = float(values[count]), math.hypot(error, of_law)
        remark = _corner(lag, error, term.sharpness if term.is_lag else EQUAL_LAGS) if _lags(term) else ""
        return FittedSize(quantity.name, lag, error, quantity.unit, of_law, remark, felt)
    sizes, among = values[:count], covariance[:count, :count]
    names = [quantity.name for quantity in term.amplitudes]
    if names[:2] == ["cosine", "sine"]:
        value = float(np.hypot(*sizes[:2]))
        along = sizes[:2] / max(value, 1e-30)
        error = math.sqrt(along @ among[:2, :2] @ along)
        remark = f", {fit.shape:g} periods a turn" if term.shape is not None and term.shape.name == "order" else remark
        return FittedSize("amplitude", value, error, term.amplitudes[0].unit, remark=remark, poles=felt)
    if _adds_up(term):
        error = math.hypot(math.sqrt(max(float(among.sum()), 0.0)), of_law)
        name, size = IN_ALL if count > 1 else names[0].replace("_", " "), float(sizes.sum())
        remark = _corner(size, error, FIRST_ORDER) if _lags(term) else ""
        return FittedSize(name, size, error, term.amplitudes[0].unit, of_law, remark, felt)
    errors = np.sqrt(np.diag(among))
    with np.errstate(divide="ignore", invalid="ignore"):
        best = int(np.nanargmin(np.abs(errors / np.where(sizes, sizes, np.nan)))) if np.any(sizes) else 0
    if names[best] == "more" and term.constants:
        names[best], remark = "", " more than in the data sheet"
    unit = term.amplitudes[best].unit
    return FittedSize(
        names[best].replace("_", " "), float(sizes[best]), float(errors[best]), unit, remark=remark, poles=felt
    )


def _lags(term: MotionTerm) -> bool:
    """Whether its size is the time of a low-pass."""
    return term.identifier == "transducer_bandwidth"


def _corner(lag: float, error: float, sharpness: float) -> str:
    """The corner frequency of a low-pass, to go on after its time [s]."""
    if lag <= 0.0:
        return ""
    corner = Lag("", lag, sharpness).corner
    return f" (corner at {measured(corner, corner * error / lag)} Hz)"


def error_of_law(problem: TermProblem, fits: tuple[TermFit, ...], place: int) -> float:
    """The range of a mechanism's size over the laws that it may have, the rest of a set beside it [unit of the size].

    Parameters
    ----------
    problem : TermProblem
        Before anything was taken out.
    fits : tuple of TermFit
        What is named.
    place : int
        Which of it.

    Notes
    -----
    A drag that rises over an angle in one way or in another has another size where it never rises to the end. What the
    runs exclude by far, with less than `LIKELY_LAW` of the gain (`LIKELY_WHEN_LATE`), does not count, and neither does
    a special case of the law that is named, which that would have become.
    """
    fit = fits[place]
    if (size := _one_size(fit)) is None:
        return 0.0
    late = cast("MotionTerm", fit.candidate).comes_late
    likely, unit = (LIKELY_WHEN_LATE if late else LIKELY_LAW) * fit.gain, _unit_of_size(fit.candidate)
    for other in (*fits[:place], *fits[place + 1 :]):
        problem = problem.take_out(other)
    sizes = [size]
    for term in [cast("MotionTerm", table.term) for table in problem.tables.values()]:
        same = term.identifier == fit.identifier and term.place == fit.place and term.key != fit.candidate.key
        if same and not (term.within and term.within == fit.candidate.variant) and _unit_of_size(term) == unit:
            other = fit_term(problem, term)
            if (size := _one_size(other)) is not None and other.gain > likely:
                sizes.append(size)
    return max(sizes) - min(sizes)


def _one_size(fit: TermFit) -> float | None:
    """The shape of a fit whose amplitudes are known, the sum of amounts of one thing; None for another."""
    if fit.candidate.whole:
        return fit.shape
    return float(fit.amplitudes.sum()) if _adds_up(fit.candidate) else None


def _unit_of_size(term: Term[Any]) -> str:
    """Unit of the size of a mechanism as one number."""
    return term.shape.unit if term.whole and term.shape is not None else term.amplitudes[0].unit


def _adds_up(term: Term[Any]) -> bool:
    """Whether the amplitudes of a mechanism are amounts of one thing, whose sum is its size: not one on each shaft."""
    amounts = all(each.bounds[0] >= 0.0 and each.unit == term.amplitudes[0].unit for each in term.amplitudes)
    return amounts and not {each.name for each in term.amplitudes} & set(SIDES)
