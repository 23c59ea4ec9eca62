"""What an analysis leaves in the store: grids as CSV and Parquet, losses, fits; and how the next stage reads it."""

from __future__ import annotations

import hashlib
import io
import json
from typing import TYPE_CHECKING, Any

import pandas as pd
import polars as pl

from pmg.pipeline.aside import write_aside
from pmg.pipeline.fitdocument import damping_document, fit_document, further_document, number
from pmg.pipeline.gridtable import frame_grid, grid_frame
from pmg.pipeline.losses import QUANTITIES
from pmg.pipeline.options import AnalysisOptions
from pmg.sim.errors import StoreError
from pmg.sim.signals import SPEED_SUN

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.analyse import Analysis
    from pmg.pipeline.calibrate import Calibration
    from pmg.pipeline.diagnose.noise import ShaftNoise
    from pmg.pipeline.losses import PowerBalance
    from pmg.sim.grid import Grid

SCHEMA = "pmg.analysis/1"
FOLDER = "analysis"
SUMMARY = "analysis.json"


def _write_frame(frame: pd.DataFrame, stem: Path) -> str:
    """The frame as CSV and as Parquet; returns the hash of the latter."""
    write_aside(stem.with_suffix(".csv"), frame.to_csv(index=False, lineterminator="\n").encode())
    columns = {name: _plain(frame[name]) for name in frame.columns}
    buffer = io.BytesIO()
    pl.DataFrame(columns).write_parquet(buffer, compression="zstd", statistics=False)
    write_aside(stem.with_suffix(".parquet"), buffer.getvalue())
    return hashlib.sha256(buffer.getvalue()).hexdigest()


def _plain(column: pd.Series[Any]) -> list[Any]:
    return list(column.tolist())


def balance_frame(balance: PowerBalance) -> pd.DataFrame:
    """Losses and efficiencies by point: value, independent and common standard uncertainty, SI."""
    at = balance.grid.points
    columns: dict[str, Any] = {"point": at.name, SPEED_SUN.display_name: SPEED_SUN.display(at.speed_sun)}
    columns |= {"load_set_Nm": at.load_set, "drive": at.drive}
    for signal in QUANTITIES:
        unit = "_W" if signal.unit == "W" else ""
        columns[signal.name + unit] = balance.values[signal.name]
        columns[f"u_{signal.name}{unit}"] = balance.independent[signal.name]
        columns[f"u_common_{signal.name}{unit}"] = balance.common[signal.name]
    return pd.DataFrame(columns)


def _noise_document(noise: ShaftNoise) -> dict[str, Any]:
    return {
        "u_Nm": number(noise.u),
        "within_Nm": number(noise.within),
        "repeats_Nm": number(noise.repeats),
        "repeats_dof": noise.repeats_dof,
        "unstructured_Nm": number(noise.unstructured),
        "correlation": noise.correlation,
        "source": noise.source,
    }


def _calibration_document(calibration: Calibration) -> dict[str, Any]:
    return {
        "constants": {
            name: {
                "value": calibration.value(name),
                "standard_error": calibration.standard_error(name),
                "free": name in calibration.names,
                "on_bound": name in calibration.on_bound,
            }
            for name in ("K_corr", "b", "c", "d")
        },
        "chi_square": calibration.chi_square,
        "degrees_of_freedom": calibration.dof,
        "stopped": calibration.message,
    }


def analysis_document(analysis: Analysis) -> dict[str, Any]:
    """The analysis as JSON."""
    grid = analysis.grid
    at = grid.points
    return {
        "schema": SCHEMA,
        "campaign": grid.campaign,
        "origin": grid.origin,
        "options": analysis.options.document(),
        "points": {
            "all": len(grid),
            "accepted": int(grid.accepted.sum()),
            "neutral": int(at.neutral.sum()),
            "engaged": int(at.engaged.sum()),
            "zero": int(at.zero.sum()),
        },
        "holes": list(analysis.lacking),
        "not_done": [str(error) for error in analysis.missing],
        "loss_curves": None
        if analysis.fits is None
        else {"sun": fit_document(analysis.fits.sun), "ring": fit_document(analysis.fits.ring)},
        "noise": None
        if analysis.floor is None
        else {"sun": _noise_document(analysis.floor.sun), "ring": _noise_document(analysis.floor.ring)},
        "calibration": None if analysis.calibration is None else _calibration_document(analysis.calibration),
        "correction_by_rule": number(analysis.rule_correction),
        "damping": [damping_document(fit) for fit in analysis.damping],
        **further_document(analysis),
    }


def write_analysis(analysis: Analysis, store: Path) -> Path:
    """Write grids, losses and fits into the store; returns the folder.

    ``grid`` holds every point, ``neutral_grid``, ``engaged_grid`` and ``zero_checks`` those of one configuration.
    The summary is written last: where it is there, the rest is.
    """
    folder = store / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    frame = grid_frame(analysis.grid)
    stamp = _write_frame(frame, folder / "grid")
    for configuration, name in (("neutral", "neutral_grid"), ("engaged", "engaged_grid"), ("zero", "zero_checks")):
        _write_frame(frame[frame.configuration == configuration], folder / name)
    if analysis.balance is not None:
        _write_frame(balance_frame(analysis.balance), folder / "losses")
    else:
        for suffix in (".csv", ".parquet"):
            (folder / "losses").with_suffix(suffix).unlink(missing_ok=True)
    text = json.dumps(analysis_document(analysis) | {"grid_sha256": stamp}, indent=1, allow_nan=False) + "\n"
    write_aside(folder / SUMMARY, text.encode())
    return folder


def read_analysis(store: Path) -> tuple[Grid, AnalysisOptions]:
    """The grid and the options of the analysis in a store.

    Raises
    ------
    StoreError
        There is no analysis, or it cannot be read.
    """
    folder = store / FOLDER
    summary = folder / SUMMARY
    if not summary.is_file():
        raise StoreError(
            str(store), "no analysis in it", f"{FOLDER}/{SUMMARY}", "Run 'pmg analyse' on this store first."
        )
    try:
        document = json.loads(summary.read_text(encoding="utf-8"))
        if document["schema"] != SCHEMA:
            raise StoreError(str(summary), f"schema {document['schema']}", SCHEMA, "Run 'pmg analyse' again.")
        options = AnalysisOptions.from_document(document["options"])
        data = (folder / "grid.parquet").read_bytes()
        if hashlib.sha256(data).hexdigest() != document["grid_sha256"]:
            raise StoreError(str(folder), "grid and summary of different runs", "one run's", "Run 'pmg analyse' again.")
        columns = pl.read_parquet(io.BytesIO(data))
        frame = pd.DataFrame({name: columns[name].to_list() for name in columns.columns})
        return frame_grid(frame, document["origin"], document["campaign"]), options
    except (ValueError, KeyError, TypeError, OSError, pl.exceptions.PolarsError) as error:
        raise StoreError(
            str(folder), f"unreadable ({type(error).__name__}: {error})", "what 'pmg analyse' wrote", "Run it again."
        ) from error
