"""Causes as an engineer acts on them: how large, what they do to the balance, what would confirm them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.balance.free_run import LIMIT
from pmg.pipeline.diagnosis.balance.known_terms import GONE
from pmg.pipeline.diagnosis.balance.library.columns import RIPPLE, SECOND_RIPPLE
from pmg.pipeline.diagnosis.balance.library.term import EXCEEDED
from pmg.pipeline.diagnosis.balance.library.two_torques import GAINS
from pmg.pipeline.diagnosis.balance.titles import lateness_of, separating_test, titled
from pmg.pipeline.diagnosis.engine.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.balance.known_terms import SetTerm

CONVERSIONS = {
    0.737562: "as if lbf ft were read as N m",
    1.355818: "as if N m were read as lbf ft",
    8.850746: "as if lbf in were read as N m",
    0.112985: "as if N m were read as lbf in",
    0.101972: "as if kgf m were read as N m",
    9.80665: "as if N m were read as kgf m",
    0.5: "as with half the span, or one half bridge",
    2.0: "as with twice the span",
    10.0: "as with ten times the range",
    0.1: "as with a tenth of the range",
    1000.0: "as if mN m were read as N m",
    0.001: "as if kN m were read as N m",
}
"""Readings over torque that a wrong conversion makes."""

NEAR_FACTOR, CONVERTED = 0.03, 0.05
"""Part within which a factor is that of a conversion, and distance from 1 from which on one is thought of."""


FAR = 20.0
"""Tolerances from which on a gain is far beyond its own."""

ONE_FORM = 0.2
"""Part by which shapes of a term may differ for its known size and a change of it to be one size."""

NEARLY_ALL = 0.95
"""Part of the mismatch from which on a term takes up all that the noise lets be told apart."""

NEAREST, MOST_NEAR = 0.2, 2
"""Part of a mismatch that a term must explain to be listed as near, and how many are listed at most."""


@dataclass(frozen=True)
class NamedCause:
    """A term that is named, or that cannot be told from one that is.

    Parameters
    ----------
    identifier, title : str
        The term, and in words.
    group : int
        Which of the sets that are told it belongs to; 0 is the leading one.
    size : str
        Its parameters with their standard errors and units.
    remark : str
        What a size means, as a factor of a transducer; empty where there is nothing to add.
    effect : float
        Root mean square of what it does in the balance [N, N m].
    test : str
        What on the bench would confirm it.
    sure : bool
        Whether every set that is told holds it.
    """

    identifier: str
    title: str
    group: int
    size: str
    remark: str
    effect: float
    test: str
    sure: bool

    @property
    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "id": self.identifier,
            "set": self.group,
            "in_every_set": self.sure,
            "size": self.size,
            "remark": self.remark,
            "effect_rms": self.effect,
            "test": self.test,
        }


def named_causes(diagnosis: TermsDiagnosis) -> tuple[NamedCause, ...]:
    """Terms of the leading set, then those of the sets that cannot be told from it; none unless the verdict names."""
    if not diagnosis.verdict.names:
        return ()
    named = tuple(step.fitted.fits[-1] for step in diagnosis.steps[1:])
    others = [contest.rival.fits for contest in diagnosis.contests if contest.open]
    sets = (named, *others)
    shared = frozenset.intersection(*(frozenset(fit.identifier for fit in fits) for fits in sets))
    return tuple(_cause(diagnosis, fit, group, shared) for group, fits in enumerate(sets) for fit in fits)


def _cause(diagnosis: TermsDiagnosis, fit: TermFit, group: int, shared: frozenset[str]) -> NamedCause:
    values = [float(a) for a in fit.amplitudes]
    if fit.candidate.shape is not None:
        values.append(fit.shape)
    errors: list[float | None] = [None] * len(values)
    if group == 0:
        own = [e for e in diagnosis.steps[-1].fitted.estimates if e.term == fit.identifier]
        values, errors = [e.value for e in own], [e.standard_error for e in own]
    sizes = zip(fit.candidate.parameters, values, errors, strict=True)
    parts = [size_of(quantity.name, value, error, quantity.unit) for quantity, value, error in sizes]
    amplitudes = np.array(values[: len(fit.amplitudes)])
    effect = diagnosis.recorded.columns(fit.candidate, fit.shape) @ amplitudes
    return NamedCause(
        fit.identifier,
        titled(fit.candidate),
        group,
        ", ".join(parts),
        _remark(diagnosis, fit, values),
        float(np.sqrt(np.mean(effect**2))),
        separating_test(diagnosis, (fit.identifier,)),
        fit.identifier in shared,
    )


def _remark(diagnosis: TermsDiagnosis, fit: TermFit, values: Sequence[float]) -> str:
    """What a size means; empty where there is nothing to add."""
    gain = values[0]
    factor = _factor(fit.identifier, gain, diagnosis.case.axis.factor)
    stated = _beside_tolerance(fit.identifier, gain, diagnosis.case.tolerances.get(fit.identifier))
    beyond = _beyond_known(diagnosis, fit, values)
    before = (known for known in diagnosis.case.stated if known.term.key == fit.candidate.key)
    late = lateness_of(fit.identifier, gain + sum(float(k.amplitudes[0]) for k in before), diagnosis.case.axis.pushes)
    return (
        "; ".join(filter(None, (factor, late, stated, beyond)))
        or _once_a_turn(diagnosis, fit)
        or _limit(diagnosis, fit)
    )


def _beyond_known(diagnosis: TermsDiagnosis, fit: TermFit, values: Sequence[float]) -> str:
    """Parameters of a term compared with those in the machine file; empty where it has none."""
    known = next((each for each in diagnosis.case.stated if each.term.key == fit.candidate.key), None)
    if known is None:
        return ""
    sizes = zip(known.term.amplitudes, known.amplitudes, strict=True)
    told = ", ".join(size_of(quantity.name, float(value), None, quantity.unit) for quantity, value in sizes)
    return f"beyond what the machine file knows, {told}{_in_all(known, values)}"


def _in_all(known: SetTerm, values: Sequence[float]) -> str:
    """A size with what was known of it, where the two add up and are of one form; empty elsewhere."""
    one_form = np.isnan(known.shape) or abs(values[-1] / known.shape - 1.0) < ONE_FORM
    if len(known.amplitudes) > 1 or not one_form or known.term.of_model or known.term.identifier in GAINS:
        return ""
    (quantity,), (was,), more = known.term.amplitudes, known.amplitudes, values[0]
    now = size_of(quantity.name, float(was + more), None, quantity.unit)
    return f", so that it is {'gone' if abs(was + more) <= GONE * abs(was) else f'now {now}'}"


def _beside_tolerance(identifier: str, gain: float, tolerance: float | None) -> str:
    """Error of a transducer's gain compared with its stated tolerance; empty where none is stated."""
    if not tolerance or identifier not in GAINS:
        return ""
    off = abs(GAINS[identifier](gain) - 1.0)
    times = "within" if off <= tolerance else "far beyond" if off > FAR * tolerance else f"{off / tolerance:.2g} times"
    return f"{off:.2%} off, {times} its tolerance of {tolerance:.2%}"


