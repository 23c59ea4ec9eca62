"""A campaign of a store after its cross-checks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.grid.campaign import choose_campaign
from pmg.pipeline.grid.crosschecks.catalogue import cross_check

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.grid.crosschecks.catalogue import CheckedCampaign
    from pmg.pipeline.store.store import Store
    from pmg.sim.bench import BenchParameters


def checked_campaign(
    store: Store, name: str | None, bench: BenchParameters, actions: Mapping[str, str] | None = None
) -> tuple[str, CheckedCampaign]:
    """Name and recordings of a campaign, held against each other, their set-points and the bench.

    Parameters
    ----------
    store : Store
        Holds the recordings.
    name : str or None
        Of the campaign; None for the only one.
    bench : BenchParameters
        As it ships; nominal torques are those that the recordings state.
    actions : mapping, optional
        Actions of cross-checks other than the default ones, by name.

    Raises
    ------
    StoreError
        As `choose_campaign` says.
    """
    chosen, manifests = choose_campaign(store, name)
    return chosen, cross_check(manifests, bench, actions)
