"""Concealed campaigns: drawn from a bench of its own, measured with noise, their truth sealed.

Nothing here is shared with the models that have to find the effects: neither code nor formulas.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.write import COUNTS_PER_REV
from pmg.pipeline.trials.absorb import Scaled, Yardstick, scale_on
from pmg.pipeline.trials.design import CampaignDesign, draw_design
from pmg.pipeline.trials.effect import BenchRun, Effect, torques
from pmg.pipeline.trials.laws import USUAL
from pmg.pipeline.trials.strata import Stratum, form_of
from pmg.pipeline.trials.world import FASTEST_RING, FASTEST_SUN, WINDOW, World, draw_world
from pmg.pipeline.windows.revolutions import BATCHES
from pmg.sim.grid import Grid
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pmg.pipeline.trials.effect import Pair

SCHEMA = "pmg.truth/1"
SEEN = 0.3
"""Size after absorption from which an effect should be seen [sigma]."""
SPEED_ERROR = 3e-4
"""Relative standard deviation of a speed from its set-point."""


@dataclass(frozen=True)
class ConcealedCampaign:
    """A concealed campaign.

    Parameters
    ----------
    campaign : str
        Its name, which tells nothing.
    stratum : Stratum
        What kind it is.
    design, world : CampaignDesign, World
        What is run, and on which bench.
    effects : tuple of Scaled
        What is concealed.
    nonce : str
        Random digits, so that a sealed truth cannot be guessed.
    """

    campaign: str
    stratum: Stratum
    design: CampaignDesign
    world: World
    effects: tuple[Scaled, ...]
    nonce: str

    @cached_property
    def scene(self) -> BenchRun:
        """The design on the world."""
        return BenchRun(self.design, self.world)

    @cached_property
    def applied(self) -> Pair:
        """Torques of both motors without noise [N m]."""
        return torques(self.scene, [scaled.effect for scaled in self.effects])[0]

    @cached_property
    def shown(self) -> Pair:
        """Readings without noise [N m]."""
        return torques(self.scene, [scaled.effect for scaled in self.effects])[1]

    @cached_property
    def bare(self) -> Pair:
        """Readings without noise and without any effect [N m]."""
        return torques(self.scene, ())[1]

    @property
    def sigma(self) -> float:
        """Standard uncertainty of one point's mean [N m]."""
        return self.world.sigma(self.design)

    @property
    def expected(self) -> tuple[str, ...]:
        """Verdicts that are right: those of the stratum, and that all is well where nothing is left to be seen."""
        return right_verdicts(self.stratum.expected, (scaled.reached for scaled in self.effects))

    @property
    def truth(self) -> dict[str, Any]:
        """All that is concealed, ready for JSON."""
        world, at = asdict(self.world), self.design.at
        return {
            "schema": SCHEMA,
            "campaign": self.campaign,
            "nonce": self.nonce,
            "stratum": self.stratum.name,
            "kind": self.stratum.kind,
            "expected": list(self.expected),
            "sigma_Nm": self.sigma,
            "effects": [_effect_truth(scaled) for scaled in self.effects],
            "design": {
                "order": self.design.order,
                "extended": self.design.extended,
                "one_way": self.design.one_way,
                "points": len(at),
            },
            "world": world,
            "points": {
                "name": at.name.tolist(),
                "torque_sun_Nm": np.round(self.shown[0], 7).tolist(),
                "torque_ring_Nm": np.round(self.shown[1], 7).tolist(),
                "torque_sun_without_Nm": np.round(self.bare[0], 7).tolist(),
                "torque_ring_without_Nm": np.round(self.bare[1], 7).tolist(),
            },
        }


def right_verdicts(expected: tuple[str, ...], reached: Iterable[float]) -> tuple[str, ...]:
    """Verdicts of a stratum, and that all is well where no effect reaches a size that is seen [sigma]."""
    seen = any(size >= SEEN for size in reached)
    return expected if seen or "consistent" in expected else (*expected, "consistent")


def _effect_truth(scaled: Scaled) -> dict[str, Any]:
    return {
        **scaled.effect.truth,
        "asked_sigma": scaled.asked,
        "reached_sigma": scaled.reached,
        "raw_sigma": scaled.raw,
        "rms_where_it_acts_Nm": scaled.touched,
        "absorbed_part": scaled.absorbed,
        "basis": scaled.basis,
        "limited": scaled.limited,
    }


