"""One of the two campaigns that are compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.analysis.outputs import read_analysis
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.campaign import measured_grid
from pmg.pipeline.grid.crosschecks.checked import checked_campaign
from pmg.pipeline.grid.window_facts import rated, window_facts
from pmg.pipeline.store.store import Store
from pmg.sim.errors import StoreError
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid


@dataclass(frozen=True)
class TransducerIdentity:
    """Which transducer it was, as the calibrations of all recordings of a campaign name it."""

    serial: str
    nominal_torque: float
    span_hz: float


@dataclass(frozen=True)
class CampaignSide:
    """An analysed campaign.

    Parameters
    ----------
    label : str
        ``A`` or ``B``.
    analysis : Analysis
        Of the campaign.
    bench : BenchParameters
        With the transducers of the campaign.
    transducers : mapping of str to TransducerIdentity or None
        By shaft; None where the recordings name none, or more than one.
    manifests : tuple of Manifest
        Of its recordings; none for published grids.
    """

    label: str
    analysis: Analysis
    bench: BenchParameters
    transducers: Mapping[str, TransducerIdentity | None]
    manifests: tuple[Manifest, ...] = ()

    @property
    def grid(self) -> Grid:
        """Its points."""
        return self.analysis.grid

    @property
    def name(self) -> str:
        """Label and campaign."""
        return f"{self.label} ({self.grid.campaign})"

    @property
    def contents(self) -> frozenset[str]:
        """SHA-256 of its recordings."""
        return frozenset(manifest.sha256 for manifest in self.manifests)


def read_side(label: str, store: Path, campaign: str | None, bench: BenchParameters) -> CampaignSide:
    """A campaign of a store, by the options that its analysis was made with.

    A store keeps the analysis of one campaign. Another one that it holds is analysed here, by the options of that
    analysis, or by the usual ones where there is none.

    Parameters
    ----------
    label : str
        ``A`` or ``B``.
    store : Path
        Holds the recordings, and the analysis of one campaign.
    campaign : str, optional
        Which campaign; the analysed one where it is not given.
    bench : BenchParameters
        The bench.

    Raises
    ------
    StoreError
        There is no such campaign, or no analysis and no campaign named.
    """
    if not store.is_dir():
        raise StoreError(str(store), "no folder", f"the store of campaign {label}", "Check the path.")
    options = AnalysisOptions()
    try:
        grid, options = read_analysis(store)
    except StoreError:
        if campaign is None:
            raise
        grid = None
    manifests: Sequence[Manifest] = ()
    if grid is None or (campaign is not None and campaign != grid.campaign):
        name, checked = checked_campaign(Store(store), campaign, bench, options.checks)
        manifests = checked.manifests
        grid = measured_grid(name, list(manifests), bench)
    elif grid.origin != "published":
        manifests = checked_campaign(Store(store), grid.campaign, bench, options.checks)[1].manifests
    if manifests:
        bench = rated(bench, window_facts(manifests))
    analysis = analyse(grid, options, bench)
    return CampaignSide(label, analysis, bench, _transducers_of(manifests), tuple(manifests))


def _transducers_of(manifests: Sequence[Manifest]) -> dict[str, TransducerIdentity | None]:
    """The transducer of each shaft, where every recording names the same one by its serial number."""
    found: dict[str, TransducerIdentity | None] = {}
    for side in SIDES:
        named = {
            TransducerIdentity(of.serial, of.nominal_torque, of.span_hz)
            for of in (manifest.calibration[side] for manifest in manifests)
        }
        only = next(iter(named)) if len(named) == 1 else None
        found[side] = only if only is not None and only.serial else None
    return found
