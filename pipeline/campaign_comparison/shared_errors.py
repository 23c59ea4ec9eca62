r"""Which common errors of two campaigns are the same error, and what they leave in a difference.

Rule
----
A transducer's sensitivity and non-linearity are the same error in both campaigns where both used the same
transducer: the calibrations name one serial number, nominal torque and span on that shaft in every recording.
Then what one standard uncertainty of it does to B minus what it does to A is left, next to nothing at equal
torques. Otherwise they are two errors and add in quadrature. The tare is another one in each campaign: zeros
wander between tests. What the scatter of the readings does to curves, K_corr and damping constants is another one
in each campaign too; what the transducers do to them follows the transducers. That the non-linearity may differ
between two torques within the tolerance of a match is neglected.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.campaign_comparison.transducers import Transducers
from pmg.sim.shafts import SIDES, PerShaft

if TYPE_CHECKING:
    from pmg.pipeline.campaign_comparison.side import CampaignSide
    from pmg.pipeline.fit.common_errors import TransducerCause
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class Sharing(PerShaft[bool]):
    """Whether both campaigns used the same transducer, by shaft, and why that is said."""

    description: str


def sharing(a: CampaignSide, b: CampaignSide, stated: Transducers) -> Sharing:
    """Whether A and B used the same transducers: as stated, else as their calibrations say."""
    if stated is not Transducers.AUTO:
        same = stated is Transducers.SAME
        return Sharing(same, same, f"{stated.value} on both shafts, as stated by --transducers")
    found, lines = {}, []
    for shaft in SIDES:
        one, other = a.transducers.get(shaft), b.transducers.get(shaft)
        found[shaft] = one is not None and one == other
        if one is None or other is None:
            lines.append(f"{shaft}: taken as different, since not both campaigns name one by its serial number")
        elif one == other:
            lines.append(f"{shaft}: the same ({one.serial})")
        elif one.serial == other.serial:
            lines.append(f"{shaft}: taken as different ({one.serial}, other nominal torque or span)")
        else:
            lines.append(f"{shaft}: different ({one.serial}, {other.serial})")
    return Sharing(found["sun"], found["ring"], "; ".join(lines))


def left_over(
    shared: Sharing,
    a: tuple[tuple[TransducerCause, ...], Array],
    b: tuple[tuple[TransducerCause, ...], Array],
) -> Array:
    """Effect of one standard uncertainty of each common error on B minus A.

    Parameters
    ----------
    shared : Sharing
        Which transducers are the same.
    a, b : tuple of (causes, (..., r) array)
        The common errors of a campaign and their effects, those of the transducers first, in their order; what
        follows is of the campaign alone.

    Returns
    -------
    (..., s) array
        Effects of independent errors.
    """
    names_a, names_b = [cause.name for cause in a[0]], [cause.name for cause in b[0]]
    columns, used = [], set[str]()
    for i, cause in enumerate(a[0]):
        if cause.name in names_b and _one_error(cause, shared):
            columns.append(b[1][..., names_b.index(cause.name)] - a[1][..., i])
            used.add(cause.name)
        else:
            columns.append(a[1][..., i])
    columns += [b[1][..., i] for i, name in enumerate(names_b) if name not in used]
    alone = (a[1][..., len(names_a) :], b[1][..., len(names_b) :])
    return np.concatenate([*(column[..., None] for column in columns), *alone], axis=-1)


def _one_error(cause: TransducerCause, shared: Sharing) -> bool:
    shaft = "sun" if cause.sun.any() else "ring"
    return shared[shaft] and not cause.name.startswith("tare")
