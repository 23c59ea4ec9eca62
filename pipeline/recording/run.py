"""Facts of a run that its recording states: campaign, configuration, set-points, start."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, TypeVar

from pmg.pipeline.recording.findings import Code, Findings
from pmg.pipeline.recording.run_records import NO_SETPOINTS, Manoeuvre, RunInfo, Setpoints
from pmg.sim.bench import GEARS
from pmg.sim.errors import near_miss
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

Value = TypeVar("Value")

RECORD = "pmg.run"
LAYOUT = "pmg.v1"
SUPPLY = "a file for 'pmg ingest --map FILE'"
"""Where a user states what a recording lacks."""
REQUIRED = ("layout", "campaign", "configuration", "gear", "started_at")
OPTIONAL = ("point", "drive", "sun_speed_set_rpm", "ring_speed_set_rpm", "ring_torque_set_Nm", "note", "manoeuvre")
CONFIGURATIONS = tuple(each.value for each in Configuration)
DRIVES = SIDES
NUMBERS = tuple(str(gear) for gear in GEARS)
STEP_KEYS = {
    "sun_speed_rpm": ("speed_sun", RPM),
    "ring_speed_rpm": ("speed_ring", RPM),
    "ring_torque_Nm": ("torque_ring", 1.0),
}
"""Set-points of a test step: field of `Setpoints` and SI value of one unit."""
RUN_KEYS = {
    "sun_speed_set_rpm": ("speed_sun", RPM),
    "ring_speed_set_rpm": ("speed_ring", RPM),
    "ring_torque_set_Nm": ("torque_ring", 1.0),
}
"""Set-points in the run's metadata."""
RFC_3339 = re.compile(r"(\d{4}-\d\d-\d\d)[Tt ](\d\d:\d\d:\d\d)(?:\.(\d+))?(?:([Zz])|([+-]\d\d:\d\d))", flags=re.ASCII)
LARGEST_NUMBER = 1e12
"""Size beyond which a number is no reading or setting of a bench; its square, or a sum, may be beyond all floats."""
YEARS = 1970, 2261
"""First and last year of a start [UTC]: a recording counts nanoseconds since 1970 in 63 bits; beyond, it is damage."""


def read_run(records: Iterable[tuple[str, Mapping[str, str]]], findings: Findings) -> RunInfo | None:
    """The run that the metadata records describe; None, with findings, where they do not.

    Parameters
    ----------
    records : iterable of (name, mapping)
        Metadata records of the container.
    findings : Findings
        Receives every key that is missing, misspelt or out of vocabulary.
    """
    listed = list(records)
    found = [entries for name, entries in listed if name == RECORD]
    if not found or any(entries != found[0] for entries in found):
        names = sorted({name for name, _ in listed})
        came = "records that contradict each other" if found else f"metadata records {names}"
        findings.error(
            Code.RUN_MISSING,
            f"metadata '{RECORD}'",
            f"{came}; expected one record '{RECORD}' with {', '.join(REQUIRED)}",
            "Let the recorder write it once, when the run starts"
            + ("." if found else f", or state it in [run] of {SUPPLY}."),
        )
        return None
    return _checked(found[0], findings)


def _checked(entries: Mapping[str, str], findings: Findings) -> RunInfo | None:
    errors_before = sum(f.severity == "error" for f in findings.gathered)
    strange = sorted(set(entries) - set(REQUIRED) - set(OPTIONAL))
    for key in REQUIRED:
        if key not in entries:
            hint = near_miss(key, strange) if strange else f"Add '{key}' in the recorder, or in [run] of {SUPPLY}."
            _fault(findings, Code.RUN_KEY, key, "the key is missing", "it next to the others", hint)
    for key in strange:
        findings.warning(
            Code.RUN_KEY,
            f"{RECORD}.{key}",
            f"layout {LAYOUT} does not know this key; expected one of its own keys. It is not used",
            near_miss(key, (*REQUIRED, *OPTIONAL)),
        )
    _vocabulary(entries, "layout", (LAYOUT,), findings)
    configuration = _vocabulary(entries, "configuration", CONFIGURATIONS, findings)
    gear = _vocabulary(entries, "gear", NUMBERS, findings)
    drive = _vocabulary({"drive": "sun", **entries}, "drive", DRIVES, findings)
    if "drive" not in entries and configuration == Configuration.ENGAGED:
        findings.warning(
            Code.RUN_KEY,
            f"{RECORD}.drive",
            "the key is missing in an engaged run; expected 'sun' or 'ring'. Taken as 'sun'",
            "Let the recorder write which side drives.",
        )
    started = _parsed(
        entries,
        "started_at",
        _utc,
        f"a time such as 2025-04-23T08:00:40.390872Z, from {YEARS[0]} to {YEARS[1]}",
        findings,
    )
    setpoints = _setpoints(entries, findings)
    errors = sum(f.severity == "error" for f in findings.gathered) - errors_before
    if errors or configuration is None or gear is None or drive is None or started is None:
        return None
    return RunInfo(
        campaign=entries["campaign"],
        point=entries.get("point") or None,
        configuration=Configuration(configuration),
        gear=int(gear),
        drive=drive,
        started_at=started,
        setpoints=setpoints,
        note=entries.get("note", ""),
        manoeuvre=_manoeuvre(entries.get("manoeuvre", Manoeuvre.STEADY), Configuration(configuration), findings),
    )


