"""A report with everything a report can hold; deterministic, and about nothing in particular."""

from __future__ import annotations

import numpy as np

from pmg.pipeline.report.document import (
    Chart,
    Column,
    Facts,
    Figure,
    Headline,
    Measured,
    PowerFlow,
    Report,
    Section,
    Series,
    SpeedMap,
    Table,
    Text,
)
from pmg.pipeline.report.draw import draw_all
from pmg.sim import sources


def draw_svg(figure: Figure) -> str:
    """The SVG element of a figure, as a page takes it."""
    return draw_all((figure,)).inline[figure.id]


def chart() -> Chart:
    load = np.array([1.0, 2, 4, 6, 8, 10, 12, 14])
    series: list[Series] = []
    for colour, speed in enumerate((200, 500, 1000, 1500)):
        efficiency = 100 * load / (load + 0.4 + 0.25 * colour)
        series.append(Series(f"{speed} rpm", load, efficiency + 0.3, 0.5 + 2 / load, "markers", colour, "measured"))
        series.append(Series(f"{speed} rpm", load, efficiency, None, "line", colour, "simulated"))
    return Chart("ring torque [N m]", "total efficiency [%]", tuple(series), (("rated", 92.0),))


def speed_map() -> SpeedMap:
    x = np.array([50.0, 100, 150, 200, 300, 400, 500, 600, 700, 800, 900, 1000, 1100, 1200, 1350, 1500])
    y = np.array([25.0, 50, 100, 150, 200, 250, 300, 350, 400, 450, 500, 550, 600])
    z = np.sin(x / 500) * y[:, np.newaxis] / 200 - 0.4
    z[0, :3] = np.nan
    z[9, 14:] = np.nan
    return SpeedMap(
        x, y, z, "sun speed [rpm]", "ring speed [rpm]", "difference [W]", np.abs(z) < 0.25, "within U", True, True
    )


def power_flow() -> PowerFlow:
    return PowerFlow(
        "Gear 1, 1000 rpm, 10 N m",
        (
            ("Electric supply", 198.7),
            ("Sun shaft", 190.87),
            ("Gearbox", 170.62),
            ("Rotors", 160.49),
            ("Ring shaft", 144.93),
            ("Useful power", 134.58),
        ),
        (
            ("Sun motor", 7.83, 0),
            ("Sun bearings", 20.25, 1),
            ("Magnetic gear", 10.13, 2),
            ("Ring bearings", 15.56, 3),
            ("Ring motor", 10.35, 4),
        ),
    )


def long_table(rows: int = 120) -> Table:
    columns = (
        Column("point", "Test point"),
        Column("loss_total", "Total loss", "W", digits=2, uncertain=True),
        Column("remark", "Remark of the bench operator"),
    )
    cells = tuple(
        (
            f"g1-{index:03d}",
            Measured(20 + index * 1.2345, 0.3) if index % 7 else 20 + index,
            "window shortened at its end",
        )
        for index in range(rows)
    )
    return Table("points", "All points", "Loss grows from point to point.", columns, cells)


def report() -> Report:
    both_ways = PowerFlow(
        "Both sides drive", (("Sun", 12.0), ("Rotors", 2.0), ("Ring", -7.0)), (("Bearings", 9.0, 0), ("Zero", -1.5, 1))
    )
    found = Section(
        "findings",
        "What was found",
        (
            Text("One paragraph.\n\nAnother one.", "finding"),
            Text("Something to keep in mind.", "warning"),
            Facts((("Points measured", 48), ("File", "raw/" + "a_rather_long_name_" * 6 + ".mcap"))),
            Figure("efficiency", "Efficiency", "Efficiency rises with load.", (chart(),)),
            Figure("flow", "Power flow", "A third of the supply is lost.", (power_flow(), both_ways)),
        ),
        (sources.THESIS, sources.GUM),
    )
    difference = Section(
        "difference",
        "Difference to the simulation",
        (
            Figure("map", "Map", "The difference grows with speed.", (speed_map(), speed_map()), columns=2),
            long_table(),
        ),
        (sources.GUM, sources.GUM.at("section 6.2")),
    )
    return Report(
        "Losses of a gearbox",
        "Campaign of spring",
        Headline("A drag that grows with speed is missing.", "attention"),
        (found, difference),
        Facts((("Recording", "raw/run_01.mcap"),)),
    )
