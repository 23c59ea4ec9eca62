"""Every cross-check with its name, meaning and default action; and a campaign held against all of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.grid.crosschecks.campaign_files import (
    calibrations_unlike_the_others,
    repeats_that_differ,
    samples_of_another_run,
    simulated_among_measured,
    versions_of_one_run,
)
from pmg.pipeline.grid.crosschecks.channels import (
    encodings_that_differ,
    means_moved_by_spikes,
    sample_rates_off_the_host,
    starts_off_the_host,
)
from pmg.pipeline.grid.crosschecks.contradiction import Action, Contradiction
from pmg.pipeline.grid.crosschecks.declared import (
    coupled_in_neutral,
    driven_from_the_other_side,
    encoders_off_the_ratio,
    gears_by_speeds,
)
from pmg.pipeline.grid.crosschecks.set_points import (
    loads_off_set_point,
    speeds_off_the_others,
    zero_checks_that_turn,
)
from pmg.pipeline.grid.crosschecks.transducers import torques_off_the_other_shaft, transducers_off_the_ratio
from pmg.pipeline.grid.window_facts import rated, window_facts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from pmg.pipeline.grid.crosschecks.contradiction import CrossCheckRemark
    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.bench import BenchParameters


@dataclass(frozen=True)
class CrossCheck:
    """A cross-check.

    Parameters
    ----------
    name : str
        By which findings and the table ``[checks]`` of a campaign file call it.
    action : Action
        What is done unless the campaign file says otherwise.
    held_against : str
        What a recording is held against, in a phrase.
    search : callable
        Takes the recordings of a campaign and the bench; gives contradictions.
    """

    name: str
    action: Action
    held_against: str
    search: Callable[[Sequence[Manifest], BenchParameters], Iterator[Contradiction]]


_REJECT, _WIDEN, _KEEP = Action.REJECT, Action.WIDEN, Action.KEEP

CROSS_CHECKS: tuple[CrossCheck, ...] = (
    CrossCheck("simulated-data", _REJECT, "measured recordings of the campaign", simulated_among_measured),
    CrossCheck("calibration", _REJECT, "calibrations with the same serial number", calibrations_unlike_the_others),
    CrossCheck("versions", _REJECT, "the same run in another file", versions_of_one_run),
    CrossCheck("same-samples", _REJECT, "means of all other runs, digit by digit", samples_of_another_run),
    CrossCheck("sample-rate", _REJECT, "times at which the host wrote the blocks", sample_rates_off_the_host),
    CrossCheck("start-time", _KEEP, "time at which the host wrote the first block", starts_off_the_host),
    CrossCheck("two-encodings", _REJECT, "the same torque as edges and as frequency", encodings_that_differ),
    CrossCheck("zero-check", _REJECT, "both shafts at rest", zero_checks_that_turn),
    CrossCheck("gear", _REJECT, "ratio of the measured speeds", gears_by_speeds),
    CrossCheck("configuration", _REJECT, "power carried from shaft to shaft", coupled_in_neutral),
    CrossCheck("drive", _KEEP, "direction of the power", driven_from_the_other_side),
    CrossCheck("speed", _KEEP, "speeds of the campaign against their set-points", speeds_off_the_others),
    CrossCheck("load", _REJECT, "set-point of the load, and the campaign's other loads", loads_off_set_point),
    CrossCheck("spikes", _WIDEN, "the mean without samples far off the others", means_moved_by_spikes),
    CrossCheck("repeats", _WIDEN, "other recordings of the same point", repeats_that_differ),
    CrossCheck("torque-balance", _WIDEN, "torque of the other shaft", torques_off_the_other_shaft),
    CrossCheck("encoder-ratio", _KEEP, "ratio of the gear, to which coupled shafts turn", encoders_off_the_ratio),
    CrossCheck("transducer-ratio", _KEEP, "torque of the other shaft and the gear's ratio", transducers_off_the_ratio),
)
"""In the order in which they are made: what one rejects, the next ones no longer see."""


def allowed_actions(name: str) -> tuple[Action, ...]:
    """Actions that a campaign file may choose for a check: only a doubt with a size of its own can widen.

    Raises
    ------
    KeyError
        There is no check of that name.
    """
    default = {check.name: check.action for check in CROSS_CHECKS}[name]
    if name in ("encoder-ratio", "transducer-ratio"):  # of the campaign as a whole: there is nothing to reject
        return (_KEEP,)
    return (_REJECT, _KEEP) + ((_WIDEN,) if default is _WIDEN else ())


@dataclass(frozen=True)
class CheckedCampaign:
    """The recordings of a campaign after the cross-checks.

    Parameters
    ----------
    manifests : tuple of Manifest
        With windows rejected, or their uncertainty widened.
    findings : tuple of CrossCheckRemark
        Every contradiction, by name, with its size and limit.
    """

    manifests: tuple[Manifest, ...]
    findings: tuple[CrossCheckRemark, ...]


def cross_check(
    manifests: Sequence[Manifest], bench: BenchParameters, actions: Mapping[str, str] | None = None
) -> CheckedCampaign:
    """The recordings of a campaign held against each other, their set-points and the bench.

    Parameters
    ----------
    manifests : sequence of Manifest
        Usable recordings of one campaign, without copies.
    bench : BenchParameters
        As it ships; nominal torques are those that the recordings state.
    actions : mapping, optional
        Actions other than the default, by name of the check.
    """
    whole = rated(bench, window_facts(manifests))
    chosen = {check.name: Action((actions or {}).get(check.name, check.action)) for check in CROSS_CHECKS}
    checked = list(manifests)
    findings: list[CrossCheckRemark] = []
    for check in CROSS_CHECKS:
        action = chosen[check.name]
        for contradiction in list(check.search(checked, whole)):
            findings.append(contradiction.finding(check.name, action))
            checked = contradiction.applied(checked, check.name, action)
    return CheckedCampaign(tuple(checked), tuple(findings))
