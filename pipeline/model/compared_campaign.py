"""A campaign compared with the simulator: residuals, diagnosis, and the model that comes of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.grid.statement import statement
from pmg.pipeline.model.apply_model import lead

if TYPE_CHECKING:
    from pmg.pipeline.analysis.comparison import Residuals
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.model.apply_model import Carried
    from pmg.pipeline.model.extreme_steady_points import SteadyEnd
    from pmg.pipeline.model.model_file import Model


@dataclass(frozen=True)
class ComparedCampaign:
    """A campaign compared with the simulator.

    Parameters
    ----------
    residuals : Residuals
        Measured less simulated, with the calibrated baseline or with the given model as it came.
    diagnosis : Diagnosis
        Of what the baseline leaves, or what the given model with its constants free leaves.
    model : Model
        Baseline and mechanisms after this campaign.
    carried : Carried or None
        The given model.
    ends : tuple of SteadyEnd
        Where the moving bench comes to rest; empty without a mechanism.
    """

    residuals: Residuals
    diagnosis: Diagnosis
    model: Model
    carried: Carried | None
    ends: tuple[SteadyEnd, ...]

    @property
    def statement(self) -> str:
        """The verdict in sentences, after what a given model is stated to be."""
        return ("" if self.carried is None else lead(self.carried)) + statement(self.diagnosis)