def _draw_effect(
    identifier: str,
    shaft: str,
    scene: BenchRun,
    rng: np.random.Generator,
    pinned: Iterable[tuple[str, float | str]] = (),
    laws: str = USUAL,
) -> Effect:
    """An effect of that id with law and shape drawn, where they are not pinned, and a size of the usual order."""
    form, fixed = form_of(identifier), dict(pinned)
    return Effect(form, shaft, form.first, form.knobs(scene, rng) | form.laws.draw(laws, rng, fixed) | fixed)


def draw_case(stratum: Stratum, rng: np.random.Generator, laws: str = USUAL) -> ConcealedCampaign:
    """A concealed campaign of that kind, whose effects follow usual laws, reserved ones, or any."""
    world = draw_world(rng, stratum.outliers)
    design = draw_design(rng, order=stratum.order, extended=stratum.extended, one_way=stratum.one_way)
    yardstick = Yardstick(BenchRun(design, world))
    drawn = [_draw_effect(*named, yardstick.scene, rng, stratum.pinned, laws) for named in stratum.effects]
    effects = tuple(scale_on(yardstick, effect, stratum.size, stratum.basis) for effect in drawn)
    return ConcealedCampaign(f"campaign-{rng.bytes(4).hex()}", stratum, design, world, effects, rng.bytes(16).hex())


def seal_truth(truth: Mapping[str, Any]) -> tuple[str, str]:
    """Text of ``truth.json``, and its SHA-256, which may be published beforehand."""
    text = json.dumps(truth, indent=1, sort_keys=True) + "\n"
    return text, hashlib.sha256(text.encode("utf-8")).hexdigest()


@dataclass(frozen=True)
class WindowReadings:
    """State of the bench through each window: readings with their wander [N m], and speeds [rad/s]."""

    torques: Pair
    speeds: Pair


def hold_points(case: ConcealedCampaign, rng: np.random.Generator) -> WindowReadings:
    """One run of the campaign, up to what varies within the windows."""
    at, world = case.design.at, case.world
    torques = []
    for shown, speed, rest, fastest in (
        (case.shown[0], at.speed_sun, at.rest_sun, FASTEST_SUN),
        (case.shown[1], at.speed_ring, at.rest_ring, FASTEST_RING),
    ):
        reaction = np.where(at.neutral & rest, world.reaction * rng.standard_normal(len(at)), 0.0)
        torques.append(shown + reaction + world.noise.wander_of(speed, fastest, rng))
    error = 1.0 + SPEED_ERROR * rng.standard_normal(len(at))
    error_ring = np.where(at.engaged, error, 1.0 + SPEED_ERROR * rng.standard_normal(len(at)))
    return WindowReadings((torques[0], torques[1]), (at.speed_sun * error, at.speed_ring * error_ring))


def measure_case(case: ConcealedCampaign, rng: np.random.Generator) -> Grid:
    """The campaign as a measured grid: what reading its recordings would give, without writing them."""
    readings, noise, n = hold_points(case, rng), case.world.noise, len(case.design.at)
    means, within = [], []
    for torque, scatter in zip(readings.torques, (noise.mean_sun, noise.mean_ring), strict=True):
        means.append(torque + scatter * rng.standard_normal(n))
        within.append(scatter * np.sqrt(rng.chisquare(BATCHES - 1, n) / (BATCHES - 1)))
    step = REVOLUTION / COUNTS_PER_REV / WINDOW
    speed_sun, speed_ring = (np.round(speed / step) * step for speed in readings.speeds)
    nothing = np.zeros(n)
    return Grid(
        origin="measured",
        campaign=case.campaign,
        points=replace(case.design.at, torque_ring=means[1], speed_sun=speed_sun, speed_ring=speed_ring),
        torque_sun=means[0],
        torque_ring=means[1],
        within_sun=within[0],
        within_ring=within[1],
        u_sun=within[0],
        u_ring=within[1],
        common_sun=nothing,
        common_ring=nothing,
        accepted=np.ones(n, dtype=bool),
        reason=np.full(n, ""),
    )
