"""Mutations of the texts that pmg reads, byte by byte and line by line, and what becomes of each."""

from __future__ import annotations

import signal
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType

import numpy as np

from pmg.pipeline.importers.channel_map import read_map
from pmg.pipeline.importers.import_recording import import_recording
from pmg.pipeline.importers.supply import read_supply
from pmg.pipeline.recording.calibration import read_calibration
from pmg.pipeline.recording.findings import Findings, UnusableRecordingError
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.simulate.inputs import gather_inputs
from pmg.pipeline.simulate.scenario_file import read_scenario
from pmg.pipeline.simulate.simulation import simulate
from pmg.pipeline.windows.limits_file import limits_file
from pmg.pipeline.windows.windows import find_windows
from pmg.sim.bench import load_bench
from pmg.sim.errors import PmgError

from ..house import ROOT
from ..importers.written import TOPICS, channel, map_text
from .mutations import ENGAGED, KINDS, Held, Specimen, mutate
from .writer import CALIBRATION

PATIENCE = 20.0
"""Processor time after which a text counts as hanging [s]."""
VALUES = (
    *(
        "0",
        "-1",
        "1e308",
        "-1e-308",
        "1e400",
        "nan",
        "-inf",
        "7" * 30,
        "1" + "0" * 400,
        "0x7f",
        "true",
        "[]",
        "{}",
        '""',
    ),
    *('"1 rpm"', "'x\ty'", '"\\u202e"', "[" * 60 + "]" * 60, "{ a = { b = 1 } }", "1979-05-27T07:32:00Z", "07:32:00"),
    *('"../../x"', "'" + "y" * 5000 + "'", "[[1, 2], [3]]", '[{ a = 1 }, "b"]', "_", '"', "5.0.0", "1_0", '""'),
)
"""Values that take the place of another one."""

LIMITS = """[windows]
shortest = "1 s"
completeness = "90 %"
speed_change = "0.5 rpm"
speed_change_relative = "0.2 %"
parts = 10
counts = 2
speed_offset = "2 rpm"
torque_drift = "1 %"
torque_drift_sigmas = 8
frequency_low = "5000 Hz"
frequency_high = "15000 Hz"
step_speed = "5 rpm"
settle = "1 s"
"""
MAP = map_text(
    channel(TOPICS["torque_sun"], "T", unit="mN m", sign=-1)
    + channel(TOPICS["angle_sun"], "A", unit="deg", wraps_at=360.0),
    extra='[csv]\ndecimal = "."\ndelimiter = ";"\n',
)
SUPPLY = map_text(channel(TOPICS["angle_sun"], "/vendor/frame", field="encoder_sun.reading", bits=16))
SCENARIO = """title = "A grid"
[bench]
configuration = "engaged"
gear = 1
control_sun = "speed"
[losses]
grids = "../published"
terms_sun = "0,1,2"
terms_ring = "0,1"
K_corr = 0.8
b = 0.0
c = 2.22e-4
d = 0.0
[grid]
speed_sun_rpm = [156, 936]
load_Nm = [0.78, 1.95]
[mechanism.load_dependent_bearing_friction]
mu_sun = 0.008
mu_ring = 0.008
[output]
campaign = "simulated"
"""


class TextOutcome(StrEnum):
    """What becomes of a mutated text; the last two must never happen."""

    RESULT = "a result"
    REFUSED = "refused with a sentence"
    CRASHED = "another exception"
    HUNG = "no end"


@dataclass(frozen=True)
class TextSpecimen:
    """A text of one kind, and what reads it from a folder and works with it."""

    name: str
    text: str
    use: Callable[[Path, bytes], object]


def _calibration(_: Path, data: bytes) -> None:
    findings = Findings("a.mcap")
    calibration = read_calibration([("calibration.toml", data)], findings)
    if calibration is None:
        raise UnusableRecordingError(findings.listed())
    calibration.sun.torque(np.linspace(0.0, 2e4, 100))


