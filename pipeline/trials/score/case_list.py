"""Which campaigns a trial holds, and the seed of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.laws import CHOICES, USUAL
from pmg.pipeline.trials.nature import draw_case
from pmg.pipeline.trials.strata import strata
from pmg.sim.errors import BenchError, near_miss

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.trials.nature import ConcealedCampaign
    from pmg.pipeline.trials.strata import Stratum

SHARES = {"clean": 0.25, "one": 0.40, "outside": 0.20, "two": 0.10, "confounded": 0.05}
"""Part of the campaigns of each kind; of a choice of kinds, in proportion."""
CAMPAIGNS = 200
"""Campaigns of a trial, unless set otherwise."""
SEED = 20260401
"""Master seed, unless set otherwise."""
CASES, ORDER = 0, 1
"""Branches of the master seed: campaigns, and the order of what is drawn."""
PURPOSES = ("draw", "measure", "extend")
"""Uses of random numbers in a campaign, each with its own stream."""


@dataclass(frozen=True)
class Lot:
    """One campaign of a trial.

    Parameters
    ----------
    number : int
        Place in the trial, from 0.
    stratum : Stratum
        What kind it is.
    seed : int
        Master seed.
    laws : str
        Families that its laws are drawn from, out of `CHOICES`.
    """

    number: int
    stratum: Stratum
    seed: int
    laws: str = USUAL

    def rng(self, purpose: str) -> np.random.Generator:
        """Random numbers of this campaign for one of `PURPOSES`; they ask nothing of the other campaigns."""
        own = np.random.SeedSequence(self.seed, spawn_key=(CASES, self.number))
        return np.random.default_rng(own.spawn(len(PURPOSES))[PURPOSES.index(purpose)])

    def draw(self) -> ConcealedCampaign:
        """The concealed campaign."""
        return draw_case(self.stratum, self.rng("draw"), self.laws)


def draw_lots(campaigns: int, seed: int, kinds: tuple[str, ...] = tuple(SHARES), laws: str = USUAL) -> tuple[Lot, ...]:
    """The campaigns of a trial; the first ones of a longer trial are the same.

    Parameters
    ----------
    campaigns : int
        How many.
    seed : int
        Master seed.
    kinds : tuple of str
        Kinds of campaign, out of `SHARES`.
    laws : str
        Families that laws are drawn from, out of `CHOICES`.

    Notes
    -----
    After any number of campaigns every kind has had its share, to one campaign. Within a kind every effect (or pair,
    or design) comes once before any comes again, in an order that is drawn, each time with another of its sizes; the
    shaft is drawn.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(ORDER,)))
    sources = {kind: _endless(kind, stream) for kind, stream in zip(SHARES, rng.spawn(len(SHARES)), strict=True)}
    chosen = [kind for kind in SHARES if kind in kinds]
    whole = sum(SHARES[kind] for kind in chosen)
    had = dict.fromkeys(chosen, 0)
    lots = []
    for number in range(campaigns):
        due = max(chosen, key=lambda kind: SHARES[kind] / whole * (number + 1) - had[kind])
        had[due] += 1
        lots.append(Lot(number, next(sources[due]), seed, laws))
    return tuple(lots)


def _endless(kind: str, rng: np.random.Generator) -> Iterator[Stratum]:
    """Strata of a kind in rounds: every effect once a round, from round to round in another size."""
    effects: dict[tuple[object, ...], list[Stratum]] = {}
    for stratum in strata():
        if stratum.kind == kind:
            ids = tuple(identifier for identifier, _ in stratum.effects)
            effects.setdefault((*ids, stratum.one_way) if ids else (stratum.name,), []).append(stratum)
    listed = list(effects.values())
    start = int(rng.integers(1000))
    while True:
        for place in rng.permutation(len(listed)):
            sizes = sorted({stratum.size for stratum in listed[place]})
            size = sizes[(start + int(place)) % len(sizes)]
            of_size = [stratum for stratum in listed[place] if stratum.size == size]
            yield of_size[int(rng.integers(len(of_size)))]
        start += 1


def chosen_kinds(text: str | None) -> tuple[str, ...]:
    """Kinds from ``clean,one``; all where nothing is given."""
    if text is None:
        return tuple(SHARES)
    words = tuple(dict.fromkeys(word.strip() for word in text.split(",")))
    for word in words:
        if word not in SHARES:
            raise BenchError("--strata", repr(word), f"kinds out of {', '.join(SHARES)}", near_miss(word, SHARES))
    return tuple(kind for kind in SHARES if kind in words)


def chosen_laws(text: str | None) -> str:
    """One of `CHOICES`; the usual families where nothing is given."""
    word = USUAL if text is None else text
    if word not in CHOICES:
        raise BenchError("--laws", repr(word), ", ".join(CHOICES[:-1]) + f" or {CHOICES[-1]}", near_miss(word, CHOICES))
    return word
