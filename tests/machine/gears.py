"""A magnetic gear that is not the thesis's, as a machine file."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

OTHER = """
schema = "pmg.machine/1"
title = "Gear of 4 and 11 pole pairs"
source = "data sheet"

[gear]
kind = "magnetic"
input = "sun"
output = "ring"
pole_pairs_input = { value = 4, unit = "1" }
pole_pairs_output = { value = 11, unit = "1" }
iron_poles = 15
pull_out_torque_output = { value = 22, unit = "N m", u = 1.1 }

[shaft.sun]
inertia = { value = 6, unit = "kg cm2" }

[shaft.sun.transducer]
nominal = { value = 10, unit = "N m" }
tolerance = { value = 0.1, unit = "%" }

[shaft.sun.motor]
resistance = { value = 2.5, unit = "ohm" }

[shaft.ring]

[shaft.ring.transducer]
nominal = { value = 20, unit = "N m" }
"""
"""Pole pairs, iron poles, one pull-out torque, transducers."""


def gear_file(folder: Path, *changes: tuple[str, str]) -> Path:
    """The machine file in a folder, with parts of it exchanged."""
    text = OTHER
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "gear.toml"
    path.write_text(text, encoding="utf-8")
    return path
