"""Words that stand in an HDF5 file beside its samples: attributes, units, single values, texts of MATLAB."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

UNIT_KEYS = ("unit", "units", "Unit")
"""Attributes in which recorders keep the unit of a dataset."""
LONGEST_FACT = 1000
"""Signs of a text that is taken for a fact about the file."""

Handle: TypeAlias = Any
"""A file, group, dataset or library, all of h5py, which has no types."""


def text_of(attributes: Handle, key: str) -> str | None:
    """An attribute that is one word or number; None where it is missing or something else."""
    if key not in attributes:
        return None
    try:
        value = attributes[key]
    except (OSError, TypeError, ValueError):
        return None
    return word(value)


def word(value: object) -> str | None:
    """A single value as a word; None where it is none."""
    while isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    if isinstance(value, str):
        return "".join(sign for sign in value if sign.isprintable()).strip()
    return str(value) if isinstance(value, int | float) else None


def fact_of(dataset: Handle) -> str:
    """A single number or word that a dataset holds, or a text of MATLAB."""
    of_matlab = text_of(dataset.attrs, "MATLAB_class")
    if (
        of_matlab == "char"
        and dataset.dtype.kind == "u"
        and "MATLAB_empty" not in dataset.attrs
        and dataset.size < 1000
    ):
        return "".join(map(chr, np.asarray(dataset[()]).ravel().tolist()))
    small = of_matlab is None and dataset.shape in ((), (1,)) and dataset.dtype.names is None
    return (word(dataset[()]) or "") if small else ""


def units_of(dataset: Handle, lines: int) -> list[str]:
    """Unit of each line; attributes that contradict each other are all named, so that a map must settle it."""
    given: dict[str, None] = {}
    for key in UNIT_KEYS:
        value = dataset.attrs.get(key)
        if isinstance(value, np.ndarray) and lines > 1 and value.size == lines:
            return [word(each) or "" for each in value.reshape(-1)]
        found = text_of(dataset.attrs, key)
        if found:
            given[found] = None
    return [" or ".join(given)] * lines
