"""Options of an analysis, stored with its results."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

from pmg.pipeline.fit.loss_fit import DEFAULT_POWERS, THESIS_POWERS_RING, THESIS_POWERS_SUN
from pmg.pipeline.wording.option_words import (
    AUTO,
    DampingMethod,
    check_powers,
    parse_correction,
    parse_damping,
    parse_powers,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

THESIS_CORRECTION = 0.80
"""Correction factor that the thesis settled on (its section 6.2.2)."""


@dataclass(frozen=True)
class AnalysisOptions:
    """Choices of an analysis.

    Parameters
    ----------
    powers_sun, powers_ring : tuple of float
        Exponents of the speed in the loss curves; where they are chosen by the data, those that were chosen.
    include_rest : bool
        Whether readings of a shaft at rest take part in the loss curves.
    correction : str
        ``joint``: K_corr is fitted together with the damping constants. ``rule``: the largest value at which no
        magnetic loss is negative. Or a number.
    auto_sun, auto_ring : bool
        Whether the terms are chosen by the data (`pmg.pipeline.fit.term_choice`).
    robust : bool
        Huber's M-estimate instead of least squares for the loss curves.
    damping : DampingMethod
        Weights of the damping constants' fit, and of the calibration: least squares, or bisquare.
    checks : mapping of str to str
        Cross-checks whose action is not the default one, with the action.
    """

    powers_sun: tuple[float, ...] = DEFAULT_POWERS
    powers_ring: tuple[float, ...] = DEFAULT_POWERS
    include_rest: bool = False
    correction: str = "joint"
    auto_sun: bool = False
    auto_ring: bool = False
    robust: bool = False
    damping: DampingMethod = DampingMethod.LEAST_SQUARES
    checks: Mapping[str, str] = field(default_factory=dict)

    @property
    def fixed_correction(self) -> float | None:
        """The number that was given for K_corr; None for ``joint`` and ``rule``."""
        return parse_correction(self.correction)

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> AnalysisOptions:
        """The options that `document` wrote; choices that are younger than the document have their default."""
        younger = ("auto_sun", "auto_ring", "robust", "damping", "checks")
        known = {f.name: document[f.name] for f in fields(cls) if f.name in document or f.name not in younger}
        for name in ("powers_sun", "powers_ring"):
            known[name] = tuple(map(float, known[name]))
        if "damping" in known:
            known["damping"] = DampingMethod(known["damping"])
        return cls(**known)


THESIS_OPTIONS = AnalysisOptions(
    powers_sun=THESIS_POWERS_SUN,
    powers_ring=THESIS_POWERS_RING,
    include_rest=True,
    correction=str(THESIS_CORRECTION),
    damping=DampingMethod.BISQUARE,
)
"""The thesis's own choices: what the published grids are analysed with unless set otherwise."""


def chosen_options(
    *,
    published: bool,
    terms_sun: str | None = None,
    terms_ring: str | None = None,
    correction: str | None = None,
    include_rest: bool | None = None,
    robust: bool = False,
    damping: str | None = None,
    checks: Mapping[str, str] | None = None,
) -> AnalysisOptions:
    """The options of a call: the thesis's own for published grids, pmg's for recordings, and what the user changed."""
    options = replace(THESIS_OPTIONS if published else AnalysisOptions(), robust=robust, checks=checks or {})
    if terms_sun == AUTO:
        options = replace(options, auto_sun=True)
    elif terms_sun is not None:
        options = replace(options, powers_sun=parse_powers(terms_sun, "--terms-sun"))
    if terms_ring == AUTO:
        options = replace(options, auto_ring=True)
    elif terms_ring is not None:
        options = replace(options, powers_ring=parse_powers(terms_ring, "--terms-ring"))
    if correction is not None:
        options = replace(options, correction=correction)
    if damping is not None:
        options = replace(options, damping=parse_damping(damping))
    check_powers(options.powers_sun)
    check_powers(options.powers_ring)
    if include_rest is not None:
        options = replace(options, include_rest=include_rest)
    return options
