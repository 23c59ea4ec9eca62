"""The columns of the catalogue: name, unit and meaning of each, and where it stands in the words of ASAM ODS."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Kind(StrEnum):
    """Kind of content of a column, and so how it is compared."""

    TEXT = "text"
    NUMBER = "number"
    FLAG = "yes or no"
    TIME = "time"


@dataclass(frozen=True)
class Column:
    """A column of the view ``runs``.

    Parameters
    ----------
    name : str
        What the user writes; its unit is part of it where it is not one of a kind.
    kind : Kind
        What it holds.
    unit : str
        Unit, empty where there is none.
    meaning : str
        One phrase.
    source : str
        Where it stands: table and field of the catalogue.
    """

    name: str
    kind: Kind
    unit: str
    meaning: str
    source: str


_T, _N, _F = Kind.TEXT, Kind.NUMBER, Kind.FLAG

COLUMNS: tuple[Column, ...] = (
    Column("campaign", _T, "", "campaign of the run", "Test.name"),
    Column("name", _T, "", "name of the recording in the store", "Measurement.name"),
    Column("file", _T, "", "file it was ingested from", "Measurement.file"),
    Column("status", _T, "", "ingested, failed, or table: a grid read from tables", "Measurement.status"),
    Column("point", _T, "", "test point of the window or run", "SubMatrix.name"),
    Column("configuration", _T, "", "neutral, engaged or zero", "SubMatrix.configuration"),
    Column("gear", _N, "", "gear of the bench", "SubMatrix.gear"),
    Column("drive", _T, "", "shaft that drives", "SubMatrix.drive"),
    Column("manoeuvre", _T, "", "what a run in motion does: ramp, steps, sweep ...", "Measurement.manoeuvre"),
    Column("start", Kind.TIME, "UTC", "start of the window or run", "SubMatrix.measurement_begin"),
    Column("seconds", _N, "s", "length of the window or run", "SubMatrix.seconds"),
    Column("sun_set_rpm", _N, "rpm", "set sun speed", "SubMatrix.sun_set"),
    Column("ring_set_rpm", _N, "rpm", "set ring speed", "SubMatrix.ring_set"),
    Column("load", _N, "N m", "set ring torque; 0 unless engaged", "SubMatrix.load"),
    Column("sun_rpm", _N, "rpm", "mean sun speed", "speed_sun.average"),
    Column("ring_rpm", _N, "rpm", "mean ring speed", "speed_ring.average"),
    Column("torque_sun_Nm", _N, "N m", "mean sun torque", "torque_sun.average"),
    Column("torque_ring_Nm", _N, "N m", "mean ring torque", "torque_ring.average"),
    Column("u_torque_sun_Nm", _N, "N m", "its standard uncertainty, point by point", "torque_sun.u"),
    Column("u_torque_ring_Nm", _N, "N m", "its standard uncertainty, point by point", "torque_ring.u"),
    Column("common_sun_Nm", _N, "N m", "standard uncertainty that all points share", "torque_sun.u_common"),
    Column("common_ring_Nm", _N, "N m", "standard uncertainty that all points share", "torque_ring.u_common"),
    Column("std_sun_Nm", _N, "N m", "scatter of the sun torque's samples", "torque_sun.standard_deviation"),
    Column("std_ring_Nm", _N, "N m", "scatter of the ring torque's samples", "torque_ring.standard_deviation"),
    Column("accepted", _F, "", "whether the window or run met every check", "SubMatrix.accepted"),
    Column("reasons", _T, "", "why not", "SubMatrix.reasons"),
    Column("analysed", _F, "", "whether it is in the grid of the analysis", "SubMatrix.analysed"),
    Column("rest_sun", _F, "", "whether the sun stands still", "SubMatrix.rest_sun"),
    Column("rest_ring", _F, "", "whether the ring stands still", "SubMatrix.rest_ring"),
    Column("findings", _N, "", "findings of the recording", "Measurement.findings"),
    Column("errors", _N, "", "errors among them", "Measurement.errors"),
    Column("simulated", _F, "", "whether its writer marked it as simulated", "Measurement.simulated"),
    Column("rate_hz", _N, "Hz", "samples per second", "Measurement.rate_hz"),
    Column("samples", _N, "", "samples kept", "Measurement.samples"),
    Column("size", _N, "byte", "length of the file", "Measurement.size"),
    Column("sha256", _T, "", "hash of the file", "Measurement.sha256"),
    Column("origin", _T, "", "file that it was imported from", "Measurement.origin"),
    Column("note", _T, "", "note of the run", "Measurement.note"),
)

BY_NAME = {column.name: column for column in COLUMNS}

OTHER_NAMES = {
    "speed_sun_rpm": "sun_rpm",
    "speed_ring_rpm": "ring_rpm",
    "load_Nm": "load",
    "load_set_Nm": "load",
    "u_sun_Nm": "u_torque_sun_Nm",
    "u_ring_Nm": "u_torque_ring_Nm",
    "started_at": "start",
}
"""Names that other tables of pmg give to the same."""

SHOWN = (
    "point",
    "configuration",
    "drive",
    "manoeuvre",
    "sun_rpm",
    "ring_rpm",
    "load",
    "torque_sun_Nm",
    "torque_ring_Nm",
    "accepted",
    "findings",
    "file",
)
"""Columns of a listing where none are asked for."""
