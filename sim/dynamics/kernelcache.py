"""Where compiled solvers are kept between runs: a folder of the user's cache; safe to delete at any time."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

SETTING = "PMG_CACHE"
"""Environment variable that names the folder; without it the user's cache folder is taken.

Code is run from there, so a folder or file that others may write to is not used: solvers are then made anew.
"""

END = "\n# whole\n"
"""Last line of a solver that was written to its end."""


def _cache_folder() -> Path:
    """Folder of the compiled solvers."""
    named = os.environ.get(SETTING)
    if named:
        return Path(named)
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(base) if base else Path.home() / ".cache") / "pmg"


@lru_cache(maxsize=1)
def _sources() -> bytes:
    """Digest of all that decides the generated text and its meaning: the physics' own source, and the tools."""
    digest = hashlib.sha256()
    for tool in ("numba", "sympy", "numpy"):
        digest.update(version(tool).encode() + b"\0")
    room = Path(__file__).resolve().parent.parent
    for path in sorted(room.rglob("*.py")):
        digest.update(path.relative_to(room).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.digest()


def load_solver(structure: str, lasting: bool, make: Callable[[bool], str]) -> ModuleType:
    """The compiled solver of a structure, from the cache or made anew.

    Parameters
    ----------
    structure : str
        What the text depends on, besides the source of this package.
    lasting : bool
        Whether it may be kept; not when it depends on code from elsewhere.
    make : callable
        Makes the text; its argument says whether compiled code is kept next to it.
    """
    name = "solver_" + hashlib.sha256(_sources() + structure.encode()).hexdigest()[:24]
    if not lasting:
        return _run(make(False), name)
    try:
        path = _cache_folder() / f"{name}.py"
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _own(path.parent):
            return _run(make(False), name)
        if not (path.is_file() and _own(path) and path.read_text(encoding="utf-8").endswith(END)):
            descriptor, aside = tempfile.mkstemp(dir=path.parent, prefix=f".{name}.", suffix=".part")
            with os.fdopen(descriptor, "w", encoding="utf-8") as stream:
                stream.write(make(True) + END)
                stream.flush()
                os.fsync(stream.fileno())
            Path(aside).replace(path)
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None  # a path that ends in .py has a loader
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # the compiler looks its functions up there
        spec.loader.exec_module(module)
    except (OSError, RuntimeError, UnicodeDecodeError):  # no home, no rights, no room, damage: done without
        return _run(make(False), name)
    return module


def _own(path: Path) -> bool:
    """Whether nobody else could have put it there: code is run from it."""
    if os.name != "posix":
        return True
    facts = path.stat()
    return facts.st_uid == os.geteuid() and not facts.st_mode & 0o022


def _run(text: str, name: str) -> ModuleType:
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(name, loader=None))  # type: ignore[arg-type]
    exec(compile(text, f"<{name}>", "exec"), module.__dict__)
    return module