def _once_a_turn(diagnosis: TermsDiagnosis, fit: TermFit) -> str:
    """What a torque that comes once a turn is likely to be; empty of another one."""
    turn = diagnosis.case.axis.turn
    if fit.identifier not in (RIPPLE, SECOND_RIPPLE) or not turn or abs(fit.shape / turn - 1.0) > NEAR_FACTOR:
        return ""
    return "once a turn of this shaft, as the weight of an arm or an unbalance makes it"


def _limit(diagnosis: TermsDiagnosis, fit: TermFit) -> str:
    """At what command a drive stops to follow; empty of another cause."""
    if fit.identifier != LIMIT:
        return ""
    limit = fit.shape * diagnosis.recorded.motion.references[EXCEEDED]
    return f"the limit is {limit:.4g} {diagnosis.case.axis.push}"


def size_of(name: str, value: float, error: float | None, unit: str) -> str:
    """A parameter with its standard error and unit, in words."""
    spread = "" if error is None else f" ± {error:.2g}"
    return f"{name} = {value:.4g}{spread}{'' if unit == '1' else f' {unit}'}"


def _factor(identifier: str, gain: float, key: str) -> str:
    """A gain of a transducer as what it reads over what there is, the conversion that makes it, and what undoes it."""
    if identifier not in GAINS:
        return ""
    factor = GAINS[identifier](gain)
    reading = f"it reads {factor:.4g} times the torque"
    far = {words: abs(factor / known - 1.0) for known, words in CONVERSIONS.items()}
    near = sorted((words for words in far if far[words] < NEAR_FACTOR), key=far.__getitem__)
    known = next((each for each, words in CONVERSIONS.items() if near and words == near[0]), factor)
    if identifier.startswith("input"):
        reading += " (and so do inertia and friction as found)"
    if not near or abs(factor - 1.0) <= CONVERTED:
        return reading
    return f"{reading}, {' or '.join(near)}; where that is so, its channel takes {key} = {1.0 / known:.6g}"


