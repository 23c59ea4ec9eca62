"""Chapter on the diagnosis: the verdict, what the points cannot tell, the places, and the grounds in their order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.explained.causes import cause_items, ranking_items
from pmg.pipeline.chapters.explained.grounds import cannot_tell, decoy_items, noise_words, withheld_items
from pmg.pipeline.chapters.explained.next_tests import next_test_items
from pmg.pipeline.chapters.explained.shape import shape_items
from pmg.pipeline.diagnosis.grid.covariate_words import covariate_words
from pmg.pipeline.diagnosis.grid.diagnosis import component_of
from pmg.pipeline.diagnosis.grid.remedy import warmth
from pmg.pipeline.diagnosis.grid.statement import phrase, statement
from pmg.pipeline.diagnosis.grid.track_record import track_record
from pmg.pipeline.report.document import Chart, Column, Facts, Figure, Section, Series, Table, Text
from pmg.pipeline.wording.numerals import number
from pmg.sim import sources
from pmg.sim.signals import MINUTE, RESIDUAL, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.diagnosis.grid.locate import CampaignMismatch, Location


def diagnosis_section(diagnosis: Diagnosis, residual: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Section:
    """The verdict and its grounds.

    Parameters
    ----------
    diagnosis : Diagnosis
        What was found.
    residual : (m,) array
        Measured minus simulated at the readings of the test [N m].
    """
    mismatch = diagnosis.mismatch
    items: list[Text | Facts | Table | Figure] = [
        Text(statement(diagnosis)),
        Facts(
            (
                ("Verdict", phrase(diagnosis)),
                *(
                    (("Such answers in trials", record.words),)
                    if (record := track_record(diagnosis)) is not None
                    else ()
                ),
                ("p-value of the whole procedure", _p_value(mismatch)),
                (
                    "Test",
                    f"{mismatch.tested} kinds of dependence tested, corrected for multiple testing; "
                    f"{mismatch.false_alarm_rate:.0%} of campaigns without a difference raise an alarm",
                ),
                *cannot_tell(diagnosis),
                ("Noise, sun", noise_words(diagnosis.floor, "sun")),
                ("Noise, ring", noise_words(diagnosis.floor, "ring")),
            )
        ),
    ]
    if diagnosis.floor.sun.repeats_dof == 0:
        items.append(
            Text(
                "The campaign has no repeated points, so the size of the scatter could not be judged. "
                "Repeat ten points spread over the grid to measure the repeatability.",
                kind="note",
            )
        )
    if mismatch.locations:
        items += [_locations(diagnosis), _figure(diagnosis, residual)]
    items += shape_items(diagnosis)
    items += cause_items(diagnosis)
    items += withheld_items(diagnosis)
    items += next_test_items(diagnosis)
    items += decoy_items(diagnosis)
    items += ranking_items(diagnosis)
    return Section("diagnosis", "Diagnosis", tuple(items), (sources.WESTFALL_YOUNG,))


def _p_value(mismatch: CampaignMismatch) -> str:
    drawn = f"{mismatch.draws} synthetic campaigns"
    if mismatch.p_value * (mismatch.draws + 1) < 1.5:
        return f"below {1.0 / mismatch.draws:.2g}: none of {drawn} showed one as clear"
    return f"{mismatch.p_value:.3g}, from {drawn}"


def _signal(place: Location) -> str:
    return f"{place.signal.replace('torque_', '')} torque"


def _region(place: Location) -> str:
    """Set-points over which it is strong, in words."""
    shown = {
        "sun_speed_rpm": ("sun", 0, "rpm"),
        "ring_speed_rpm": ("ring", 0, "rpm"),
        "ring_torque_Nm": ("ring torque", 2, "N m"),
    }
    return ", ".join(
        f"{name} {number(place.region[key][0], digits)} to {number(place.region[key][1], digits)} {unit}"
        for key, (name, digits, unit) in shown.items()
        if key in place.region
    )


def _words(names: tuple[str, ...]) -> str:
    return ", ".join(covariate_words(names)) or "nothing recorded"


def _locations(diagnosis: Diagnosis) -> Table:
    places = diagnosis.mismatch.locations
    return Table(
        "locations",
        "Where it sits",
        f"{len(places)} place{'s' if len(places) > 1 else ''}, clearest first; each with the earlier ones added to the "
        "baseline. Sizes are the part that the fitted losses do not absorb; the effect itself may be larger.",
        (
            Column("signal", "Signal"),
            Column("configuration", "Configuration"),
            Column("component", "Component"),
            Column("depends_on", "Follows"),
            Column("region", "Over"),
            Column("size", "rms size", "mN m", digits=2),
            Column("peak", "peak", "mN m", digits=2),
            Column("p_value", "p-value ≤", "", format=".2g"),
        ),
        tuple(
            (
                _signal(place),
                place.configuration,
                str(component_of(place) or "cannot tell").replace("_", " "),
                _words(place.depends_on),
                _region(place),
                place.size * 1e3,
                place.peak * 1e3,
                place.p_value,
            )
            for place in places
        ),
    )


def _figure(diagnosis: Diagnosis, residual: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Figure:
    place = diagnosis.mismatch.locations[0]
    readings = diagnosis.mismatch.readings
    rows = np.flatnonzero(place.effect != 0.0)
    x, label = _covariate(diagnosis, place, rows)
    memory, warmth = _memory(diagnosis)
    order = np.argsort(x, kind="stable")
    sign = readings.direction[rows]
    chart = Chart(
        label,
        "drag, measured − simulated [mN m]",
        (
            Series(
                "residual, U = 2u",
                x[order],
                RESIDUAL.display(sign * residual[rows])[order],
                readings.u[rows][order] / RESIDUAL.scale,
                "markers",
                0,
            ),
            Series(
                "fitted dependence", x[order], RESIDUAL.display(sign * place.effect[rows])[order], None, "markers", 1
            ),
        ),
        references=(("", 0.0),),
    )
    return Figure(
        "located-structure",
        "The clearest place",
        f"{_signal(place).capitalize()} in {place.configuration} points: the residual and its dependence on "
        f"{_words(place.depends_on)}.{memory}",
        (chart, *warmth),
    )


def _memory(diagnosis: Diagnosis) -> tuple[str, tuple[Chart, ...]]:
    """Meaning of the residual's zero where a mechanism remembers, and the fitted temperature over the test."""
    naming, found = diagnosis.naming, diagnosis.refit
    if naming is None or found is None or not any(fit.candidate.kind.memory for fit in naming.best.fits):
        return "", ()
    zero = " Zero is the baseline's fit to the whole campaign, not the state at its first point"
    at = diagnosis.mismatch.readings.grid.points
    for mechanism in found.mechanisms(naming.best.problem) if at.ordered else ():
        what, rise = warmth(mechanism, diagnosis.mismatch.locations[0].signal.removeprefix("torque_"), at)
        known = np.isfinite(rise)
        if not known.any():
            continue
        order = np.flatnonzero(known)[np.argsort(at.started_at[known], kind="stable")]
        time, rise = (at.started_at[order] - at.started_at.min()) / MINUTE, rise[order]
        text = (
            f"{zero}: it holds the drag at the campaign's usual warmth, so drag lies below it while the {what} are "
            f"warmer than that and above it while they are cooler. As fitted they are {number(rise[0], 1)} K above "
            f"the room at the first point and {number(rise.min(), 1)} to {number(rise.max(), 1)} K over the campaign "
            "(lower panel)."
        )
        series = Series("", time, rise, None, "both", 2)
        return text, (Chart("time since the first point [min]", f"{what} above the room, fitted [K]", (series,)),)
    return f"{zero}, from which the mechanism counts.", ()


def _covariate(
    diagnosis: Diagnosis, place: Location, rows: np.ndarray[tuple[int], np.dtype[np.int64]]
) -> tuple[np.ndarray[tuple[int], np.dtype[np.float64]], str]:
    readings = diagnosis.mismatch.readings
    at = readings.grid.points
    row = readings.row[rows]
    first = place.depends_on[0] if place.depends_on else ""
    if first in ("load", "power_flow"):
        return at.torque_ring[row], "ring torque [N m]"
    if first == "speed_ring":
        return SPEED_RING.display(np.abs(at.speed_ring[row])), SPEED_RING.label
    if first == "speed_sun" or not at.ordered:
        return SPEED_SUN.display(np.abs(at.speed_sun[row])), SPEED_SUN.label
    return (at.started_at[row] - at.started_at.min()) / MINUTE, "time since the first point [min]"
