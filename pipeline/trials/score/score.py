"""Score of a diagnosis against the truth; nothing here draws, reads or writes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.trials.laws import RESERVED
from pmg.pipeline.trials.score.location import SILENT, located, place_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.sim.signals import Array

PARAMETERS = {"torque_zero_offset": "offset", "torque_gain_error": "gain", "torque_crosstalk": "part"}
"""Parameter of the library that corresponds to an effect's size, without its shaft."""
WITHOUT_ONE = ("magnitude", "seated", "by_sense")
"""Laws that go with the sense of a torque, so that no single parameter corresponds to them."""
NOT_IN_LIBRARY = "not_in_library"
"""Verdict that is a member of a set by itself."""
QUANTILE = 1.96
"""Half-width of a 95 % interval in standard errors."""


class DiagnosisScore(StrEnum):
    """Outcomes of a diagnosis."""

    QUIET = "quiet"
    FALSE_ALARM = "false alarm"
    MISSED = "missed"
    SAID_CONFOUNDED = "said confounded"
    RIGHT = "named right"
    WRONG_SHAFT = "right id, wrong shaft"
    PART = "named in part"
    WRONG = "wrong and confident"
    RIGHT_SET = "set holds the truth"
    WRONG_SET = "set without the truth"
    NOT_IN_LIBRARY = "not in library"
    NOT_MADE = "not made"


@dataclass(frozen=True)
class ParameterScore:
    """A fitted parameter next to its true value.

    Parameters
    ----------
    identifier : str
        Mechanism.
    true, value : float
        True value (least squares over the points, for effects that are not quite proportional), fitted value.
    error : float or None
        Its standard error.
    """

    identifier: str
    true: float
    value: float
    error: float | None

    @property
    def relative(self) -> float:
        """Relative error, without its sign."""
        return abs(self.value - self.true) / abs(self.true)

    @property
    def covers(self) -> bool | None:
        """Whether the 95 % interval holds the true value; None without a standard error."""
        return None if self.error is None else abs(self.value - self.true) <= QUANTILE * self.error


@dataclass(frozen=True)
class Score:
    """One campaign, judged.

    Parameters
    ----------
    kind, stratum : str
        What it was.
    ids : tuple of str
        What was concealed.
    reached : float
        Size after absorption [sigma]: root of the sum of squares over the effects.
    verdict : str
        What was said.
    named : tuple of str
        Ids that were said, leading ones first; of a set, all.
    outcome : DiagnosisScore
        What it was worth.
    p_value : float or None
        Of the mismatch.
    parameter : ParameterScore or None
        Where one corresponds.
    held_out : float or None
        Error on withheld readings with the mechanisms in, over the noise floor.
    recognised : bool or None
        For a confounded design: that it cannot tell was said, or the set with the truth and a test that would; None
        where its runs show the effect, so that to name it is right.
    laws : str
        Family of its effects' laws, reserved if that of any is; empty where nothing is concealed.
    near : tuple of str
        Ids that stand beside none of the library, or beside what was named as an error of its form would explain them.
    place : str
        Where a single effect sits: rotor, coupling, gear, transducer, encoder or motor; empty without one.
    located : bool or None
        Whether the diagnosis points there first; None without a single effect.
    """

    kind: str
    stratum: str
    ids: tuple[str, ...]
    reached: float
    verdict: str
    named: tuple[str, ...]
    outcome: DiagnosisScore
    p_value: float | None
    parameter: ParameterScore | None
    held_out: float | None
    recognised: bool | None
    laws: str
    near: tuple[str, ...] = ()
    place: str = ""
    located: bool | None = None

    @property
    def told(self) -> tuple[str, ...]:
        """The set that was told: ids, or that it is none of the library; empty where no mismatch was claimed."""
        return (NOT_IN_LIBRARY,) * (self.verdict == NOT_IN_LIBRARY) + self.named + self.near

    @property
    def answer(self) -> str:
        """The verdict; ``weak`` where causes stand beside none of the library."""
        return "weak" if self.verdict == "ambiguous" and NOT_IN_LIBRARY in self.named else self.verdict

    @property
    def holds(self) -> bool | None:
        """Whether that set holds the truth, every effect of it; None without a set, or without an effect."""
        if not self.told or not self.ids:
            return None
        return {NOT_IN_LIBRARY if name.startswith("outside_") else name for name in self.ids} <= set(self.told)

    @property
    def detected(self) -> bool:
        """Whether a mismatch was claimed."""
        return self.outcome is not DiagnosisScore.NOT_MADE and self.verdict not in SILENT


def judge(truth: Mapping[str, Any], document: Mapping[str, Any] | None) -> Score:
    """A diagnosis document against the truth."""
    effects, kind = truth["effects"], str(truth["kind"])
    outcome = _naming_outcome(truth, document)
    tested = document is not None and any(rival["separating_test"] for rival in document["rivals"])
    separated = outcome is DiagnosisScore.SAID_CONFOUNDED or (outcome is DiagnosisScore.RIGHT_SET and tested)
    proof, right_place = None if document is None else document["held_out"], located(truth, document)
    after = document is not None and document["verdict"] in ("named", "ambiguous") and proof is not None
    return Score(
        kind=kind,
        stratum=str(truth["stratum"]),
        ids=tuple(str(effect["id"]) for effect in effects),
        reached=float(np.sqrt(sum(effect["reached_sigma"] ** 2 for effect in effects))),
        verdict="" if document is None else str(document["verdict"]),
        named=_said_ids(document),
        outcome=outcome,
        p_value=None if document is None else float(document["p_value"]),
        parameter=_parameter_beside(truth, document),
        held_out=float(proof["rmse_after_Nm"] / proof["noise_floor_Nm"]) if after and proof is not None else None,
        recognised=separated if kind == "confounded" and "named" not in truth["expected"] else None,
        near=_near_ids(document),
        place=place_of(effects[0]["component"]) if right_place is not None else "",
        located=right_place,
        laws=max((str(effect["laws"]) for effect in effects), key=lambda family: family == RESERVED, default=""),
    )


