"""Derived signals of a recording as an MCAP file: sample blocks, and a preview that general viewers plot."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.importers.block_file import BlockFile, block_file
from pmg.pipeline.importers.derived import DERIVED, FLAGS, Derived, derive
from pmg.pipeline.recording.channels import SHARED_CLOCK
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.windows.limits import LIMITS
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.recording.findings import Finding
    from pmg.pipeline.recording.read import Recording
    from pmg.pipeline.windows.limits import Steadiness

PREVIEW_HZ = 50.0
"""Rate of the preview [Hz]."""
PREVIEW_TOPIC, PREVIEW_NAME = "/pmg/preview", "pmg.Preview"
PREFIX = "/pmg/derived/"
"""Topics of the derived signals begin so; the display name of the signal follows."""
FLAGS_TOPIC = f"{PREFIX}flags"
RECORD = "pmg.derived"
"""Metadata record of where an exported file comes from."""


@dataclass(frozen=True)
class Exported:
    """Result of an export.

    Parameters
    ----------
    source, out : Path
        The recording, and the file written.
    rate_hz, preview_hz : float
        Rates of the derived signals and of the preview [Hz].
    samples, previews : int
        Stretches and preview messages written.
    findings : tuple of Finding
        Of the recording.
    """

    source: Path
    out: Path
    rate_hz: float
    preview_hz: float
    samples: int
    previews: int
    findings: tuple[Finding, ...]


def export_recording(path: Path, out: Path, rate_hz: float | None = None, limits: Steadiness = LIMITS) -> Exported:
    """Write the derived signals of a recording, and a preview of them at 50 Hz.

    Parameters
    ----------
    path : Path
        A recording of layout pmg.v1.
    out : Path
        The file; an older one is replaced when the new one is whole.
    rate_hz : float, optional
        Rate of the derived signals [Hz]; that of the samples by default.
    limits : Steadiness
        By which windows are found and judged.

    Raises
    ------
    RecordingError
        When the recording cannot be used, or `out` is the recording itself.

    Notes
    -----
    The preview is JSON with a schema, a message each 20 ms: MCAP viewers plot numeric fields of JSON messages by
    name without a plug-in, a person can read them, and at 50 Hz their size does not matter. A value that is not
    known is left out of its message. The derived signals are sample blocks as in pmg.v1: compact at any rate, but
    viewers list them without plotting them over time. Times are those of the middle of a stretch for the preview,
    and of its begin for blocks.
    """
    if out.exists() and out.samefile(path):
        raise RecordingError(str(out), "the recording itself", "another file for --out", "Name another file.")
    recording = read_recording(path)
    signals = derive(recording, rate_hz, limits)
    preview = derive(recording, min(PREVIEW_HZ, recording.rate_hz), limits)
    begin = recording.time_of(0)
    with block_file(out, begin, signals.rate_hz) as file:
        file.writer.add_metadata(RECORD, _origin(recording, signals, preview, limits))
        _announce(file, signals)
        schema = json.dumps(_preview_schema(), ensure_ascii=False).encode()
        topic = file.add_json_topic(PREVIEW_TOPIC, PREVIEW_NAME, schema, {"rate_hz": repr(preview.rate_hz)})
        chunk = max(1, round(signals.rate_hz))
        shown = 0
        for low in range(0, len(signals.flags), chunk):
            high = min(low + chunk, len(signals.flags))
            until = (signals.first + high) / signals.rate_hz
            _write_blocks(file, signals, low, high)
            shown = _write_previews(file, topic, preview, shown, until)
        _write_previews(file, topic, preview, shown, math.inf)
    return Exported(
        path, out, signals.rate_hz, preview.rate_hz, len(signals.flags), len(preview.flags), recording.findings
    )


def _preview_schema() -> dict[str, Any]:
    """JSON schema of a preview message."""
    values = {s.display_name: {"type": "number", "description": s.label} for s in DERIVED}
    flags = {name: {"type": "integer", "minimum": 0, "maximum": 1, "description": FLAGS[name]} for name in FLAGS}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": PREVIEW_NAME,
        "type": "object",
        "properties": {
            "time_s": {"type": "number", "description": "time since sample 0 [s]"},
            "point": {"type": "string", "description": "test point of the window; empty outside of one"},
            **values,
            **flags,
        },
        "required": ["time_s", "point", *flags],
        "additionalProperties": False,
    }


def _announce(file: BlockFile, signals: Derived) -> None:
    common = {"rate_hz": repr(signals.rate_hz), "clock_id": str(SHARED_CLOCK)}
    for signal in DERIVED:
        words = {"quantity": signal.name, "unit": signal.display_unit, "dtype": "f64", "meaning": signal.meaning}
        if signal.display_unit == "rpm":
            words["span_s"] = repr(signals.span_s)
        file.add_topic(f"{PREFIX}{signal.display_name}", common | words)
    bits = {f"bit_{bit}": f"{name}: {meaning}" for bit, (name, meaning) in enumerate(FLAGS.items())}
    file.add_topic(FLAGS_TOPIC, common | {"quantity": "mask", "unit": "1", "dtype": "u32"} | bits)


def _write_blocks(file: BlockFile, signals: Derived, low: int, high: int) -> None:
    """A second of derived signals; where a value is not known, a gap."""
    index = np.arange(signals.first + low, signals.first + high)
    columns: dict[str, tuple[Any, Any]] = {FLAGS_TOPIC: (index, signals.flags[low:high])}
    for signal in DERIVED:
        shown = signal.display(signals.values[signal][low:high])
        known = np.isfinite(shown)
        columns[f"{PREFIX}{signal.display_name}"] = index[known], shown[known]
    file.write(columns)


def _write_previews(file: BlockFile, topic: int, preview: Derived, shown: int, until: float) -> int:
    """The previews up to a time after sample 0 [s]; how many have been written."""
    while shown < len(preview.flags):
        time = (preview.first + shown + 0.5) / preview.rate_hz
        if time > until:
            break
        number = preview.first + shown
        message: dict[str, Any] = {"time_s": round(time, 9)}
        message["point"] = next((name for name, low, high in preview.points if low <= number < high), "")
        for signal in DERIVED:
            value = float(signal.display(preview.values[signal][shown]))
            if math.isfinite(value):
                message[signal.display_name] = value + 0.0  # no minus before a zero
        flags = int(preview.flags[shown])
        message |= {name: flags >> bit & 1 for bit, name in enumerate(FLAGS)}
        file.write_json(topic, file.time_ns(time * file.rate_hz), json.dumps(message, ensure_ascii=False).encode())
        shown += 1
    return shown


def _origin(recording: Recording, signals: Derived, preview: Derived, limits: Steadiness) -> dict[str, str]:
    """Where the signals come from."""
    return {
        "source": recording.file,
        "source_sha256": recording.sha256,
        "source_bytes": str(recording.size),
        "source_rate_hz": repr(recording.rate_hz),
        "campaign": recording.run.campaign,
        "point": recording.run.point or "",
        "rate_hz": repr(signals.rate_hz),
        "preview_hz": repr(preview.rate_hz),
        "speed_span_s": repr(signals.span_s),
        "limits": json.dumps(limits.document()),
        "findings": json.dumps([finding.to_dict() for finding in recording.findings], ensure_ascii=False),
        "written_by": f"pmg {version('pmg-bench')}",
    }
