"""The diagnosis as a value: verdict, place, causes, rivals, next test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.engine.conclusion import Conclusion
from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, GridProblem
from pmg.sim.mechanisms import Component

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.design.audit import Audit
    from pmg.pipeline.diagnosis.design.next_test import NextTest
    from pmg.pipeline.diagnosis.form.shape import Shape
    from pmg.pipeline.diagnosis.grid.catalogue import GridExplanation
    from pmg.pipeline.diagnosis.grid.law import LawPower
    from pmg.pipeline.diagnosis.grid.locate import CampaignMismatch, Location
    from pmg.pipeline.diagnosis.grid.refit import Refit
    from pmg.pipeline.fit.noise import NoiseFloor


@dataclass(frozen=True)
class Rival:
    """An explanation that these data cannot tell from the leading one, and the test that would.

    Parameters
    ----------
    explanation : GridExplanation
        The rival set of mechanisms.
    test : NextTest or None
        The test.
    by_parts : bool
        Whether it is a rival because parts of the readings name it instead, not because its evidence is close.
    """

    explanation: GridExplanation
    test: NextTest | None
    by_parts: bool = False


@dataclass(frozen=True, kw_only=True)
class Diagnosis(Conclusion[CandidateFit, GridProblem]):
    """Mismatch, place, cause and verdict of a campaign.

    Parameters
    ----------
    campaign : str
        Name of the campaign.
    mismatch : CampaignMismatch
        Test and locations.
    floor : NoiseFloor
        Noise it was judged against.
    blind : tuple of str
        Shafts whose points were run in the order of their speed, without repeats.
    refit : Refit or None
        Baseline and mechanisms fitted together.
    rivals : tuple of Rival
        Explanations that cannot be distinguished from it.
    outliers : tuple of str
        Points that stand out by themselves and were set aside before the rest was judged.
    lifting : NextTest or None
        The test that a blind design lacks.
    audit : Audit or None
        What the points of the campaign can tell at all.
    shape : Shape or None
        A short form of what no mechanism explains, where one holds up on withheld readings.
    law : tuple of LawPower
        Powers by which the law of what was named differs from the library's form, where it does.
    form_test : NextTest or None
        The test that would tell an error of that form from a further cause, where either takes up what is left.
    repeated : NextTest or None
        The test that shows whether a difference comes again, where no mechanism explains it.
    confirming : NextTest or None
        The test that would show a named cause once more.
    """

    campaign: str
    mismatch: CampaignMismatch
    floor: NoiseFloor
    blind: tuple[str, ...] = ()
    refit: Refit | None = None
    rivals: tuple[Rival, ...] = ()
    outliers: tuple[str, ...] = ()
    lifting: NextTest | None = None
    audit: Audit | None = None
    shape: Shape | None = None
    law: tuple[LawPower, ...] = ()
    form_test: NextTest | None = None
    repeated: NextTest | None = None
    confirming: NextTest | None = None

    @property
    def next_tests(self) -> tuple[NextTest, ...]:
        """Tests that would settle what is open, those of the rivals first."""
        wanted = (*(rival.test for rival in self.rivals), self.lifting, self.form_test, self.repeated)
        return tuple(test for test in wanted if test is not None)


def possible_components(place: Location) -> tuple[Component, ...]:
    """Components that the evidence may point to: one, or those that act on a torque under load."""
    if (component := component_of(place)) is not None:
        return (component,)
    if set(place.depends_on) - set(place.covariates):
        return ()
    shaft = place.signal.removeprefix("torque_")
    return Component(f"{shaft}_torque_transducer"), Component(f"{shaft}_bearings"), Component.MAGNETIC_GEAR


def component_of(place: Location) -> Component | None:
    """Component that the evidence points to; None where it cannot tell (load: gear, bearing or transducer)."""
    shaft = "sun" if place.signal == "torque_sun" else "ring"
    first = place.depends_on[0] if place.depends_on else ""
    if set(place.depends_on) - set(place.covariates):
        return None
    if place.configuration == "zero" or first == "direction":
        return Component(f"{shaft}_torque_transducer")
    if first == "pole_slip_speed":
        return Component.MAGNETIC_GEAR
    if first == "speed_difference":
        return Component.RELATIVE_BEARING
    if place.configuration == "neutral" and first in ("run_history", f"speed_{shaft}"):
        return Component(f"{shaft}_bearings")
    return None