def _file(folder: Path, data: bytes) -> Path:
    path = folder / "file.toml"
    path.write_bytes(data)
    (folder / "calibration.toml").write_text(CALIBRATION)
    (folder / "log.csv").write_text("T;A\n" + "".join(f"{0.1 + k % 2};{k % 360}\n" for k in range(500)))
    return path


def _limits(folder: Path, data: bytes) -> None:
    find_windows(read_recording(ENGAGED), limits_file(_file(folder, data)).table.windows)


def _map(folder: Path, data: bytes) -> None:
    import_recording(folder / "log.csv", read_map(_file(folder, data)), folder / "out.mcap")


def _supply(folder: Path, data: bytes) -> None:
    read_recording(ENGAGED, None, read_supply(_file(folder, data)))


def _scenario(folder: Path, data: bytes) -> None:
    (folder.parent / "published").symlink_to(ROOT / "raw" / "published")
    file = read_scenario(_file(folder, data))
    simulate(file.table, gather_inputs(file, load_bench()))


SPECIMENS = (
    TextSpecimen("calibration", CALIBRATION, _calibration),
    TextSpecimen("limits", LIMITS, _limits),
    TextSpecimen("map of an import", MAP, _map),
    TextSpecimen("map beside recordings", SUPPLY, _supply),
    TextSpecimen("scenario", SCENARIO, _scenario),
)
LINES = ("value", "gone", "twice", "moved", "renamed", "nested")


def mutated(kind: str, text: str, rng: np.random.Generator) -> bytes:
    """The text with one mutation of a kind, of its bytes or of its lines."""
    if kind in KINDS:
        return mutate(kind, Specimen("", text.encode(), Held(Counter(), "", False, True), ()), rng)
    lines = text.splitlines()
    places = [number for number, line in enumerate(lines) if "=" in line]
    at = int(rng.choice(places))
    key, _, value = lines[at].partition("=")
    other = VALUES[int(rng.integers(len(VALUES)))]
    if kind == "value":
        lines[at] = f"{key}= {other}"
    elif kind == "gone":
        del lines[at]
    elif kind == "twice":
        lines.insert(int(rng.integers(len(lines))), lines[at])
    elif kind == "moved":
        lines.insert(int(rng.integers(len(lines) - 1)), lines.pop(at))
    elif kind == "renamed":
        lines[at] = f"{key.strip()[:-1]}_x = {value}" if rng.random() < 0.5 else f"{key.strip()}.a ={value}"
    else:
        lines[at] = f"{key}= [{value.partition('#')[0]}, {other}]"
    return "\n".join(lines).encode()


@contextmanager
def _patient() -> Iterator[None]:
    def late(_: int, __: FrameType | None) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGVTALRM, late)
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def text_outcome(specimen: TextSpecimen, data: bytes) -> tuple[TextOutcome, str]:
    """What becomes of a text, and the exception where there is one that must not be."""
    with TemporaryDirectory() as name, _patient(), warnings.catch_warnings():
        warnings.simplefilter("error")
        folder = Path(name) / "case"
        folder.mkdir()
        try:
            specimen.use(folder, data)
        except (PmgError, UnusableRecordingError):
            return TextOutcome.REFUSED, ""
        except TimeoutError:
            return TextOutcome.HUNG, ""
        except Exception as fault:
            return TextOutcome.CRASHED, f"{type(fault).__name__}: {fault!s:.300}"
    return TextOutcome.RESULT, ""


def text_outcomes(specimen: TextSpecimen, count: int, rng: np.random.Generator) -> Mapping[str, Counter[TextOutcome]]:
    """Outcomes by kind of mutation; what must not be is told with the text it came of."""
    kinds = (*KINDS, *LINES)
    counts = {kind: Counter[TextOutcome]() for kind in kinds}
    for number in range(count):
        kind = kinds[number % len(kinds)]
        data = mutated(kind, specimen.text, rng)
        found, why = text_outcome(specimen, data)
        counts[kind][found] += 1
        if found in (TextOutcome.CRASHED, TextOutcome.HUNG):
            warnings.warn(f"{specimen.name}, {kind}: {found}: {why}\n{data[-2000:]!r}", stacklevel=1)
    return counts
