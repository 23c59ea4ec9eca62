"""Tables of field computations from CSV: any order of rows, every fault reported with its place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pmg.pipeline.simulate.field_csv import COLUMNS, read_fem_csv
from pmg.sim.bench import BenchParameters
from pmg.sim.errors import GridError
from pmg.sim.maps.analytic import analytic_map
from pmg.sim.maps.table import fit_map


def computed(bench: BenchParameters) -> pd.DataFrame:
    sun, ring = np.meshgrid(np.linspace(0.0, 72.0, 19), np.linspace(0.0, 360.0 / 13.0, 15), indexing="ij")
    torques = analytic_map(bench.gear1, 1.0, {3: 0.08}).torques(np.radians(sun), np.radians(ring))
    columns = (sun.ravel(), ring.ravel(), torques.sun.ravel(), torques.ring.ravel())
    return pd.DataFrame(dict(zip(COLUMNS, columns, strict=True)))


def written(frame: pd.DataFrame, folder: Path) -> Path:
    path = folder / "fem.csv"
    frame.to_csv(path, index=False)
    return path


def test_rows_in_any_order_with_printed_decimals_give_the_map(
    bench: BenchParameters, tmp_path: Path, rng: np.random.Generator
) -> None:
    frame = computed(bench).round(6).sample(frac=1.0, random_state=rng)
    frame["flux_density_T"] = 0.7
    fitted, quality = fit_map(read_fem_csv(written(frame, tmp_path)), bench.gear1)
    truth = analytic_map(bench.gear1, 1.0, {3: 0.08})
    assert fitted.pull_out.torque_high == pytest.approx(truth.pull_out.torque_high, abs=2e-6)
    assert quality.residual_max < 1e-5
    assert fitted.origin.endswith("fem.csv")


def test_a_missing_column_is_told_with_the_nearest_name(bench: BenchParameters, tmp_path: Path) -> None:
    path = written(computed(bench).rename(columns={"ring_torque_Nm": "ring_torque_nm"}), tmp_path)
    with pytest.raises(GridError, match=r"expected a column ring_torque_Nm\. Did you mean 'ring_torque_nm'"):
        read_fem_csv(path)


@pytest.mark.parametrize("cell", ["", "n/a", "inf", "1,5"])
def test_a_cell_that_is_no_number_is_told_with_its_row(bench: BenchParameters, tmp_path: Path, cell: str) -> None:
    frame = computed(bench).astype(object)
    frame.loc[7, "sun_torque_Nm"] = cell
    with pytest.raises(GridError, match=r"row 8, column sun_torque_Nm: .*expected a finite number"):
        read_fem_csv(written(frame, tmp_path))


def test_a_missing_pair_of_angles_is_told(bench: BenchParameters, tmp_path: Path) -> None:
    frame = computed(bench).drop(index=16)
    told = r"sun angle 4, ring angle 1\.97802 degrees: 0 rows in a table of 19 sun and 15 ring angles"
    with pytest.raises(GridError, match=told):
        read_fem_csv(written(frame, tmp_path))


def test_a_pair_of_angles_given_twice_is_told(bench: BenchParameters, tmp_path: Path) -> None:
    frame = computed(bench)
    with pytest.raises(GridError, match=r"2 rows in a table .* Leave one of the rows out"):
        read_fem_csv(written(pd.concat([frame, frame.iloc[[3]]]), tmp_path))


@pytest.mark.parametrize(
    ("content", "told"),
    [(None, "no such file"), (b"", "not a table"), (b"\xff\xfe\x00", "not a table"), (",".join(COLUMNS), "no rows")],
)
def test_a_file_that_holds_no_table_is_told(tmp_path: Path, content: bytes | str | None, told: str) -> None:
    path = tmp_path / "fem.csv"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(GridError, match=told):
        read_fem_csv(path)
