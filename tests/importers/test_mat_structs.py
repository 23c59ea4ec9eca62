"""Structs and cells of MATLAB in files up to version 7.2: each row of numbers in them is a channel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.io import savemat

from pmg.pipeline.importers.open_source import whole_channels
from pmg.pipeline.importers.table_source import TableSource
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

T = np.arange(50) / 100.0


def opened(path: Path) -> TableSource:
    return TableSource(path, "mat")


def test_fields_of_a_struct_are_channels_by_their_path(tmp_path: Path) -> None:
    scope = {"time": T, "signals": {"values": np.column_stack([T, 2.0 * T]), "label": "torque"}}
    savemat(tmp_path / "a.mat", {"scope": scope, "x": T})
    found = opened(tmp_path / "a.mat")
    names = ["scope/time", "scope/signals/values(:,1)", "scope/signals/values(:,2)", "x"]
    assert set(names) <= {channel.name for channel in found.channels}
    columns = whole_channels(found, names)
    for name, values in zip(names, (T, T, 2.0 * T, T), strict=True):
        np.testing.assert_array_equal(columns[name], values)
    with pytest.raises(RecordingError, match="numbers"):
        whole_channels(found, ["scope/signals/label"])


def test_what_holds_no_numbers_stands_once_under_its_name(tmp_path: Path) -> None:
    words, empty = np.empty(3, dtype=object), np.empty(0, dtype=object)
    words[:] = ["a", "b", "c"]
    savemat(tmp_path / "a.mat", {"log": words, "nothing": empty, "x": T})
    found = opened(tmp_path / "a.mat")
    assert [channel.name for channel in found.channels] == ["log", "nothing", "x"]
    with pytest.raises(RecordingError, match="numbers"):
        whole_channels(found, ["log"])


def test_elements_of_an_array_of_structs_and_cells_are_counted_from_one(tmp_path: Path) -> None:
    runs = np.zeros(2, dtype=[("q", object), ("tau", object)])
    for place, run in enumerate(runs, 1):
        run["q"], run["tau"] = place * T, -place * T
    cells = np.empty(2, dtype=object)
    cells[:] = [T, 3.0 * T[:20]]
    savemat(tmp_path / "a.mat", {"runs": runs, "cells": cells})
    found = opened(tmp_path / "a.mat")
    assert [channel.name for channel in found.channels] == [
        *(f"runs({place})/{field}" for place in (1, 2) for field in ("q", "tau")),
        *("cells{1}", "cells{2}"),
    ]
    np.testing.assert_array_equal(whole_channels(found, ["runs(2)/tau"])["runs(2)/tau"], -2.0 * T)
    np.testing.assert_array_equal(whole_channels(found, ["cells{2}"])["cells{2}"], 3.0 * T[:20])
