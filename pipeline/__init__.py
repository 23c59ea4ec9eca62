"""From recordings to a diagnosis: bring recordings to grids, ask the simulator, explain the difference.

For notebooks and scripts::

    from pmg.pipeline import ingest, analyse, compare, diagnose, write_report

    campaign = analyse(ingest("recordings"))
    diagnosis = diagnose(compare(campaign))
    print(diagnosis.statement)
    write_report(diagnosis, "report")

These names are loaded when they are used, so that importing the package loads no library of numbers. Their module,
`pmg.pipeline.commands.notebook`, describes each; they stay as they are from release to release.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pmg.pipeline.commands.notebook import analyse, compare, diagnose, ingest, read_recording, write_report

__all__ = ["analyse", "compare", "diagnose", "ingest", "read_recording", "write_report"]


def __getattr__(name: str) -> object:
    """A name of ``__all__``, loaded when it is asked for."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from pmg.pipeline.commands import notebook

    return getattr(notebook, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
