"""The case that a machine file makes of a folder of records: channels, library, known terms, what is withheld."""

from __future__ import annotations

from dataclasses import replace
from fnmatch import fnmatch
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.balance.case import OUTPUT, Case, SecondFile, check_model
from pmg.pipeline.diagnosis.balance.known_terms import check_known, check_parameters, set_terms
from pmg.pipeline.diagnosis.balance.library.drive import DRIVE, ROTARY_DRIVE
from pmg.pipeline.diagnosis.balance.library.two_torques import GAINS, TWO_TORQUES
from pmg.pipeline.diagnosis.balance.library.warmth import warm_term
from pmg.pipeline.diagnosis.balance.records.zero import ZERO, with_zero
from pmg.pipeline.files.strict_tables import RefusalError
from pmg.pipeline.importers.open_source import FORMATS
from pmg.pipeline.machine.axis import LINEAR
from pmg.pipeline.machine.channel import TIMES, in_si
from pmg.pipeline.recording.findings import Code, Findings
from pmg.pipeline.report.write import LISTING
from pmg.pipeline.wording.units import TEMPERATURE_UNITS
from pmg.sim.errors import BenchError, RecordingError, near_miss

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term
    from pmg.pipeline.machine.channel import Channel
    from pmg.pipeline.machine.machine import Machine, MachineShaft
    from pmg.pipeline.machine.tables import RecordsTable

OF_A_GEAR = "MCAP of layout pmg.v1 is of a magnetic gear: name the machine file of one, or leave --machine out."
"""What to do with recordings of the bench beside the file of another machine."""

BASELINE = ("inertia", "viscous", "coulomb")
"""Terms that are taken for granted where a machine file says nothing else."""

OF_GAIN = {"input_torque_gain": "force", "output_torque_gain": f"{OUTPUT}force"}
"""Channel of each transducer by the term that is its gain."""


def case_of(machine: Machine, records: Path) -> Case:
    """The case of a machine and its records.

    Parameters
    ----------
    machine : Machine
        With a table of records.
    records : Path
        A folder of recordings of any format that is imported, or one of them.

    Raises
    ------
    BenchError
        When the machine file lacks what its records need, or names a term or a record that is not there.
    RecordingError
        When there are no recordings.
    """
    table = machine.records
    if table is None:
        do = "Add [records] with time, rate_Hz and low_pass_Hz, and a channel of each shaft."
        raise BenchError(f"{machine.path}: records", "missing", "how its records are read", do)
    ends = machine.ends
    two = len(ends) > 1 and all("force" in end.channels for end in ends)
    main = ends[0] if two else _measured(machine)
    second = _second(table)
    files = _files(records, second)
    zero = _named(machine, "zero", table.zero, files)
    withheld = _named(machine, "withheld", table.withheld, files)
    if len({*withheld, *zero}) == len(files):
        do = "Leave one of them to fit to."
        key = "withheld" if withheld else "zero"
        raise machine.file.refusal("no recording is left", "at least one to fit", do, "records", key)
    library = _library(main, table, two=two)
    fixed = dict(machine.model.fixed)
    if "force" not in main.channels and "inertia" not in fixed:
        fixed["inertia"] = _known_inertia(machine, main)
    baseline = tuple(machine.model.baseline) or BASELINE
    channels = _channels(table, main, ends[1] if two else None)
    _check_twice(machine, channels)
    if table.zeros == "own" and ZERO in baseline:
        do = 'Each recording has a zero of its own: leave it out, or set zeros = "common".'
        raise machine.file.refusal(ZERO, "terms that recordings share", do, "model", "baseline")
    try:
        check_model(library, baseline, fixed, ("model",), "baseline")
        check_parameters(library, machine.published, "published")
        check_known(library, baseline, machine.model.known, "model", "known")
    except RefusalError as fault:
        raise machine.file.refusal(fault.came, fault.expected, fault.do, *fault.key) from fault
    case = Case(
        title=machine.title,
        axis=main.axis,
        library=library,
        fit=tuple(path for path in files if path not in (*withheld, *zero)),
        withheld=tuple(path for path in withheld if path not in zero),
        channels=channels,
        form=table.csv,
        prepare=table,
        baseline=baseline,
        fixed=fixed,
        known=set_terms(library, machine.model.known),
        published=machine.published,
        published_errors=machine.published_errors,
        ratio=machine.gear.ratio if two and machine.gear is not None else None,
        withheld_part=table.withheld_part,
        own_zeros=table.zeros == "own",
        shaft=main.name,
        second=second if two else None,
        zero=zero,
        tolerances=_of_transducers(ends, "tolerance", ("input_torque_gain", "output_torque_gain")) if two else {},
        nominal=_of_transducers(ends if two else (main,), "nominal", ("force", f"{OUTPUT}force")),
    )
    case = _with_gains(case, machine)
    return with_zero(case, machine.file) if zero else case


def _of_transducers(ends: tuple[MachineShaft, ...], key: str, names: tuple[str, ...]) -> dict[str, float]:
    """What is stated of the transducer of each shaft, by a name for each."""
    stated = (end.numbers.get(f"transducer.{key}") for end in ends)
    return {name: number.value for name, number in zip(names, stated, strict=False) if number is not None}


