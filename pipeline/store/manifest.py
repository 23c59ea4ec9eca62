"""The manifest of a source: a typed record, and the one place that turns its JSON into it and back."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any

from pmg.pipeline.files.json_values import PROOF, with_nulls
from pmg.pipeline.recording.calibration import Calibration, Transducer
from pmg.pipeline.recording.findings import Finding
from pmg.pipeline.recording.means import BATCH_METHOD, PointMeans, ShaftMeans
from pmg.pipeline.recording.origin import ImportRecord
from pmg.pipeline.recording.run_records import RunRecord, Setpoints, WindowRecord
from pmg.pipeline.recording.supplied import SuppliedRecord
from pmg.pipeline.store.moving_record import MovingRecord, moving_record_of
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping

SCHEMA = "pmg.store/1"
INGESTED, FAILED = "ingested", "failed"
"""Status of a source: its runs are in the store, or it is not usable."""
RUN = ("campaign", "point", "configuration", "gear", "drive", "started_at", "note")
KNOWN_RUN = ("campaign", "point", "note", "configuration", "gear", "drive", "started_at")
"""Entries of the run of a usable source, and of one that is not, in the order of the file."""
MEANS = ("n", "duration", "sun", "ring")


_NO_TRANSDUCER = Transducer(math.nan, math.nan, math.nan, "")
NOT_CALIBRATED = Calibration(_NO_TRANSDUCER, _NO_TRANSDUCER, 0, 0)
NOT_RUN = RunRecord()


@dataclass(frozen=True)
class StoredWindow(WindowRecord):
    """A judged window and its means.

    Parameters
    ----------
    started_at_s : float
        Time of the first sample since 1970 [s].
    means : PointMeans
        Of both shafts; a number that is not known is NaN.
    """

    started_at_s: float
    means: PointMeans


@dataclass(frozen=True)
class Manifest:
    """Record of one source file in the store.

    Parameters
    ----------
    identifier : str
        Stem of the file and the first eight digits of its hash.
    file, place, sha256 : str
        Name, hash of where it lies, hash of its content.
    status : str
        `INGESTED` or `FAILED`.
    run : RunRecord
        Its run.
    findings : tuple of Finding
        What reading it brought up.
    windows : tuple of StoredWindow
        In the order in which they were found; none of a failed source, and of one in motion.
    calibration : Calibration
        NaN where it is not known.
    rate_hz : float
        Sample rate [Hz].
    first_sample : int
        Number of the first sample.
    samples, size : int or None
        Samples, and bytes of the file.
    origin : ImportRecord or None
        What it was imported from.
    supplied : SuppliedRecord or None
        What it lacked and was stated next to it.
    offered : mapping or None
        Names and hashes of a map of which it took nothing.
    lacking : mapping of str to str
        Channels that it does not hold, and why.
    reduction : int or None
        By which way its means were taken; the first one where a usable source does not say.
    limits : mapping or None
        By which its windows were judged; the defaults where it does not say.
    files : mapping of str to str
        SHA-256 of its files in the store as they were written, by folder and ending (``runs.parquet``).
    proven : bool
        Whether it was read from a file that holds the hash of itself.
    moving : tuple of MovingRecord
        Its runs in motion, in the order of their samples.
    temperatures : mapping of str to tuple of float
        Lowest and highest of each place [degC].
    """

    identifier: str
    file: str = ""
    place: str = ""
    sha256: str = ""
    status: str = INGESTED
    run: RunRecord = NOT_RUN
    findings: tuple[Finding, ...] = ()
    windows: tuple[StoredWindow, ...] = ()
    calibration: Calibration = NOT_CALIBRATED
    rate_hz: float = math.nan
    first_sample: int = 0
    samples: int | None = None
    size: int | None = None
    origin: ImportRecord | None = None
    supplied: SuppliedRecord | None = None
    offered: Mapping[str, str] | None = None
    lacking: Mapping[str, str] = field(default_factory=dict)
    reduction: int | None = None
    limits: Mapping[str, float] | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    proven: bool = False
    moving: tuple[MovingRecord, ...] = ()
    temperatures: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def ingested(self) -> bool:
        """Whether its runs are in the store."""
        return self.status == INGESTED

    @property
    def campaign(self) -> str:
        """Campaign of an ingested source; empty where it is not known."""
        return self.run.campaign or ""

    @property
    def started_at(self) -> str:
        """Start of the run of an ingested source, ISO 8601; empty where it is not known."""
        return self.run.started_at or ""

    def document(self) -> dict[str, Any]:
        """The manifest as it stands in its file, without what is not known."""
        plain: dict[str, Any] = {"schema": SCHEMA, "file": self.file, "place": self.place, "sha256": self.sha256}
        findings = [finding.to_dict() for finding in self.findings]
        if not self.ingested:
            run = {key: value for key in KNOWN_RUN if (value := getattr(self.run, key)) is not None}
            asked = {key: value for key, value in asdict(self.run.setpoints).items() if value is not None}
            run |= {"setpoints": asked} if asked else {}
            plain |= {"run": run} if run else {}
            return plain | {"status": self.status, "findings": findings, "windows": []}
        plain |= {"size": self.size} if self.size is not None else {}
        plain |= {} if self.origin is None else {"origin": asdict(self.origin)}
        if self.supplied is not None:
            plain["supplied"] = dict(self.supplied.hashes) | {"parts": list(self.supplied.parts)}
        plain |= {"lacking": dict(self.lacking)} if self.lacking else {}
        plain |= with_nulls(
            {
                "status": self.status,
                "run": {key: getattr(self.run, key) for key in RUN}
                | ({} if self.run.manoeuvre is None else {"manoeuvre": self.run.manoeuvre}),
                "calibration": asdict(self.calibration),
                "rate_hz": self.rate_hz,
                "first_sample": self.first_sample,
                "samples": self.samples,
                "findings": findings,
            }
        )
        later = {"offered": self.offered, "reduction": self.reduction, "limits": self.limits}
        plain |= {key: value for key, value in later.items() if value is not None}
        plain |= {"files": dict(self.files)} if self.files else {}
        plain |= {"moving": [record.document() for record in self.moving]} if self.moving else {}
        plain |= {"temperatures": {k: list(ends) for k, ends in self.temperatures.items()}} if self.temperatures else {}
        return plain | {"windows": [_window_document(window) for window in self.windows]}


def manifest_of(identifier: str, document: Mapping[str, Any]) -> Manifest:
    """The manifest that a file holds; what an earlier version did not write yet is not known.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError
        It is damaged.
    """
    origin, supplied = document.get("origin"), document.get("supplied")
    calibration, run = document.get("calibration", {}), document.get("run", {})
    return Manifest(
        identifier,
        file=_text(document["file"]),
        place=_text(document.get("place", "")),
        sha256=_text(document["sha256"]),
        status=_text(document["status"]),
        run=RunRecord(
            **{key: run.get(key) for key in (*RUN, "manoeuvre")}, setpoints=_setpoints(run.get("setpoints", {}))
        ),
        findings=tuple(Finding.from_dict(plain) for plain in document["findings"]),
        windows=tuple(_window(plain) for plain in document["windows"]),
        calibration=Calibration(
            _transducer(calibration.get("sun", {})),
            _transducer(calibration.get("ring", {})),
            calibration.get("counts_per_rev_sun", 0),
            calibration.get("counts_per_rev_ring", 0),
        ),
        rate_hz=_number(document.get("rate_hz")),
        first_sample=document.get("first_sample", 0),
        samples=document.get("samples"),
        size=document.get("size"),
        origin=None if origin is None else ImportRecord(**_known(ImportRecord, origin)),
        supplied=None if supplied is None else _supplied(supplied),
        offered=document.get("offered"),
        lacking=document.get("lacking", {}),
        reduction=document.get("reduction"),
        limits=document.get("limits"),
        files=dict(document.get("files", {})),
        proven=PROOF in document,
        moving=tuple(map(moving_record_of, document.get("moving", ()))),
        temperatures={
            place: (_number(low), _number(high)) for place, (low, high) in document.get("temperatures", {}).items()
        },
    )


def _window(plain: Mapping[str, Any]) -> StoredWindow:
    means = plain["means"]
    return StoredWindow(
        point=_text(plain["point"]),
        configuration=Configuration(plain["configuration"]),
        gear=plain["gear"],
        drive=_text(plain["drive"]),
        started_at_s=_number(plain["started_at_s"]),
        first_sample=plain["first_sample"],
        stop_sample=plain["stop_sample"],
        setpoints=_setpoints(plain["setpoints"]),
        accepted=bool(plain["accepted"]),
        reasons=tuple(map(str, plain["reasons"])),
        rest_sun=bool(plain["rest_sun"]),
        rest_ring=bool(plain["rest_ring"]),
        means=PointMeans(_shaft(means["sun"]), _shaft(means["ring"]), means["n"], _number(means["duration"])),
    )


def _window_document(window: StoredWindow) -> dict[str, Any]:
    document = asdict(window)
    document = {
        key: document.pop(key) for key in ("point", "configuration", "gear", "drive", "started_at_s")
    } | document
    means = {key: document["means"][key] for key in MEANS}
    for side in SIDES:
        if math.isnan(means[side]["spikes"]):  # not known of a window that was reduced in an earlier way
            del means[side]["spikes"]
    return document | {"reasons": list(window.reasons), "means": with_nulls(means)}


def _shaft(plain: Mapping[str, Any]) -> ShaftMeans:
    """Means of a shaft; one of the words and flags among them that an earlier version did not write has its default."""
    return ShaftMeans(
        torque=_number(plain["torque"]),
        within=_number(plain["within"]),
        dof=_number(plain.get("dof")),
        revolutions_per_batch=plain.get("revolutions_per_batch", 0),
        std=_number(plain.get("std")),
        std_filtered=_number(plain.get("std_filtered")),
        correlation_time=_number(plain.get("correlation_time")),
        speed=_number(plain["speed"]),
        method=plain.get("method", BATCH_METHOD),
        correlated=bool(plain.get("correlated")),
        resolution=_number(plain.get("resolution")),
        spikes=_number(plain.get("spikes")),
    )


def _transducer(plain: Mapping[str, Any]) -> Transducer:
    zero, nominal, span = (_number(plain.get(name)) for name in ("null_frequency_hz", "nominal_torque", "span_hz"))
    return Transducer(zero, nominal, span, plain.get("serial") or "")


def _setpoints(plain: Mapping[str, Any]) -> Setpoints:
    return Setpoints(**_known(Setpoints, plain))


def _supplied(plain: Mapping[str, Any]) -> SuppliedRecord:
    return SuppliedRecord({key: text for key, text in plain.items() if key != "parts"}, tuple(plain.get("parts", ())))


def _known(record: type[Any], plain: Mapping[str, Any]) -> dict[str, Any]:
    """The entries that a record has a field for."""
    return {each.name: plain[each.name] for each in fields(record) if each.name in plain}


def _number(value: object) -> float:
    """A number; NaN where it is not known."""
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return value


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value
