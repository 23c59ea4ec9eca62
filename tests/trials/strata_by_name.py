"""Strata of a trial by their names."""

from __future__ import annotations

from pmg.pipeline.trials.strata import Stratum, strata


def find_stratum(name: str) -> Stratum:
    """The stratum of that name."""
    return next(stratum for stratum in strata() if stratum.name == name)