def _said_ids(document: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Every id that a verdict names, those of its rivals too."""
    if document is None or document["verdict"] not in ("named", "ambiguous"):
        return ()
    ids = [mechanism["id"] for mechanism in document["mechanisms"]]
    if document["verdict"] == "ambiguous":
        ids += _rival_ids(document)
    return tuple(dict.fromkeys(ids))


def _near_ids(document: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Ids that are told without being named."""
    if document is None:
        return ()
    if document["verdict"] == NOT_IN_LIBRARY:
        return _rival_ids(document)
    form = document.get("form")
    return tuple(form["or_further"]) if document["verdict"] == "named" and form else ()


def _rival_ids(document: Mapping[str, Any]) -> tuple[str, ...]:
    """Every id of its rivals, each once."""
    return tuple(dict.fromkeys(name for rival in document["rivals"] for name in rival["ids"]))


def _naming_outcome(truth: Mapping[str, Any], document: Mapping[str, Any] | None) -> DiagnosisScore:
    """Score of the named cause.

    A mechanism is right with its shaft, or with the shaft left open. `DiagnosisScore.WRONG` is a verdict ``named``
    with an id that is not true, whatever else it names.
    """
    if document is None:
        return DiagnosisScore.NOT_MADE
    verdict = document["verdict"]
    if not truth["effects"]:
        return DiagnosisScore.QUIET if verdict in SILENT else DiagnosisScore.FALSE_ALARM
    if verdict == "consistent":
        return DiagnosisScore.MISSED
    if verdict == "confounded":
        return DiagnosisScore.SAID_CONFOUNDED
    if verdict == NOT_IN_LIBRARY:
        return DiagnosisScore.NOT_IN_LIBRARY
    true = {effect["id"]: effect["shaft"] for effect in truth["effects"]}
    said = set(_said_ids(document))
    if verdict == "ambiguous":
        return DiagnosisScore.RIGHT_SET if set(true) <= said else DiagnosisScore.WRONG_SET
    if said - set(true):
        return DiagnosisScore.WRONG
    shafts = {mechanism["id"]: mechanism["shaft"] for mechanism in document["mechanisms"]}
    if any(shaft not in (true[name], "either") for name, shaft in shafts.items()):
        return DiagnosisScore.WRONG_SHAFT
    return DiagnosisScore.RIGHT if said == set(true) else DiagnosisScore.PART


def _parameter_beside(truth: Mapping[str, Any], document: Mapping[str, Any] | None) -> ParameterScore | None:
    """The fitted size of a single effect that was named right, where a parameter corresponds to it."""
    if document is None or len(truth["effects"]) != 1 or _naming_outcome(truth, document) is not DiagnosisScore.RIGHT:
        return None
    effect = truth["effects"][0]
    stem, shaft = PARAMETERS.get(effect["id"]), effect["shaft"]
    if stem is None or effect["knobs"].get("law") in WITHOUT_ONE:
        return None
    fitted = {p["name"]: p for mechanism in document["mechanisms"] for p in mechanism["parameters"]}
    found = fitted.get(f"{stem}_{shaft}")
    if found is None:
        return None
    true = _least_squares(truth, effect["id"], shaft)
    return ParameterScore(effect["id"], true, float(found["value"]), found["standard_error"])


def _least_squares(truth: Mapping[str, Any], identifier: str, shaft: str) -> float:
    """The constant that comes nearest to what the effect did at the points of the campaign."""
    points = truth["points"]
    bare: dict[str, Array] = {s: np.array(points[f"torque_{s}_without_Nm"]) for s in ("sun", "ring")}
    change = np.array(points[f"torque_{shaft}_Nm"]) - bare[shaft]
    other = "ring" if shaft == "sun" else "sun"
    carrier = {"gain": bare[shaft], "part": bare[other], "offset": np.ones_like(change)}[PARAMETERS[identifier]]
    return float(carrier @ change / (carrier @ carrier))


def resolution(truth: Mapping[str, Any], extended: Mapping[str, Any] | None) -> str:
    """Result of the separating test: ``resolved``, ``still a set``, ``wrong``, ``lost`` or ``not tested``."""
    if extended is None:
        return "not tested"
    outcome = _naming_outcome(truth, extended["diagnosis"])
    if outcome in (DiagnosisScore.RIGHT, DiagnosisScore.WRONG_SHAFT):
        return "resolved"
    if outcome in (DiagnosisScore.RIGHT_SET, DiagnosisScore.WRONG_SET):
        return "still a set"
    if outcome is DiagnosisScore.NOT_IN_LIBRARY and any(not effect["in_library"] for effect in truth["effects"]):
        return "resolved"
    return "wrong" if outcome in (DiagnosisScore.WRONG, DiagnosisScore.PART, DiagnosisScore.FALSE_ALARM) else "lost"