def _manoeuvre(came: str, configuration: Configuration, findings: Findings) -> Manoeuvre:
    """What the run does; a word that is unknown, or that its configuration rules out, is a finding."""
    at_rest = configuration is Configuration.ZERO
    taken = Manoeuvre.ZERO if at_rest else Manoeuvre.STEADY
    known = tuple(each.value for each in Manoeuvre)
    if came in known and (came == Manoeuvre.STEADY or (came == Manoeuvre.ZERO) == at_rest):
        return Manoeuvre(came)
    words = [word for word in known if (word == Manoeuvre.ZERO) == at_rest]
    findings.warning(
        Code.RUN_VALUE,
        f"{RECORD}.manoeuvre",
        f"'{came}' in configuration '{configuration}'; expected {' or '.join(map(repr, words))}. Taken as '{taken}'",
        "Correct it in the recorder." if came in known else near_miss(came, words),
    )
    return taken


def known_of_run(records: Iterable[tuple[str, Mapping[str, str]]]) -> dict[str, Any]:
    """Known facts of the run of a recording that cannot be used: sound keys, and its `Setpoints`."""
    found = [entries for name, entries in records if name == RECORD]
    if not found or any(entries != found[0] for entries in found):
        return {}
    entries, findings = found[0], Findings(RECORD)
    known: dict[str, Any] = {key: entries[key] for key in ("campaign", "point", "note") if entries.get(key)}
    for key, words in (("configuration", CONFIGURATIONS), ("gear", NUMBERS), ("drive", DRIVES)):
        if (word := _vocabulary(entries, key, words, findings)) is not None:
            known[key] = int(word) if key == "gear" else word
    if (started := _parsed(entries, "started_at", _utc, "a time", findings)) is not None:
        known["started_at"] = started.isoformat()
    asked = _setpoints(entries, findings)
    return known | ({"setpoints": asked} if asked != NO_SETPOINTS else {})


def _setpoints(entries: Mapping[str, str], findings: Findings) -> Setpoints:
    """Set-points of the whole run."""
    return Setpoints(
        **{
            name: value * scale
            for key, (name, scale) in RUN_KEYS.items()
            if (value := _parsed(entries, key, finite, f"a finite number up to {LARGEST_NUMBER:g}", findings))
            is not None
        }
    )


def step_setpoints(point: str, entries: Mapping[str, float], findings: Findings) -> Setpoints:
    """Set-points of a test step in SI; an unknown or non-finite one is a finding and left out."""
    known: dict[str, float] = {}
    for key, value in sorted(entries.items()):
        if key in STEP_KEYS and abs(value) <= LARGEST_NUMBER:
            name, scale = STEP_KEYS[key]
            known[name] = value * scale
        else:
            findings.warning(
                Code.STEP_UNKNOWN,
                f"/test/step {point}",
                f"set-point '{key}' = {value}; expected a finite {', '.join(STEP_KEYS)}. It is not used",
                near_miss(key, STEP_KEYS) if key not in STEP_KEYS else "Correct the test sequence.",
            )
    return Setpoints(**known)


def _utc(text: str) -> datetime:
    """The time that an RFC 3339 text names, in UTC; digits beyond the microsecond are cut.

    Raises
    ------
    ValueError
        When the text is no such time, names no offset, or lies outside `YEARS`.
    """
    match = RFC_3339.fullmatch(text)
    if match is None:
        raise ValueError(text)
    day, clock, fraction, _, offset = match.groups()
    if not YEARS[0] <= int(day[:4]) <= YEARS[1]:
        raise ValueError(text)
    micro = (fraction or "0")[:6].ljust(6, "0")
    found = datetime.fromisoformat(f"{day}T{clock}.{micro}{offset or '+00:00'}").astimezone(UTC)
    if found.year < YEARS[0]:
        raise ValueError(text)
    return found


def finite(text: str) -> float:
    """A finite number of a size that something at a bench may have.

    Raises
    ------
    ValueError
        When the text is none.
    """
    value = float(text)
    if not abs(value) <= LARGEST_NUMBER:
        raise ValueError(text)
    return value


def _vocabulary(entries: Mapping[str, str], key: str, words: tuple[str, ...], findings: Findings) -> str | None:
    came = entries.get(key)
    if came is None or came in words:
        return came
    expected = " or ".join(f"'{word}'" for word in words)
    _fault(findings, Code.RUN_VALUE, key, f"'{came}'", expected, near_miss(came, words))
    return None


def _parsed(
    entries: Mapping[str, str], key: str, parse: Callable[[str], Value], expected: str, findings: Findings
) -> Value | None:
    if key not in entries:
        return None
    try:
        return parse(entries[key])
    except (ValueError, OverflowError):
        _fault(findings, Code.RUN_VALUE, key, f"'{entries[key]}'", expected, "Correct it in the recorder.")
        return None


def _fault(findings: Findings, code: Code, key: str, came: str, expected: str, do: str) -> None:
    findings.error(code, f"{RECORD}.{key}", f"{came}; expected {expected}", do)
