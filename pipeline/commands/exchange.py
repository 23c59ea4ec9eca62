"""The stages behind pmg import and pmg export."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.importers.channel_map import RUN_KEYS, read_map
from pmg.pipeline.importers.csv_dialect import CsvForm
from pmg.pipeline.importers.export import export_recording
from pmg.pipeline.importers.guess.map_guess import guess_map
from pmg.pipeline.importers.guess.map_text import map_text
from pmg.pipeline.importers.guess.signal_look import look_at
from pmg.pipeline.importers.import_recording import import_recording
from pmg.pipeline.importers.open_source import FORMATS, KINDS_OF_FILE, open_source
from pmg.pipeline.machine.machine_guess import guess_machine
from pmg.pipeline.machine.machine_text import machine_text
from pmg.pipeline.recording.findings import Findings
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.windows.limits_file import chosen_limits
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import BenchError, PmgError, RecordingError, near_miss

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.importers.import_recording import Imported
    from pmg.pipeline.importers.source import ForeignSource


def run_import(
    place: Path,
    chart: Path | None,
    out: Path | None,
    words: Iterable[str],
    progress: Progress | None = None,
) -> Outcome:
    """Bring a file, or each file of a folder, into layout pmg.v1.

    Parameters
    ----------
    place : Path
        CSV, TDMS, MF4, HDF5, MAT or Parquet, or a folder of them.
    chart : Path, optional
        Channel map; the call is refused without it.
    out : Path, optional
        Folder of the recordings, which are called like their sources; the call is refused without it.
    words : iterable of str
        ``key=value`` for the run, instead of what the map says.
    progress : callable, optional
        Told (done, total, name) after each file.

    Raises
    ------
    PmgError
        When the map is at fault, or none of the files could be imported.
    """
    if chart is None:
        do = "Name one; 'pmg import FILE --guess' proposes one."
        raise BenchError("--map", "missing", "a channel map", do)
    if out is None:
        raise BenchError("--out", "missing", "a folder for the recordings", "Name one.")
    channel_map, given = read_map(chart), _words(words)
    sources = _sources(place)
    done: list[Imported] = []
    failed: list[tuple[Path, PmgError]] = []
    for number, source in enumerate(sources, 1):
        try:
            done.append(import_recording(source, channel_map, out / f"{source.stem}.mcap", given))
        except PmgError as fault:
            failed.append((source, fault))
            if len(failed) == len(sources):
                raise
        if progress is not None:
            progress(number, len(sources), source.name)
    findings: list[Remark] = [finding for imported in done for finding in imported.findings]
    findings += [Remark("error", _place(fault, source), fault.advice, source.name) for source, fault in failed]
    samples = sum(sum(imported.written.values()) for imported in done)
    rows = f"{counted(sum(imported.rows for imported in done), 'row')}, {counted(samples, 'sample')} of all channels"
    head = f"imported {len(done)} of {counted(len(sources), 'file')}, {rows}, into {out}"
    data = {"out": str(out), "imported": [_imported_document(imported) for imported in done], "failed": len(failed)}
    return Outcome(data, (head, *_readings(done)), tuple(findings), partial=bool(failed))


def run_guess(
    place: Path, chart: Path | None, out: Path | None, words: Iterable[str], *, machine: bool = False
) -> Outcome:
    """Propose a channel map for a file, or the file of a machine that it is a recording of.

    Parameters
    ----------
    place : Path
        The file.
    chart : Path, optional
        Channel map; the call is refused with one.
    out : Path, optional
        TOML file to write; one that is there is never overwritten.
    words : iterable of str
        ``key=value`` for the run; the call is refused with one.
    machine : bool
        Whether a machine file is proposed.

    Raises
    ------
    PmgError
        When the file cannot be read, or `out` is there already.
    """
    for option, given in (("--map", chart is not None), ("--set", bool(tuple(words)))):
        if given:
            raise BenchError(option, "it stands beside --guess", "one of the two", "Leave one of them out.")
    if place.is_dir():
        raise RecordingError(str(place), "a folder", "one file, whose map serves others like it", "Name a file in it.")
    (source,) = _sources(place)
    findings = Findings(source.name)
    opened = open_source(source, CsvForm(), findings)
    proposed, share, text = _machine_of(opened) if machine else _map_of(opened)
    if out is not None:
        try:
            with out.open("x", encoding="utf-8", newline="\n") as stream:
                stream.write(text)
        except FileExistsError as there:
            do = "Name another file, or remove that one."
            raise BenchError(str(out), "it is there already", "a new file; none is overwritten", do) from there
    kind = "machine file" if machine else "map"
    line = (
        text.rstrip("\n")
        if out is None
        else f"wrote a proposed {kind} to {out}: {share} chosen, what is open is marked"
    )
    data = {
        "source": source.name,
        "format": opened.format,
        "reader": opened.reader,
        "reading": dict(opened.reading),
        "out": None if out is None else str(out),
        **proposed,
        "machine" if machine else "map": text,
    }
    return Outcome(data, (line,), findings.listed())


def _map_of(opened: ForeignSource) -> tuple[dict[str, Any], str, str]:
    """A channel map: as JSON, how much of it is chosen, as TOML."""
    guess = guess_map(opened, look_at(opened))
    chosen = sum(each.chosen is not None for each in guess.topics)
    return guess.document(), f"{chosen} of {counted(len(guess.topics), 'topic')}", map_text(guess)


def _machine_of(opened: ForeignSource) -> tuple[dict[str, Any], str, str]:
    """The same of a machine file."""
    guess = guess_machine(opened)
    chosen = sum(guess.chosen(*key) is not None for key in guess.channels)
    return guess.document(), f"{chosen} of {counted(len(guess.channels), 'channel')}", machine_text(guess)


def _place(fault: PmgError, source: Path) -> str:
    """Where in a file it failed: its name stands before it."""
    for name in (str(source), source.name):
        if fault.where.startswith(name):
            return fault.where.removeprefix(name).lstrip(":, ") or "file"
    return fault.where


def run_export(recording: Path, out: Path, rate_hz: float | None, limits: Path | None = None) -> Outcome:
    """Write the derived signals of a recording, and a preview; windows are judged by a file of limits, if given."""
    judged_by = chosen_limits(limits)
    done = export_recording(recording, out, rate_hz, judged_by)
    lines = (
        f"wrote {done.samples} stretches at {done.rate_hz:g} Hz and {done.previews} previews at "
        f"{done.preview_hz:g} Hz to {out}",
        f"windows judged by {'the default limits' if limits is None else limits}",
    )
    data: dict[str, Any] = {
        "out": str(out),
        "rate_hz": done.rate_hz,
        "preview_hz": done.preview_hz,
        "stretches": done.samples,
        "previews": done.previews,
        "limits": judged_by.document(),
    }
    return Outcome(data, lines, done.findings)


def _readings(done: Iterable[Imported]) -> tuple[str, ...]:
    """Dialects found in files whose format leaves it open, one line for those read alike."""
    alike: dict[str, list[str]] = {}
    for imported in done:
        words = ", ".join(f"{name.replace('_', ' ')} {word}" for name, word in imported.reading.items())
        if words:
            alike.setdefault(words, []).append(imported.source.name)
    return tuple(
        f"read with {words}: {names[0] if len(names) == 1 else counted(len(names), 'file')}"
        for words, names in alike.items()
    )


def _imported_document(imported: Imported) -> dict[str, Any]:
    return {
        "source": imported.source.name,
        "recording": imported.out.name,
        "format": imported.format,
        "reader": imported.reader,
        "reading": dict(imported.reading),
        "sha256": imported.sha256,
        "bytes": imported.size,
        "rows": imported.rows,
        "rate_hz": imported.rate_hz,
        "samples": dict(imported.written),
    }


def _words(given: Iterable[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in given:
        key, sign, value = text.partition("=")
        if not sign:
            raise BenchError("--set", f"'{text}'", "key=value", "Write, for example, --set point=P17.")
        if key.strip() not in RUN_KEYS:
            raise BenchError("--set", f"key '{key}'", "a key of pmg.run", near_miss(key.strip(), RUN_KEYS))
        found[key.strip()] = value.strip()
    return found


def _sources(place: Path) -> list[Path]:
    """The file, or those of the folder that are of a known format.

    Raises
    ------
    RecordingError
        When there is none, or two of them would become one recording.
    """
    if not place.is_dir():
        if not place.is_file():
            raise RecordingError(str(place), "no such file or folder", "a recording", "Correct the path.")
        return [place]
    ends = FORMATS.keys() - {".txt"}
    found = sorted(path for path in place.iterdir() if path.suffix.lower() in ends and path.is_file())
    if not found:
        do = f"Known ends of names: {', '.join(sorted(ends))}."
        raise RecordingError(str(place), "no file of a known format", f"recordings in {KINDS_OF_FILE}", do)
    stems = [path.stem for path in found]
    twice = [path.name for path in found if stems.count(path.stem) > 1]
    if twice:
        came, do = f"{' and '.join(twice[:2])} differ only in their end", "Import them into different folders."
        raise RecordingError(str(place), came, "one recording for each name", do)
    return found
