"""Which campaigns a trial holds, and the seed of each."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from pmg.pipeline.trials.laws import CHOICES, USUAL
from pmg.pipeline.trials.motion.nature import draw_motion_case
from pmg.pipeline.trials.motion.strata import MotionStratum, motion_strata
from pmg.pipeline.trials.nature import draw_case
from pmg.pipeline.trials.strata import Stratum, strata
from pmg.sim.errors import BenchError, near_miss

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Self

    from pmg.pipeline.trials.motion.nature import MotionCase
    from pmg.pipeline.trials.motion.size import SizedEffect
    from pmg.pipeline.trials.nature import ConcealedCampaign

S = TypeVar("S", Stratum, MotionStratum)

SHARES = {"clean": 0.25, "one": 0.40, "outside": 0.20, "two": 0.10, "confounded": 0.05}
"""Part of the campaigns of each kind; of a choice of kinds, in proportion."""
TRACKS = ("steady", "motion", "machines")
"""Kinds of trial: campaigns of steady points, of runs in motion, or of other machines."""
CAMPAIGNS = 200
"""Campaigns of a trial, unless set otherwise."""
SEED = 20260401
"""Master seed, unless set otherwise."""
CASES, ORDER = 0, 1
"""Branches of the master seed: campaigns, and the order of what is drawn."""
PURPOSES = ("draw", "measure", "extend")
"""Uses of random numbers in a campaign, each with its own stream."""


@dataclass(frozen=True)
class AnyLot(ABC, Generic[S]):
    """One campaign of a trial.

    Parameters
    ----------
    number : int
        Place in the trial, from 0.
    stratum : Stratum or MotionStratum
        What kind it is.
    seed : int
        Master seed.
    laws : str
        Families that its laws are drawn from, out of `CHOICES`.
    """

    number: int
    stratum: S
    seed: int
    laws: str = USUAL

    def rng(self, purpose: str) -> np.random.Generator:
        """Random numbers of this campaign for one of `PURPOSES`; they ask nothing of the other campaigns."""
        own = np.random.SeedSequence(self.seed, spawn_key=(CASES, self.number))
        return np.random.default_rng(own.spawn(len(PURPOSES))[PURPOSES.index(purpose)])

    @abstractmethod
    def draw(self) -> ConcealedCampaign | MotionCase:
        """The concealed campaign."""

    def draw_sized(self) -> tuple[ConcealedCampaign | MotionCase, Self]:
        """The campaign, and this lot with its effects already sized, where sizing takes long."""
        return self.draw(), self


@dataclass(frozen=True)
class Lot(AnyLot[Stratum]):
    """A campaign of steady points."""

    def draw(self) -> ConcealedCampaign:
        """The concealed campaign."""
        return draw_case(self.stratum, self.rng("draw"), self.laws)


@dataclass(frozen=True)
class MotionLot(AnyLot[MotionStratum]):
    """A campaign of runs in motion.

    Parameters
    ----------
    sized : tuple of SizedEffect, optional
        Its effects as an earlier draw sized them.
    """

    sized: tuple[SizedEffect, ...] | None = field(default=None, compare=False)

    def draw(self) -> MotionCase:
        """The concealed campaign."""
        return draw_motion_case(self.rng("draw"), self.stratum, laws=self.laws, sized=self.sized)

    def draw_sized(self) -> tuple[MotionCase, Self]:
        """The campaign, and this lot with its effects already sized."""
        case = self.draw()
        return case, replace(self, sized=case.effects)


def draw_lots(campaigns: int, seed: int, kinds: tuple[str, ...] = tuple(SHARES), laws: str = USUAL) -> tuple[Lot, ...]:
    """The campaigns of a trial of steady points; the first ones of a longer trial are the same.

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
    drawn = _drawn(strata(), campaigns, seed, kinds)
    return tuple(Lot(number, stratum, seed, laws) for number, stratum in enumerate(drawn))


def draw_motion_lots(
    campaigns: int, seed: int, kinds: tuple[str, ...] = tuple(SHARES), laws: str = USUAL
) -> tuple[MotionLot, ...]:
    """The campaigns of a trial of runs in motion, in the same way."""
    drawn = _drawn(motion_strata(), campaigns, seed, kinds)
    return tuple(MotionLot(number, stratum, seed, laws) for number, stratum in enumerate(drawn))


def _drawn(every: Sequence[S], campaigns: int, seed: int, kinds: tuple[str, ...]) -> Iterator[S]:
    """Kind of each campaign of a trial."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(ORDER,)))
    sources = {
        kind: _endless([stratum for stratum in every if stratum.kind == kind], stream)
        for kind, stream in zip(SHARES, rng.spawn(len(SHARES)), strict=True)
    }
    chosen = [kind for kind in SHARES if kind in kinds]
    whole = sum(SHARES[kind] for kind in chosen)
    had = dict.fromkeys(chosen, 0)
    for number in range(campaigns):
        due = max(chosen, key=lambda kind: SHARES[kind] / whole * (number + 1) - had[kind])
        had[due] += 1
        yield next(sources[due])


def _endless(of_kind: Sequence[S], rng: np.random.Generator) -> Iterator[S]:
    """Strata of a kind in rounds: every effect once a round, from round to round in another size."""
    effects: dict[tuple[object, ...], list[S]] = {}
    for stratum in of_kind:
        effects.setdefault(stratum.group, []).append(stratum)
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


def chosen_track(text: str | None) -> str:
    """One of `TRACKS`; the first where nothing is given."""
    word = TRACKS[0] if text is None else text
    if word not in TRACKS:
        raise BenchError("--track", repr(word), " or ".join(TRACKS), near_miss(word, TRACKS))
    return word


def chosen_laws(text: str | None) -> str:
    """One of `CHOICES`; the usual families where nothing is given."""
    word = USUAL if text is None else text
    if word not in CHOICES:
        raise BenchError("--laws", repr(word), ", ".join(CHOICES[:-1]) + f" or {CHOICES[-1]}", near_miss(word, CHOICES))
    return word