@dataclass(frozen=True)
class NearCause:
    """A term that comes near where none is named.

    Parameters
    ----------
    identifier, title : str
        The term, and in words.
    share : float
        Part of the mismatch that it takes up.
    test : str
        What on the bench would confirm it; empty where nothing is known.
    """

    identifier: str
    title: str
    share: float
    test: str

    @property
    def part(self) -> str:
        """Part of the mismatch in words, which is of squares beyond the noise and known to no better than that."""
        return "nearly all" if self.share > NEARLY_ALL else f"{self.share:.0%}"

    @property
    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {"id": self.identifier, "share": self.share, "test": self.test}


def near_causes(diagnosis: TermsDiagnosis) -> tuple[NearCause, ...]:
    """The terms that come nearest where nothing is named.

    None where something is named, nothing differs, or a parameter stands first that no machine has.
    """
    naming = diagnosis.naming
    if diagnosis.verdict is not Verdict.NOT_IN_LIBRARY or naming is None or diagnosis.impossible:
        return ()
    whole = naming.rounds[0].remainder.excess
    near = {f.identifier: f for f in naming.ranking[::-1] if f.admissible and f.gain > NEAREST * whole}
    best = sorted(near.values(), key=lambda fit: -fit.gain)[:MOST_NEAR]  # the best form of each
    return tuple(
        NearCause(
            fit.identifier,
            titled(fit.candidate),
            min(fit.gain / whole, 1.0),
            separating_test(diagnosis, (fit.identifier,)),
        )
        for fit in best
    )


def nearest_lines(diagnosis: TermsDiagnosis) -> tuple[str, ...]:
    """What to do where nothing is named: the terms that come nearest, how much each takes, and the test of each.

    Empty where something is named, nothing differs, or a parameter stands first that no machine has.
    """
    if diagnosis.verdict is not Verdict.NOT_IN_LIBRARY or diagnosis.naming is None or diagnosis.impossible:
        return ()
    near = near_causes(diagnosis)
    if not near:
        place = diagnosis.mismatch.locations[0].name if diagnosis.mismatch.locations else "nothing in particular"
        return (f"No term of the library comes near. Look at what the residual does with {place} (residuals.csv).", "")
    lines = ["Nearest in the library, none of them named:"]
    for each in near:
        lines.append(f"{each.title}: {each.part} of the mismatch")
        lines.append(f"  on the bench: {each.test}")
    return (*lines, "")


def cause_lines(causes: tuple[NamedCause, ...], unit: str) -> tuple[str, ...]:
    """Causes in lines: size and effect, then what to do on the bench; what every set holds once."""
    lines = []
    for cause in causes:
        if cause.sure and cause.group:
            continue
        size = f"{cause.size}; {cause.remark}" if cause.remark else cause.size
        either = "or: " if cause.group else ""
        lines.append(f"{either}{cause.title}: {size}; {cause.effect:.3g} {unit} rms")
        lines.append(f"  on the bench: {cause.test}")
    return (*lines, "") if lines else ()
