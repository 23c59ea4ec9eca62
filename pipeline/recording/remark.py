"""Remarks: what the user should know, with its severity and its place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Remark:
    """One thing the user should know.

    Parameters
    ----------
    severity : str
        ``error``, ``warning`` or ``info``.
    where : str
        The place it is about.
    message : str
        What was found.
    file : str, optional
        The file it is about, where it is about one.
    """

    severity: str
    where: str
    message: str
    file: str | None = None

    @property
    def place(self) -> str:
        """The place, with the file it lies in."""
        return self.where if self.file is None else f"{self.file}: {self.where}"

    def to_dict(self) -> dict[str, Any]:
        """Plain form for JSON."""
        file = {} if self.file is None else {"file": self.file}
        return {"severity": str(self.severity), **file, "where": self.where, "message": self.message}
