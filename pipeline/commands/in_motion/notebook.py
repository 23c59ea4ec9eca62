"""The diagnosis of runs in motion for notebooks and scripts: what it says, its tables and its figures as values."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmg.pipeline.commands.audit_entry import audited_from_python
from pmg.pipeline.commands.in_motion.motion import judge_motion, set_aside, write_motion
from pmg.pipeline.commands.notebook_results import WithReport
from pmg.pipeline.commands.provenance import now
from pmg.pipeline.grid.campaign import choose_campaign
from pmg.pipeline.motion.stored import judged_runs
from pmg.pipeline.store.store import Store
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from pmg.pipeline.commands.in_motion.motion import JudgedMotion
    from pmg.pipeline.commands.notebook_results import IngestedCampaigns
    from pmg.pipeline.diagnosis.engine.verdict import Verdict
    from pmg.pipeline.report.document import Report


@dataclass(frozen=True)
class MotionCampaignDiagnosis(WithReport):
    """Diagnosis of the runs in motion of a campaign.

    Parameters
    ----------
    judged : JudgedMotion
        The diagnosis and what it rests on, as the stages use it.
    kept : object
        What the samples of the runs lie in; held so that a temporary store lasts as long as this.
    """

    judged: JudgedMotion = field(repr=False)
    kept: object = field(default=None, repr=False, compare=False)

    @property
    def verdict(self) -> Verdict:
        """``consistent``, ``named``, ``ambiguous``, ``not_in_library`` or ``confounded``."""
        return self.judged.diagnosis.verdict

    @property
    def statement(self) -> str:
        """The verdict in sentences."""
        return str(self.judged.document["statement"])

    @property
    def p_value(self) -> float:
        """Of the whole search for a mismatch, by synthetic campaigns."""
        return float(self.judged.diagnosis.mismatch.p_value)

    @property
    def mechanisms(self) -> list[dict[str, Any]]:
        """The leading causes with their parameters, values, standard uncertainties and units."""
        return list(self.judged.document["mechanisms"])

    @property
    def constants(self) -> dict[str, tuple[float, float]]:
        """Constants of the bench that other runs have too, SI, each with its standard uncertainty."""
        return dict(self.judged.result.constants)

    def to_dict(self) -> dict[str, Any]:
        """The document ``pmg.diagnosis/1``, as in ``diagnosis.json``."""
        return self.judged.document

    @cached_property
    def report(self) -> Report:
        """The report as plain nouns: sections, tables, figures."""
        return self.judged.page(made=(("Command", "from Python, pmg.pipeline"),))

    def write(self, folder: Path, note: str = "") -> Path:
        """Write the report with its figures and tables, ``diagnosis.json`` and ``model.toml``; the page."""
        outcome, _ = write_motion(self.judged, folder, now(), note)
        return Path(outcome.data["report"])


def diagnose_in_motion(
    ingested: IngestedCampaigns, campaign: str | None = None, model: Path | None = None
) -> MotionCampaignDiagnosis:
    """Diagnose the runs in motion of what was ingested, a model of other runs given or not.

    Raises
    ------
    StoreError
        There is no such campaign, or there are several and none was named.
    FitError
        Its runs do not permit a diagnosis.
    """
    name, manifests = choose_campaign(Store(ingested.store), campaign)
    runs = [run for run in judged_runs(manifests) if run.manoeuvre.moves]
    if not any(run.record.sound for run in runs):
        came = "; ".join(set_aside(runs)) or "no run in motion"
        do = "Mend what is named; of steady points pass what compare gave: diagnose(compare(analyse(...)))."
        raise FitError(f"campaign {name}", came, "a run in motion", do)
    with audited_from_python("diagnose", ingested.store, campaign=name, model=model):
        return MotionCampaignDiagnosis(judge_motion(ingested.store, name, model=model), ingested)
