"""Results of the functions for notebooks: tables of points, an analysis, a comparison, a diagnosis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

import pandas as pd
import polars as pl

from pmg.pipeline.analysis.outputs import balance_frame
from pmg.pipeline.commands.compare import campaign_page, seeded
from pmg.pipeline.commands.compare_and_diagnose import SEED
from pmg.pipeline.commands.stored_analysis import recorded_part
from pmg.pipeline.diagnosis.grid.document import diagnosis_document, mechanism_facts
from pmg.pipeline.grid.tables import grid_frame
from pmg.pipeline.model.model_file import model_text
from pmg.pipeline.report.draw import draw_png
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.commands.compare_and_diagnose import SimulatedCampaign
    from pmg.pipeline.commands.stored_analysis import StoredAnalysis
    from pmg.pipeline.diagnosis.engine.verdict import Verdict
    from pmg.pipeline.model.compared_campaign import ComparedCampaign
    from pmg.pipeline.report.document import Report


@dataclass(frozen=True)
class PointTable:
    """One row a point, with the unit in the name of each column that has one.

    Parameters
    ----------
    frame : pandas.DataFrame
        The table.
    """

    frame: pd.DataFrame

    def __len__(self) -> int:
        return len(self.frame)

    def to_pandas(self) -> pd.DataFrame:
        """A copy as a pandas data frame."""
        return self.frame.copy()

    def to_polars(self) -> pl.DataFrame:
        """The table as a polars data frame."""
        return pl.DataFrame({str(name): self.frame[name].tolist() for name in self.frame.columns})

    def _repr_html_(self) -> str:
        """HTML for a notebook."""
        return str(self.frame.to_html(max_rows=20))


@dataclass(frozen=True)
class IngestedCampaigns:
    """Recordings decoded into a store.

    Parameters
    ----------
    store : Path
        The store; where none was named, a temporary one that is removed with this object.
    campaigns : tuple of str
        Names of the campaigns of these recordings.
    windows, rejected : int
        Test windows, and those that failed a check.
    findings : tuple of dict
        What the recordings lack, damage or contradict: ``severity``, ``where``, ``message``.
    """

    store: Path
    campaigns: tuple[str, ...]
    windows: int
    rejected: int
    findings: tuple[dict[str, Any], ...] = field(repr=False)


class FittingChoices(TypedDict, total=False):
    """How the losses of a campaign are fitted.

    Parameters
    ----------
    include_rest : bool, optional
        Whether readings of a shaft at rest take part in the loss curves.
    robust : bool
        Huber's M-estimate of the loss curves instead of least squares.
    damping : str, optional
        Weights of K_corr and the damping constants: ``"least-squares"`` or ``"bisquare"``.
    """

    include_rest: bool | None
    robust: bool
    damping: str | None


@dataclass(frozen=True)
class CampaignAnalysis:
    """Fits, calibration and power balance of a campaign.

    Parameters
    ----------
    whole : StoredAnalysis
        The same as the stages use it.
    kept : object
        What the samples behind the points lie in; held so that a temporary store lasts as long as this.
    """

    whole: StoredAnalysis = field(repr=False)
    kept: object = field(default=None, repr=False, compare=False)

    @property
    def campaign(self) -> str:
        """Name of the campaign."""
        return self.whole.analysis.grid.campaign

    @property
    def grid(self) -> PointTable:
        """Every point: speeds [rpm], torques and their standard uncertainties [N m], acceptance and its reason."""
        return PointTable(grid_frame(self.whole.analysis.grid))

    @property
    def losses(self) -> PointTable | None:
        """Losses [W] and efficiencies of the engaged points, each with its uncertainty; None where not reached."""
        balance = self.whole.analysis.balance
        return None if balance is None else PointTable(balance_frame(balance))

    @property
    def constants(self) -> dict[str, tuple[float, float | None]]:
        """K_corr and the damping constants, SI, each with its standard uncertainty; None where held or on a bound."""
        fitted = self.whole.analysis.calibration
        names = () if fitted is None else ("K_corr", "b", "c", "d")
        return {} if fitted is None else {name: (fitted.value(name), fitted.standard_error(name)) for name in names}

    @property
    def missing(self) -> tuple[str, ...]:
        """Steps that these points do not permit, and why."""
        return tuple(f"{error.where}: {error.came}; expected {error.expected}" for error in self.whole.analysis.missing)


@dataclass(frozen=True)
class CampaignComparison:
    """A campaign compared with its simulation.

    Parameters
    ----------
    analysis : CampaignAnalysis
        The campaign.
    simulated : SimulatedCampaign
        Its simulation, as the stages use it.
    """

    analysis: CampaignAnalysis
    simulated: SimulatedCampaign = field(repr=False)

    @property
    def residuals(self) -> PointTable:
        """Measured, simulated, and u of their difference, by point: torques [N m], total loss [W], efficiency."""
        found = self.simulated.residuals
        at = found.grid.points
        columns: dict[str, Any] = {
            "point": at.name,
            "configuration": at.configuration,
            SPEED_SUN.display_name: SPEED_SUN.display(at.speed_sun),
            SPEED_RING.display_name: SPEED_RING.display(at.speed_ring),
            "load_set_Nm": at.load_set,
        }
        for name, difference in (
            ("torque_sun_Nm", found.torque_sun),
            ("torque_ring_Nm", found.torque_ring),
            ("loss_total_W", found.loss_total),
            ("efficiency_total", found.efficiency_total),
        ):
            columns |= {f"{name}_measured": difference.measured, f"{name}_simulated": difference.simulated}
            columns[f"{name}_u_difference"] = difference.u
        return PointTable(pd.DataFrame(columns))


class WithReport(ABC):
    """What has a report, whose figures are drawn one by one."""

    @property
    @abstractmethod
    def report(self) -> Report:
        """The report as plain nouns: sections, tables, figures."""

    @property
    def figures(self) -> dict[str, str]:
        """Captions of the figures of the report, by the name that `figure` takes."""
        return {figure.id: figure.caption for figure in self.report.figures}

    def figure(self, name: str) -> bytes:
        """One figure of the report as PNG.

        Parameters
        ----------
        name : str
            One of `figures`.

        Raises
        ------
        KeyError
            When the report has no such figure.
        """
        return draw_png({figure.id: figure for figure in self.report.figures}[name])


@dataclass(frozen=True)
class CampaignDiagnosis(WithReport):
    """Diagnosis of a campaign.

    Parameters
    ----------
    analysis : CampaignAnalysis
        The campaign.
    judged : ComparedCampaign
        The diagnosis and what it rests on, as the stages use it.
    seed : int
        Of the synthetic campaigns behind the p-value.
    """

    analysis: CampaignAnalysis
    judged: ComparedCampaign = field(repr=False)
    seed: int = SEED

    @property
    def verdict(self) -> Verdict:
        """``consistent``, ``named``, ``ambiguous``, ``not_in_library`` or ``confounded``."""
        return self.judged.diagnosis.verdict

    @property
    def statement(self) -> str:
        """The verdict in sentences."""
        return self.judged.statement

    @property
    def p_value(self) -> float:
        """Of the whole search for a mismatch, by synthetic campaigns."""
        return float(self.judged.diagnosis.mismatch.p_value)

    @property
    def mechanisms(self) -> list[dict[str, Any]]:
        """The leading causes with their parameters, values, standard uncertainties and units."""
        return mechanism_facts(self.judged.diagnosis)

    @property
    def model(self) -> str:
        """The model with the causes in it, as the TOML text that `compare` takes from a file."""
        return model_text(self.judged.model)

    def to_dict(self) -> dict[str, Any]:
        """The document ``pmg.diagnosis/1``, as in ``diagnosis.json``."""
        return diagnosis_document(self.judged.diagnosis)

    @cached_property
    def report(self) -> Report:
        """The report as plain nouns: sections, tables, figures."""
        return self.report_with()

    def report_with(self, note: str = "", tolerances: Mapping[str, tuple[float, float]] | None = None) -> Report:
        """The report with a note at its head, and with tolerances that were set.

        Parameters
        ----------
        note : str
            What the reader must know about the data.
        tolerances : mapping, optional
            By quantity (``torque_sun``, ``torque_ring``, ``loss``, ``efficiency``): absolute [SI] and relative.
        """
        made = (seeded(self.seed), ("Command", "from Python, pmg.pipeline"))
        whole = self.analysis.whole
        return campaign_page(whole, self.judged, recorded_part(whole), note, tolerances, made)[0]
