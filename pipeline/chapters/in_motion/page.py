"""The page of a campaign of runs in motion: the verdict and its grounds, then each run, the bench, and its response."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.chapters.arrange import arranged
from pmg.pipeline.chapters.bench_parts import asked_of
from pmg.pipeline.chapters.in_motion.action_sheet import action_sheet
from pmg.pipeline.chapters.in_motion.bench import constants_section, loss_curve_section, pole_angle_section
from pmg.pipeline.chapters.in_motion.response import response_section
from pmg.pipeline.chapters.in_motion.runs import runs_section
from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.diagnosis.motion.design.remedy import can_be_mended, would_tell
from pmg.pipeline.diagnosis.motion.shooting import shoot
from pmg.pipeline.diagnosis.motion.traces import effects_of, traces_of
from pmg.pipeline.report.document import (
    Caution,
    Cell,
    Column,
    Facts,
    Figure,
    Headline,
    Measured,
    Report,
    Section,
    Table,
    Text,
)
from pmg.pipeline.wording.units import MILLI
from pmg.sim import sources
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from typing import Any

    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis


def motion_report(
    diagnosis: MotionDiagnosis,
    document: dict[str, Any],
    counted: tuple[tuple[str, str], ...],
    warnings: tuple[str, ...],
    *,
    note: str,
    provenance: tuple[tuple[str, str], ...],
) -> Report:
    """The report of a campaign in motion.

    Parameters
    ----------
    diagnosis : MotionDiagnosis
        What was found.
    document : dict
        The same as ``diagnosis.json``.
    counted : tuple of (label, value)
        Figures of the campaign for the first screen.
    warnings : tuple of str
        What the reader must know of runs that were set aside.
    note : str
        What the reader must know about the data; may be empty.
    provenance : tuple of (label, value)
        Inputs, seed, command.
    """
    effects = effects_of(diagnosis)
    traces = traces_of(diagnosis, effects)
    sections = (
        _diagnosis(diagnosis, document),
        runs_section(diagnosis, traces, shoot(traces)),
        constants_section(diagnosis),
        loss_curve_section(diagnosis, traces),
        pole_angle_section(diagnosis, traces),
        response_section(diagnosis, traces),
    )
    good = not (diagnosis.mismatch.found or diagnosis.unseen or warnings)
    return Report(
        title=f"Campaign {diagnosis.campaign}",
        subtitle=note or "Planetary magnetic gearbox: runs in motion, and what explains the difference to the model",
        verdict=Headline(
            document["statement"],
            "good" if good else "attention",
            counted,
            tuple(map(Caution, warnings)),
            "" if good else asked_of(diagnosis.verdict, repair=can_be_mended(diagnosis), test=would_tell(diagnosis)),
        ),
        sections=arranged(tuple(section for section in sections if section is not None)),
        provenance=Facts((*provenance, ("Versions", versions(PACKAGES)))),
        sheet=action_sheet(diagnosis, document, effects, traces),
    )


def _diagnosis(diagnosis: MotionDiagnosis, document: dict[str, Any]) -> Section:
    """The verdict and its grounds."""
    mismatch, noise = diagnosis.mismatch, document["noise_Nm"]
    facts: list[tuple[str, Cell]] = [
        ("Verdict", document["phrase"]),
        (f"p-value of the whole procedure, from {mismatch.draws} synthetic campaigns", f"≤ {mismatch.p_value:.2g}"),
        (
            "Test",
            f"{mismatch.tested} kinds of dependence tested, corrected for multiple testing; "
            f"{mismatch.false_alarm_rate:.0%} of campaigns without a difference raise an alarm",
        ),
        *((f"Noise, {side}", f"{noise[side] / MILLI:.2f} mN m, {noise['source']}") for side in SIDES),
        (
            "Scatter of the rows about all that was looked for",
            f"{diagnosis.evidence.scatter:.3g} times the noise of the sensors",
        ),
    ]
    if (held := document["held_out"]) is not None:
        low, high = (end / MILLI for end in held["gain_interval_Nm"])
        facts += [
            (
                "Error on runs not used for the fit",
                f"{held['rmse_before_Nm'] / MILLI:.2f} mN m before, {held['rmse_after_Nm'] / MILLI:.2f} after; "
                f"noise {held['noise_floor_Nm'] / MILLI:.2f}; gain {low:.2f} to {high:.2f} (95 %)",
            ),
            ("Withheld", held["split"]),
        ]
    items: list[Text | Facts | Table | Figure] = [Text(document["statement"]), Facts(tuple(facts))]
    tables = (_mechanisms(document), _locations(document), _rivals(document), _next_tests(document))
    items += [table for table in tables if table.rows]
    return Section("diagnosis", "Diagnosis", tuple(items), (sources.WESTFALL_YOUNG,))


def _words(text: str | None) -> str:
    return "cannot tell" if text is None else text.replace("_", " ")


def _mechanisms(document: dict[str, Any]) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            _words(found["id"]),
            _words(found["component"]),
            found["shaft"],
            found["probability"],
            _words(p["name"]),
            Measured(p["value"], float("nan") if p["standard_error"] is None else p["standard_error"]),
            "" if p["unit"] == "1" else p["unit"],
            found["rms_effect_Nm"] / MILLI,
            found["peak_effect_Nm"] / MILLI,
        )
        for found in document["mechanisms"]
        for p in found["parameters"]
    ]
    named = document["verdict"] == "named"
    return Table(
        "mechanisms",
        "Cause" if named else "Possible causes",
        "Baseline and mechanism fitted together; the effect is that over the rows on which it acts.",
        (
            Column("mechanism", "Mechanism"),
            Column("component", "Component"),
            Column("shaft", "Shaft"),
            Column("probability", "Weight", digits=2),
            Column("parameter", "Parameter"),
            Column("value", "Value", uncertain=named),
            Column("unit", "Unit"),
            Column("rms", "Effect, rms", "mN m", digits=2),
            Column("peak", "Effect, peak", "mN m", digits=1),
        ),
        tuple(rows),
    )


def _locations(document: dict[str, Any]) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            place["signal"].replace("torque_", "") + " torque",
            place["configuration"],
            _words(place["component"]),
            ", ".join(place["depends_on"]),
            place["size_Nm"] / MILLI,
            place["p_value"],
        )
        for place in document["locations"]
    ]
    return Table(
        "locations",
        "Where it sits",
        "Places, clearest first. Sizes are the part that the fitted constants do not absorb. In rows named data sheet "
        "a fitted constant is far from it; their size is the torque of that distance, or the fall of a loss curve.",
        (
            Column("signal", "Signal"),
            Column("configuration", "Configuration"),
            Column("component", "Component"),
            Column("depends_on", "Follows"),
            Column("size", "rms size", "mN m", digits=2),
            Column("p_value", "p-value ≤", format=".2g"),
        ),
        tuple(rows),
    )


def _rivals(document: dict[str, Any]) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (", ".join(map(_words, rival["ids"])), ", ".join(rival["shafts"]), rival["why"], rival["separating_test"])
        for rival in document["rivals"]
    ]
    return Table(
        "rivals",
        "Causes that are not excluded",
        "Each row is a set that these runs cannot tell apart, and the run that would.",
        (
            Column("mechanisms", "Mechanisms"),
            Column("shafts", "Shafts"),
            Column("why", "Why"),
            Column("test", "Run that would tell"),
        ),
        tuple(rows),
    )


def _next_tests(document: dict[str, Any]) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            test["description"],
            test["minutes"],
            None if test["power"] is None else 100.0 * test["power"],
            ", ".join(map(_words, test["separates"])),
        )
        for test in document["next_tests"]
    ]
    return Table(
        "next-tests",
        "Next runs",
        "What this campaign lacks, with the references of the drives. Power is the probability that the runs tell: "
        "that the true cause is named alone; of what the campaign cannot see, that it shows at a size worth knowing.",
        (
            Column("run", "Run"),
            Column("minutes", "Time", "min", digits=1),
            Column("power", "Power", "%", digits=0),
            Column("separates", "Tells apart"),
        ),
        tuple(rows),
    )
