"""Published grids with a value that no bench gives are refused with its place."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.store.sources import PUBLISHED
from pmg.sim.bench import BenchParameters
from pmg.sim.errors import GridError


@pytest.mark.parametrize("value", [1e308, -1e200, 1e9])
@pytest.mark.parametrize(
    ("file", "column"),
    [(0, "sun_loss_torque_Nm"), (1, "ring_torque_measured_Nm"), (1, "ring_torque_set_Nm")],
)
def test_a_torque_beyond_any_transducer_is_named(
    value: float, file: int, column: str, published_folder: Path, bench: BenchParameters, tmp_path: Path
) -> None:
    for number, name in enumerate(PUBLISHED):
        frame = pd.read_csv(published_folder / name).astype(float)
        if number == file:
            frame.loc[7, column] = value
        frame.to_csv(tmp_path / name, index=False)
    with pytest.raises(GridError, match=f"line 9, column {column}"):
        read_published(tmp_path, bench)
