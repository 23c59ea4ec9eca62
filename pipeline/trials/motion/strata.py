"""The kinds of campaign in motion that are drawn: what is concealed, how large, and what may be answered."""

from __future__ import annotations

from dataclasses import dataclass

from pmg.pipeline.trials.motion.forms_drag import DRAGS
from pmg.pipeline.trials.motion.forms_elastic import ELASTICS
from pmg.pipeline.trials.motion.forms_outside import OUTSIDERS
from pmg.pipeline.trials.motion.forms_reading import READINGS
from pmg.pipeline.trials.strata import SIZES, SIZES_CONFOUNDED, SIZES_OF_TWO

__all__ = ("motion_strata",)

LIBRARY_FORMS = (*ELASTICS, *DRAGS, *READINGS)
"""Forms of the vocabulary."""
FORMS = {form.identifier: form for form in (*LIBRARY_FORMS, *OUTSIDERS)}
"""Every form by its id."""
PAIRS = (
    (("coupling_compliance", "sun"), ("torque_gain_error", "ring")),
    (("rotor_inertia", "ring"), ("transducer_bandwidth", "sun")),
    (("gear_hysteresis", "both"), ("lubricant_viscosity", "ring")),
    (("coupling_backlash", "ring"), ("torque_zero_drift", "sun")),
    (("presliding_friction", "ring"), ("pull_out_torque", "both")),
    (("load_dependent_bearing_friction", "ring"), ("shaft_unbalance", "sun")),
    (("torque_map_harmonic", "both"), ("direction_dependent_friction", "sun")),
    (("channel_delay", "ring"), ("rotor_inertia", "sun")),
)
"""Effects concealed together, each with its shaft."""
CONFOUNDED = (
    ("slow ramps", "rotor_inertia", "sun"),
    ("slow ramps", "rotor_inertia", "ring"),
    ("slow ramps", "channel_delay", "sun"),
    ("slow ramps", "transducer_bandwidth", "ring"),
    ("slow ramps", "transducer_bandwidth", "sun"),
    ("one direction", "direction_dependent_friction", "sun"),
    ("one direction", "presliding_friction", "sun"),
    ("no dither or sweep", "presliding_friction", "ring"),
)
"""Poor designs, each with an effect that it cannot tell, and the shaft."""


@dataclass(frozen=True)
class MotionStratum:
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
        Of each effect [sigma, after absorption in a full campaign]; 0 for none.
    design : str
        Which runs are made.
    expected : tuple of str
        Verdicts that are right when the effect is large enough to be seen.
    """

    name: str
    kind: str
    effects: tuple[tuple[str, str], ...] = ()
    size: float = 0.0
    design: str = "full"
    expected: tuple[str, ...] = ("named", "ambiguous")

    @property
    def group(self) -> tuple[object, ...]:
        """What it shares with its other sizes and shafts."""
        return (*(identifier for identifier, _ in self.effects), self.design)


def motion_strata() -> tuple[MotionStratum, ...]:
    """Every kind of campaign."""
    clean = MotionStratum("clean", "clean", expected=("consistent",))
    single = [
        MotionStratum(f"{form.identifier} {shaft} {size:g}", kind, ((form.identifier, shaft),), size, expected=expected)
        for forms, kind, expected in (
            (LIBRARY_FORMS, "one", ("named", "ambiguous")),
            (OUTSIDERS, "outside", ("not_in_library",)),
        )
        for form in forms
        for shaft in form.components
        for size in (SIZES if form.seen else SIZES[2:3])
    ]
    double = [
        MotionStratum(f"{' + '.join(' '.join(one) for one in pair)} {size:g}", "two", pair, size)
        for pair in PAIRS
        for size in SIZES_OF_TWO
    ]
    poor = [
        MotionStratum(
            f"{design}, {identifier} {shaft} {size:g}",
            "confounded",
            ((identifier, shaft),),
            size,
            design,
            ("confounded", "ambiguous"),
        )
        for design, identifier, shaft in CONFOUNDED
        for size in SIZES_CONFOUNDED
    ]
    return (clean, *single, *double, *poor)
