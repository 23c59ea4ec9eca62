"""The kinds of campaign that are drawn: what is concealed, how large, and what may be answered."""

from __future__ import annotations

from dataclasses import dataclass

from pmg.pipeline.trials.effect import EffectForm
from pmg.pipeline.trials.forms_drag import DRAGS
from pmg.pipeline.trials.forms_magnetic import MAGNETICS
from pmg.pipeline.trials.forms_outside import OUTSIDERS
from pmg.pipeline.trials.forms_reading import READINGS
from pmg.pipeline.trials.forms_thermal import THERMALS

LIBRARY_FORMS: tuple[EffectForm, ...] = (*THERMALS, *DRAGS, *MAGNETICS, *READINGS)
"""One form for each id of the vocabulary that shows in mean torques."""
FORMS: tuple[EffectForm, ...] = (*LIBRARY_FORMS, *OUTSIDERS)
"""Every form."""
SIZES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Sizes of one concealed effect [sigma, after absorption]."""
SIZES_OF_TWO = (1.0, 2.0, 4.0)
SIZES_CONFOUNDED = (2.0, 4.0)
PAIRS: tuple[tuple[tuple[str, str], tuple[str, str]], ...] = (
    (("lubricant_viscosity", "ring"), ("torque_gain_error", "sun")),
    (("load_dependent_bearing_friction", "ring"), ("torque_zero_offset", "sun")),
    (("relative_bearing_drag", "both"), ("torque_zero_drift", "sun")),
    (("residual_magnetic_coupling", "both"), ("stribeck_mixed_lubrication", "ring")),
    (("load_dependent_iron_loss", "both"), ("lubricant_viscosity", "sun")),
    (("torque_crosstalk", "sun"), ("lubricant_viscosity", "both")),
    (("torque_zero_drift", "ring"), ("residual_magnetic_coupling", "both")),
    (("torque_gain_error", "ring"), ("stribeck_mixed_lubrication", "sun")),
)
"""Effects concealed together, each with its shaft."""
ONE_WAY: tuple[tuple[str, str, tuple[tuple[str, float | str], ...]], ...] = (
    ("torque_gain_error", "sun", (("law", "quadratic"), ("quadratic", 0.02), ("sign", 1.0))),
    ("torque_gain_error", "ring", (("law", "quadratic"), ("quadratic", 0.02), ("sign", -1.0))),
    ("load_dependent_bearing_friction", "sun", (("law", "power"), ("power", 1.03))),
    ("load_dependent_bearing_friction", "ring", (("law", "power"), ("power", 1.03))),
)
"""Effects that look alike while power flows one way, with shaft and the shape in which they do: a gain that reads as
more loss, as no friction takes loss away."""


@dataclass(frozen=True)
class Stratum:
    """A kind of campaign.

    Parameters
    ----------
    name : str
        Unique.
    kind : str
        ``clean``, ``one``, ``outside``, ``two`` or ``confounded``.
    effects : tuple of (identifier, shaft)
        What is concealed.
    size : float
        Of each effect [sigma]; 0 for none.
    expected : tuple of str
        Verdicts that are right when the effect is large enough to be seen.
    order : str or None
        Order of the points; None draws one.
    extended, one_way : bool
        As in `Design`.
    basis : str
        Whether `size` counts after absorption (``absorbed``) or before (``raw``).
    pinned : tuple of (knob, value)
        Shape that is not drawn.
    outliers : int
        Readings of each shaft that are off by several times the wander.
    """

    name: str
    kind: str
    effects: tuple[tuple[str, str], ...] = ()
    size: float = 0.0
    expected: tuple[str, ...] = ("named", "ambiguous")
    order: str | None = None
    extended: bool = True
    one_way: bool = False
    basis: str = "absorbed"
    pinned: tuple[tuple[str, float | str], ...] = ()
    outliers: int = 0

    @property
    def group(self) -> tuple[object, ...]:
        """What it shares with its other sizes and shafts."""
        ids = tuple(identifier for identifier, _ in self.effects)
        return (*ids, self.one_way) if ids else (self.name,)


def strata() -> tuple[Stratum, ...]:
    """Every kind of campaign."""
    return (*_clean(), *_one(LIBRARY_FORMS, "one"), *_one(OUTSIDERS, "outside"), *_two(), *_confounded())


def form_of(identifier: str) -> EffectForm:
    """The form with that id."""
    return next(form for form in FORMS if form.identifier == identifier)


def _clean() -> tuple[Stratum, ...]:
    expected = ("consistent",)
    return (
        Stratum("clean", "clean", expected=expected),
        Stratum("clean random", "clean", expected=expected, order="random"),
        Stratum("clean falling", "clean", expected=expected, order="falling"),
        Stratum("clean outliers", "clean", expected=expected, outliers=2),
        Stratum("clean short", "clean", expected=(*expected, "confounded"), extended=False),
    )


def _one(forms: tuple[EffectForm, ...], kind: str) -> tuple[Stratum, ...]:
    expected = ("named", "ambiguous") if kind == "one" else ("not_in_library",)
    return tuple(
        Stratum(f"{form.identifier} {shaft} {size:g}", kind, ((form.identifier, shaft),), size, expected)
        for form in forms
        for shaft in form.components
        for size in SIZES
    )


def _two() -> tuple[Stratum, ...]:
    return tuple(
        Stratum(f"{' + '.join(' '.join(one) for one in pair)} {size:g}", "two", pair, size)
        for pair in PAIRS
        for size in SIZES_OF_TWO
    )


def _confounded() -> tuple[Stratum, ...]:
    """Designs in which order is speed, and nothing is repeated; or in which power flows one way."""
    found = []
    for size in SIZES_CONFOUNDED:
        for identifier in ("torque_zero_drift", "lubricant_viscosity"):
            for shaft in ("sun", "ring"):
                name = f"rising order, {identifier} {shaft} {size:g}"
                effect, expected = ((identifier, shaft),), ("confounded", "ambiguous")
                order = "rising" if shaft == "sun" else "rising by ring"
                found.append(Stratum(name, "confounded", effect, size, expected, order, False, True, "raw"))
        for identifier, shaft, pinned in ONE_WAY:
            name = f"one-way flow, {identifier} {shaft} {size:g}"
            effect, expected = ((identifier, shaft),), ("ambiguous", "confounded")
            basis = "absorbed"
            found.append(Stratum(name, "confounded", effect, size, expected, "random", True, True, basis, pinned))
    return tuple(found)
