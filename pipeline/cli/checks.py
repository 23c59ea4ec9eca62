"""Checks of the words of a call, made before any stage is loaded and any recording is read."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from pmg.pipeline.store.sources import PUBLISHED, Shard, find_recordings
from pmg.pipeline.wording.option_words import AUTO, check_powers, parse_correction, parse_damping, parse_powers
from pmg.sim.errors import BenchError, RecordingError, StoreError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from inspect import Parameter


@dataclass(frozen=True)
class OptionCheck:
    """Check of an option, declared next to it in its annotation.

    Parameters
    ----------
    of : callable
        Takes the option as it is typed, its value and all values of the call; raises a `PmgError`.
    reads, writes : bool
        Whether the value is a place that is read, or one that is written.
    """

    of: Callable[[str, Any, Mapping[str, Any]], object]
    reads: bool = False
    writes: bool = False


def check_call(options: Sequence[Parameter], values: Mapping[str, Any]) -> None:
    """Check every value of a call that can be checked without reading a recording.

    Parameters
    ----------
    options : sequence of Parameter
        Parameters of the command, with their checks in the annotation.
    values : mapping
        What the call gave, by name of the parameter; None is what it did not give.

    Raises
    ------
    PmgError
        The first value that cannot be used.
    """
    read: dict[str, Path] = {}
    written: dict[str, Path] = {}
    for called, value, check in _checked(options, values):
        check.of(called, value, values)
        if check.reads:
            read[called] = Path(value).resolve()
        if check.writes:
            written[called] = Path(value).resolve()
    for called, place in written.items():
        for other, source in read.items():
            if source.is_dir() and (place == source or source in place.parents):
                do = "Name a folder beside it: what is read stays as it is."
                raise StoreError(f"{called} {place}", f"inside {other}, which is read", "a folder elsewhere", do)
        twin = next((name for name, path in written.items() if name != called and path == place), None)
        if twin is not None:
            raise StoreError(f"{called} {place}", f"the folder of {twin} too", "a folder of its own", "Name another.")


def _checked(options: Sequence[Parameter], values: Mapping[str, Any]) -> Iterator[tuple[str, Any, OptionCheck]]:
    """Each value that was given and has a check, with its option as it is typed."""
    for option in options:
        checks = [part for part in get_args(option.annotation) if isinstance(part, OptionCheck)]
        value = values.get(option.name)
        for each in value if isinstance(value, list) else (value,):
            if each is not None and checks:
                yield _typed(option), each, checks[0]


def _typed(option: Parameter) -> str:
    """An option or argument as it is typed."""
    about = next((part for part in get_args(option.annotation) if hasattr(part, "param_decls")), None)
    words = [getattr(about, "default", None), *(getattr(about, "param_decls", None) or ())]
    options = [word for word in words if isinstance(word, str) and word.startswith("--")]
    if options:
        return options[0].partition("/")[0]
    return str(getattr(about, "metavar", None) or option.name.upper()).strip("[]")


def _is_file(called: str, path: Path, _: Mapping[str, Any]) -> None:
    if not path.exists():
        raise BenchError(str(path), "no such file", f"the file that {called} names", "Check the path.")
    if path.is_dir():
        raise BenchError(str(path), "a folder", f"the file that {called} names", "Name the file itself.")


def _is_there(called: str, path: Path, _: Mapping[str, Any]) -> None:
    if not path.exists():
        came = "no such file" if path.suffix else "no such folder"
        raise RecordingError(str(path), came, f"what {called} is to read", "Check the path.")


def _holds_recordings(called: str, path: Path, values: Mapping[str, Any]) -> None:
    if values.get("machine") is None:
        find_recordings(path)
    else:  # another machine's recordings may have any format
        _is_there(called, path, values)


def _holds_grids(called: str, path: Path, _: Mapping[str, Any]) -> None:
    absent = next((name for name in PUBLISHED if not (path / name).is_file()), None)
    if absent is not None:
        raise BenchError(
            str(path / absent), "no such file", f"{' and '.join(PUBLISHED)} in {called}", "Check the path."
        )


def _is_store(called: str, path: Path, values: Mapping[str, Any]) -> None:
    """A store is made by what takes recordings or grids; others need one that is there."""
    if "recordings" in values or values.get("grids") is not None or values.get("plan") is not None:
        _can_hold(called, path, values)
    elif not path.exists():
        raise StoreError(str(path), "no such folder", "a store", "Run 'pmg ingest' first, or check the path.")


def _can_hold(called: str, path: Path, _: Mapping[str, Any]) -> None:
    """A folder that is there or can be made, with the rights to write."""
    if path.exists() and not path.is_dir():
        raise StoreError(str(path), "a file", f"a folder for {called}", "Name a folder.")
    _can_write(called, path)


def _can_be_written(called: str, path: Path, _: Mapping[str, Any]) -> None:
    if path.is_dir():
        raise StoreError(str(path), "a folder", f"a file for {called}", "Name the file itself.")
    _can_write(called, path.parent)


def _can_write(called: str, folder: Path) -> None:
    there = next((place for place in (folder.absolute(), *folder.absolute().parents) if place.exists()), None)
    if there is None:
        raise StoreError(str(folder), "no such drive", f"a folder for {called}", "Name another place.")
    if not there.is_dir():
        raise StoreError(str(there), "a file", f"a folder on the way to {called}", "Name another place.")
    if not os.access(there, os.W_OK | os.X_OK):
        raise StoreError(
            str(there), "no right to write there", f"a writable folder for {called}", "Name another place."
        )


def _terms(called: str, text: str, _: Mapping[str, Any]) -> None:
    if text != AUTO:
        check_powers(parse_powers(text, called))


def _positive(called: str, value: float, _: Mapping[str, Any]) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise BenchError(called, f"{value:g}", "a finite number above 0", "Correct the value.")


def _is_setting(called: str, text: str, _: Mapping[str, Any]) -> None:
    if not text.partition("=")[0].strip() or "=" not in text:
        raise BenchError(called, f"'{text}'", "key=value", f"Write, for example, {called} point=P17.")


def _is_address(called: str, text: str, _: Mapping[str, Any]) -> None:
    from pmg.pipeline.files.parallel import ADDRESS

    if not ADDRESS.fullmatch(text):
        expected = "that of a dask scheduler, such as tcp://host:8786"
        raise StoreError(f"{called} {text}", "no address of a scheduler", expected, "'dask scheduler' prints it.")


FILE = OptionCheck(_is_file, reads=True)
"""A file that is read."""
PLACE = OptionCheck(_is_there)
"""A file or folder that is read."""
WATCHED = OptionCheck(_is_there, reads=True)
"""A folder to which recordings come."""
RECORDINGS = OptionCheck(_holds_recordings, reads=True)
"""A folder of recordings, or one."""
GRIDS = OptionCheck(_holds_grids, reads=True)
"""A folder of published grids."""
STORE = OptionCheck(_is_store, writes=True)
"""A store, to be made or there."""
FOLDER_OUT = OptionCheck(_can_hold, writes=True)
"""A folder that is written."""
FILE_OUT = OptionCheck(_can_be_written)
"""A file that is written."""
TERMS = OptionCheck(_terms)
"""Powers of speed."""
CORRECTION = OptionCheck(lambda _called, text, _values: parse_correction(text))
"""How K_corr is found."""
DAMPING = OptionCheck(lambda _called, text, _values: parse_damping(text))
"""Weights of the damping fit."""
SHARD = OptionCheck(lambda _called, text, _values: Shard.of(text))
"""A part of the recordings."""
SCHEDULER = OptionCheck(_is_address)
"""Address of a cluster."""
POSITIVE = OptionCheck(_positive)
"""A number above 0."""
SETTING = OptionCheck(_is_setting)
"""A key and its value."""
