"""Chapter on the published run in time: speeds, powers and the time of engagement under each choice left open."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.report.document import Column, Section, Table, Text
from pmg.pipeline.thesis_figures.transient import PRINTED_RUN, TransientResult
from pmg.sim import sources
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.report.table import Cell


def transient_section(results: tuple[TransientResult, ...]) -> Section:
    """The table of the run under every combination of the choices."""
    rows: list[tuple[Cell, ...]] = [
        (
            str(r.losses),
            str(r.rotors),
            "turns with the shaft" if r.signed else "as the block diagrams draw it",
            float(SPEED_SUN.display(r.speed_sun)),
            float(SPEED_SUN.display(r.shift)),
            float(SPEED_RING.display(r.speed_ring)),
            r.power_in,
            r.power_out,
            float(SPEED_SUN.display(r.lowest)),
            r.engaged_from,
        )
        for r in results
    ]
    most = max(r.voltage for r in results)
    text = (
        f"The thesis prints one run ({PRINTED_RUN}) and leaves three choices open. Losses: the rounded tables, or "
        "those that the 48 printed torques need. The motors' rotors: hidden by the torque loop, or counted in a shaft. "
        "Friction: it opposes motion, or it acts as the block diagrams draw it, in one direction whichever way a shaft "
        "turns, so that the sun first turns back. 'Engaged from' is the time from which both shafts keep their "
        f"directions. The largest voltage of a motor is {most:.0f} V."
    )
    table = Table(
        "published-run-options",
        "The published run under each choice",
        f"{len(rows)} combinations. The shift is what rounding moves the sun's speed by, 95 %; of the other columns no "
        "uncertainty is computed.",
        (
            Column("losses", "Losses"),
            Column("rotors", "Motors' rotors"),
            Column("friction", "Friction"),
            Column("sun", "Sun after 20 s", "rpm", digits=1),
            Column("shift", "± by rounding", "rpm", digits=1),
            Column("ring", "Ring after 20 s", "rpm", digits=1),
            Column("power_in", "Into the gear", "W", digits=2),
            Column("power_out", "Out of the gear", "W", digits=2),
            Column("lowest", "Lowest sun speed", "rpm", digits=1),
            Column("engaged", "Engaged from", "s", digits=3),
        ),
        tuple(rows),
    )
    return Section("published-run", "The published run", (Text(text), table), (sources.THESIS.at("section 6.3"),))
