"""Writing files so that a kill at any moment leaves the old one or the new one."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path

PREFIX = ".pmg-"
"""Start of the names of files that are still being written."""


def write_aside(path: Path, data: bytes) -> None:
    """Write a file so that it is either the old one or the new one, never half of it.

    The data go to a file of another name in the same folder, which is then renamed. The folder is made if absent.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=PREFIX, suffix=path.suffix, dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as aside:
            aside.write(data)
            aside.flush()
            os.fsync(aside.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        with suppress(OSError):
            Path(name).unlink()
        raise