def _with_gains(case: Case, machine: Machine) -> Case:
    """A case whose torques are those of its shafts where the gain of a transducer is known, so that losses are, too."""
    channels, told = dict(case.channels), Findings(machine.path.name)
    for each in case.known:
        if (kind := OF_GAIN.get(each.term.identifier)) is None:
            continue
        (g,) = each.amplitudes.tolist()
        if g <= -1.0 if kind == "force" else g >= 1.0:
            came, do = f"g = {g:g} of {each.term.key}", "Correct it, or set the sign of the channel."
            raise machine.file.refusal(came, "a transducer that shows some of its torque", do, "model", "known")
        channel, unit = channels[kind]
        factor = GAINS[each.term.identifier](g)
        channels[kind] = channel, unit / factor
        message = f"shows {factor:.5g} times its torque, as [model] known says: divided by that"
        told.info(Code.CHANNEL_VALUE, channel.name, message, "Nothing to do.")
    gains = tuple(each for each in case.known if each.term.identifier in OF_GAIN)
    known = tuple(each for each in case.known if each not in gains)
    return replace(case, channels=channels, known=known, gains=gains, findings=(*case.findings, *told.listed()))


def _measured(machine: Machine) -> MachineShaft:
    """The one shaft whose balance is looked at: the one with a torque, else the one that is seen to move.

    Its motion is that of the other one through the gear, where it has none of its own.
    """
    moves, pushed = {"position", "velocity"}, [end for end in machine.ends if "force" in end.channels]
    seen = [end for end in machine.ends if moves & set(end.channels)]
    if not seen:
        where = f"{machine.path}: shaft.{machine.ends[0].name}.channel"
        do = "Name the channel of the shaft that is driven, in the words of its file."
        raise BenchError(where, "neither position nor velocity", "a channel that moves", do)
    if not pushed or pushed[0] in seen:
        return pushed[0] if pushed else seen[0]
    assert machine.gear is not None  # two shafts
    ratio = machine.gear.ratio if pushed[0] is machine.ends[0] else 1.0 / machine.gear.ratio
    through = {kind: (c, unit * ratio) for kind, (c, unit) in seen[0].channels.items() if kind in moves}
    return replace(pushed[0], channels={**pushed[0].channels, **through})


def _library(main: MachineShaft, table: RecordsTable, *, two: bool) -> tuple[Term[Motion], ...]:
    plain = TWO_TORQUES if two else DRIVE if main.axis is LINEAR else ROTARY_DRIVE
    return plain if table.temperature is None else (*plain, warm_term(main.axis))


def _channels(
    table: RecordsTable, main: MachineShaft, output: MachineShaft | None
) -> Mapping[str, tuple[Channel, float]]:
    found = dict(main.channels)
    if table.time is not None:
        found["time"] = in_si(table.time, TIMES)
    if output is not None:
        found |= {OUTPUT + kind: channel for kind, channel in output.channels.items()}
    if table.temperature is not None:
        found["temperature"] = in_si(table.temperature, TEMPERATURE_UNITS)
    return found


def _check_twice(machine: Machine, channels: Mapping[str, tuple[Channel, float]]) -> None:
    """Refuse one column that is to be two things."""
    names = [channel.name for kind, (channel, _) in channels.items() if kind != "time"]
    for name in names:
        if names.count(name) > 1 and machine.records is not None and machine.records.second is None:
            where = f"{machine.path}: channel '{name}'"
            raise BenchError(where, "named for two things", "a column for each", "Correct one of the names.")


def _known_inertia(machine: Machine, shaft: MachineShaft) -> float:
    """Inertia of everything that moves, as a shaft of a machine that coasts sees it [SI]."""
    value = machine.seen_by(machine.shafts[shaft.name], "inertia")
    if value is None or value.value <= 0.0:
        where = f"{machine.path}: shaft.{shaft.name}.inertia"
        do = f"Without a {shaft.axis.pushes}, friction shows as part of the inertia only: state it of every shaft."
        raise BenchError(where, "missing", f"the inertia, or a {shaft.axis.pushes}", do)
    return value.value


def _second(table: RecordsTable) -> SecondFile | None:
    if table.second is None:
        return None
    old, new = table.second.replace
    return SecondFile((old, new), in_si(table.second.time, TIMES))


def _files(records: Path, second: SecondFile | None) -> tuple[Path, ...]:
    """Recordings of a folder in the order of their names; one where a file is given."""
    if records.is_file():
        return (records,)
    if not records.is_dir():
        raise RecordingError(str(records), "no such folder", "recordings", "Check the path.")
    reports = {path.parent for path in records.rglob(LISTING)}  # their tables are no recordings
    every = (path for path in records.rglob("*") if path.is_file() and path.suffix.lower() in FORMATS)
    found = tuple(sorted(path for path in every if not reports & set(path.parents)))
    if second is not None:  # those that are not the second of another
        found = tuple(path for path in found if second.replace[0] in path.name)
    if not found:
        expected = f"files that end in {', '.join(FORMATS)}"
        others = sorted({path.suffix for path in records.rglob("*") if path.is_file() and path.suffix})
        came = f"no recordings (but {', '.join(others[:5])})" if others else "no recordings"
        do = OF_A_GEAR if ".mcap" in others else "Name the folder that holds them."
        raise RecordingError(str(records), came, expected, do)
    return found


def _named(machine: Machine, key: str, patterns: Sequence[str], files: tuple[Path, ...]) -> tuple[Path, ...]:
    """Recordings whose names fit a pattern of a key of `[records]`."""
    found = set()
    for i, pattern in enumerate(patterns):
        fits = [path for path in files if fnmatch(path.name, pattern)]
        if not fits:
            do = near_miss(pattern, [path.name for path in files])
            raise machine.file.refusal(f"'{pattern}'", "the name of a recording", do, "records", key, i)
        found.update(fits)
    return tuple(path for path in files if path in found)
