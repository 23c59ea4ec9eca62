"""Settings of a call: the built-in default, the campaign file, and the options given, in that order."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmg.pipeline.files.notes import note_settings
from pmg.pipeline.fit.options import chosen_options
from pmg.pipeline.settings.campaign_file import MACHINE_KEY, read_campaign
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.fit.options import AnalysisOptions
    from pmg.pipeline.settings.campaign_file import CampaignFile
    from pmg.pipeline.settings.tolerance import Tolerances
    from pmg.pipeline.windows.limits import Steadiness
    from pmg.sim.errors import PmgError

KEYS = {
    "recordings": "recordings.path",
    "grids": "recordings.grids",
    "campaign": "recordings.campaign",
    "machine": MACHINE_KEY,
    "store": "store.path",
    "report": "report.path",
    "workers": "ingest.workers",
    "scheduler": "ingest.scheduler",
    "limits": "ingest.limits",
    "map": "ingest.map",
    "terms_sun": "analysis.terms_sun",
    "terms_ring": "analysis.terms_ring",
    "k_corr": "analysis.k_corr",
    "include_rest": "analysis.include_rest",
    "robust": "analysis.robust",
    "damping": "analysis.damping",
    "note": "compare.note",
    "model": "compare.model",
}
"""Full key of the campaign file for each choice of a call."""

FLAGS = {
    ("include_rest", True): "--include-rest",
    ("include_rest", False): "--exclude-rest",
    ("robust", True): "--robust",
    ("robust", False): "--no-robust",
}
"""Options that are switches, by their choice and position."""


@dataclass(frozen=True)
class Chosen:
    """Settings of a call.

    Parameters
    ----------
    values : mapping of str to value
        By choice, a key of `KEYS`: what a file or an option set.
    origins : mapping of str to str
        Where each of these was set: ``FILE:LINE``, or the option.
    file : CampaignFile or None
        The campaign file.
    """

    values: Mapping[str, Any]
    origins: Mapping[str, str]
    file: CampaignFile | None = None
    tolerance: Tolerances = field(default_factory=dict)

    def path(self, name: str) -> Path | None:
        """A file or folder; None where none was set."""
        value: Path | None = self.values.get(name)
        return value

    def needed(self, name: str, called: str = "") -> Path:
        """A file or folder that the call cannot do without.

        Parameters
        ----------
        name : str
            The choice.
        called : str
            Its option or argument, where that has another name than the choice.

        Raises
        ------
        BenchError
            Neither option nor file names it.
        """
        found = self.path(name)
        if found is None:
            option = called or (name.upper() if name == "recordings" else f"--{name}")
            table, key = KEYS[name].split(".")
            expected = f"{option}, or {key} in [{table}] of the file that --config names"
            raise BenchError(option, "missing", expected, f"Add {option}.")
        return found

    def text(self, name: str) -> str | None:
        """A text; None where none was set."""
        value: str | None = self.values.get(name)
        return value

    @property
    def workers(self) -> int | None:
        """Parallel workers; None where the ingest is to choose."""
        value: int | None = self.values.get("workers")
        return value

    @property
    def limits(self) -> Path | Steadiness | None:
        """By which windows are judged: a file, the table of the campaign file, or None for the defaults."""
        if "limits" in self.values or self.file is None or self.file.windows is None:
            return self.path("limits")
        return self.file.windows

    def options(self) -> AnalysisOptions:
        """Choices of the analysis."""
        return chosen_options(
            published=self.path("grids") is not None,
            terms_sun=self.text("terms_sun"),
            terms_ring=self.text("terms_ring"),
            correction=self.text("k_corr"),
            include_rest=self.values.get("include_rest"),
            robust=bool(self.values.get("robust")),
            damping=self.text("damping"),
            checks=None if self.file is None else self.file.file.table.checks,
        )


def choose(config: Path | None, faults: list[PmgError] | None = None, **given: object) -> Chosen:
    """Lay the options of a call over its campaign file.

    Parameters
    ----------
    config : Path, optional
        The campaign file.
    faults : list of PmgError, optional
        Receives every fault of the file's tables, which is then read without the keys at fault.
    **given : value or None
        By choice, a key of `KEYS`; None where the option was not given. Recordings or grids from the command line
        take the place of either in the file.

    Raises
    ------
    PmgError
        The file cannot be used.
    """
    file = None if config is None else read_campaign(config, faults)
    values: dict[str, Any] = {}
    origins: dict[str, str] = {}
    place = ("recordings", "grids")
    named = any(given.get(name) is not None for name in place)
    for name, key in KEYS.items():
        option = given.get(name)
        if option is not None:
            values[name] = option
            flag = FLAGS.get((name, option)) if isinstance(option, bool) else None
            origins[name] = flag or (name.upper() if name == "recordings" else f"--{name.replace('_', '-')}")
        elif file is not None and key in file.values and not (named and name in place):
            values[name], origins[name] = file.values[key], file.origin(key)
    note_settings(values)
    return Chosen(values, origins, file, {} if file is None else file.file.table.tolerances)
