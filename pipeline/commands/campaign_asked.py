"""The campaign of a store that a command works on: the analysed one, or one that holds runs in motion only."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

from pmg.pipeline.analysis.outputs import analysed_campaign
from pmg.pipeline.grid.campaign import campaigns
from pmg.pipeline.motion.stored import only_in_motion
from pmg.pipeline.store.store import MARK, Store
from pmg.sim.errors import StoreError, near_miss

if TYPE_CHECKING:
    from pathlib import Path


def campaign_in_motion(store: Path, campaign: str | None) -> str | None:
    """Name of the campaign asked for, or of the only one, where it has no steady grid; None for any other."""
    if not (store / MARK).is_file():
        return None
    manifests = Store(store).manifests()
    known = campaigns(manifests)
    name = known[0] if campaign is None and len(known) == 1 else campaign
    return name if name and only_in_motion(m for m in manifests if m.ingested and m.campaign == name) else None


def asked_in_motion(store: Path, campaign: str | None) -> str | None:
    """The campaign in motion that is asked for; None where it is the analysed one.

    Raises
    ------
    StoreError
        The store holds no campaign of that name, or the analysis of another.
    """
    analysed = analysed_campaign(store)
    moving = campaign_in_motion(store, campaign or analysed)
    if moving is not None or campaign is None or campaign == analysed:
        return moving
    known = {*(campaigns(Store(store).manifests()) if (store / MARK).is_file() else ()), *filter(None, [analysed])}
    if known and campaign not in known:
        raise StoreError(str(store), f"no campaign '{campaign}'", "one of the store's", near_miss(campaign, known))
    if analysed is None:
        return None
    do = f"Analyse it first: pmg analyse --store {shlex.quote(str(store))} --campaign {shlex.quote(campaign)}"
    raise StoreError(str(store), f"the analysis of campaign '{analysed}'", f"that of '{campaign}'", do)
