"""Earlier contents of a file, which leave the store when a corrected version of the same run comes in."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pmg.pipeline.store.manifest import Manifest
    from pmg.pipeline.store.sources import StoredSource
    from pmg.pipeline.store.store import Store


def supersede(store: Store, sources: tuple[StoredSource, ...]) -> list[Manifest]:
    """Remove what the store holds of earlier contents of these very files; the manifests that are left.

    Other bytes at the same place that tell of the same run (campaign and start) are a corrected version; a failed
    file at the same place was mended; the same bytes under two names came from two processes at once. Were both
    kept, points would count twice. Another run that was written over an earlier one leaves that one in the store.
    """
    current = {source.sha256 for source in sources}
    whole = store.manifests()
    manifests = sorted(whole, key=lambda m: (not m.ingested, m.identifier))
    runs = {m.place: _run_of(m) for m in manifests if m.sha256 in current and m.ingested}
    kept: set[str] = set()
    gone: set[str] = set()
    for manifest in manifests:
        place, sha256 = manifest.place, manifest.sha256
        twice = sha256 in current and sha256 in kept
        corrected = sha256 not in current and place in runs and _run_of(manifest) in (None, runs[place])
        kept.add(sha256)
        if twice or corrected:
            store.remove(manifest.identifier)
            gone.add(manifest.identifier)
    return [manifest for manifest in whole if manifest.identifier not in gone]


def _run_of(manifest: Manifest) -> tuple[str, str] | None:
    """Campaign and start of an ingested source."""
    return (manifest.campaign, manifest.started_at) if manifest.ingested else None
