"""Outputs of an analysis in the store: grids as CSV and Parquet, losses, fits; and how they are read again."""

from __future__ import annotations

import hashlib
import io
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import polars as pl

from pmg.pipeline.analysis.power_flow import flow_document, flow_frame, power_flows
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.json_values import PROOF, proven_json, read_json, read_proven_json
from pmg.pipeline.files.notes import note_read
from pmg.pipeline.fit.budget_document import budget_document, budget_frame
from pmg.pipeline.fit.common_errors import CORRECTION, CURVES, TRANSDUCERS
from pmg.pipeline.fit.document import damping_document, fit_document, further_document, number
from pmg.pipeline.fit.losses import AVERAGED, QUANTITIES
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.levels import by_load
from pmg.pipeline.grid.missing_uncertainty import unstated_columns, unstated_in
from pmg.pipeline.grid.tables import frame_grid, grid_frame
from pmg.pipeline.motion.stored import only_in_motion
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.store.store import MARK, Store, refuse_recordings
from pmg.pipeline.wording.safe_text import spreadsheet_text
from pmg.sim.errors import StoreError
from pmg.sim.signals import SPEED_SUN
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.budget import Budget
    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.pipeline.fit.common_errors import CommonErrorSources
    from pmg.pipeline.fit.losses import PowerBalance
    from pmg.pipeline.fit.noise import ShaftNoise
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid

SCHEMA = "pmg.analysis/1"
FOLDER = "analysis"
SUMMARY = "analysis.json"
TABLES = (
    "grid",
    "neutral_grid",
    "engaged_grid",
    "zero_checks",
    "losses",
    "means_by_load",
    "power_flow",
    "budget",
)
"""Tables of an analysis, each as CSV and as Parquet."""


def _write_frame(frame: pd.DataFrame, stem: Path) -> str:
    """The frame as CSV and as Parquet; returns the hash of the latter."""
    safe = frame.map(lambda cell: spreadsheet_text(cell) if isinstance(cell, str) else cell)
    write_atomic(stem.with_suffix(".csv"), safe.to_csv(index=False, lineterminator="\n").encode())
    columns = {name: _plain(frame[name]) for name in frame.columns}
    buffer = io.BytesIO()
    pl.DataFrame(columns).write_parquet(buffer, compression="zstd", statistics=False)
    write_atomic(stem.with_suffix(".parquet"), buffer.getvalue())
    return hashlib.sha256(buffer.getvalue()).hexdigest()


def _plain(column: pd.Series[Any]) -> list[Any]:
    return list(column.tolist())


def balance_frame(balance: PowerBalance) -> pd.DataFrame:
    """Losses and efficiencies by point: value, both parts of its standard uncertainty, the common one by cause too, SI.

    The columns of K_corr are empty where it was held.
    """
    at = balance.grid.points
    columns: dict[str, Any] = {"point": at.name, SPEED_SUN.display_name: SPEED_SUN.display(at.speed_sun)}
    columns |= {"load_set_Nm": at.load_set, "drive": at.drive}
    for signal in QUANTITIES:
        unit = "_W" if signal.unit == "W" else ""
        columns[signal.name + unit] = balance.values[signal.name]
        columns[f"u_{signal.name}{unit}"] = balance.independent[signal.name]
        columns[f"u_common_{signal.name}{unit}"] = balance.common[signal.name]
        for group in (TRANSDUCERS, CURVES, CORRECTION):
            known = group in balance.spread.groups
            part = balance.spread.part(signal.name, group) if known else np.full(len(at), np.nan)
            columns[f"u_{group}_{signal.name}{unit}"] = part
    return pd.DataFrame(columns | {"K_corr": np.full(len(at), _fitted(balance))})


def _means_frame(balance: PowerBalance) -> pd.DataFrame:
    """Means over the points of each load: the independent part falls with their number, the common one does not, SI."""
    rows = []
    for load, chosen in by_load(balance.grid.points):
        row: dict[str, Any] = {"load": load}
        for signal in AVERAGED:
            mean = balance.mean(signal.name, chosen)
            name = f"mean_{signal.name}" + ("_W" if signal.unit == "W" else "")
            row |= {
                "points": mean.points,
                name: mean.value,
                f"u_{name}": mean.independent,
                f"u_common_{name}": mean.common,
            }
        rows.append(row)
    return pd.DataFrame(rows)


def _fitted(balance: PowerBalance) -> str:
    return "fitted" if balance.correction_fitted else "held"


def _noise_document(noise: ShaftNoise) -> dict[str, Any]:
    return {
        "u_Nm": number(noise.u),
        "within_Nm": number(noise.within),
        "repeats_Nm": number(noise.repeats),
        "repeats_dof": noise.repeats_dof,
        "unstructured_Nm": number(noise.unstructured),
        "correlation": noise.correlation,
        "at_rest_Nm": number(noise.at(0.0)),
        "at_highest_speed_Nm": number(noise.at(noise.growth.fastest)),
        "source": noise.source,
    }


def _calibration_document(calibration: FittedBaseline, causes: CommonErrorSources | None) -> dict[str, Any]:
    errors = causes.standard_errors() if causes is not None else {}
    return {
        "constants": {
            name: {
                "value": calibration.value(name),
                "standard_error": calibration.standard_error(name),
                "u_scatter": errors[name][0] if name in errors else None,
                "u_transducers": errors[name][1] if name in errors else None,
                "free": name in calibration.names,
                "on_bound": name in calibration.on_bound,
            }
            for name in ("K_corr", "b", "c", "d")
        },
        "method": str(calibration.method),
        "readings_left_out": calibration.left_out,
        "chi_square": calibration.chi_square,
        "degrees_of_freedom": calibration.dof,
        "stopped": calibration.message,
    }


def analysis_document(analysis: Analysis, budget: Budget | None = None) -> dict[str, Any]:
    """The analysis as JSON, with the budget of the mean torques where it is given."""
    grid = analysis.grid
    at = grid.points
    document = {
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
        "calibration": None
        if analysis.calibration is None
        else _calibration_document(analysis.calibration, analysis.causes),
        "correction_by_rule": number(analysis.rule_correction),
        "damping": [damping_document(fit) for fit in analysis.damping],
        "means_by_load": None if analysis.balance is None else _means_frame(analysis.balance).to_dict("records"),
        **further_document(analysis),
        "budget": None if budget is None else budget_document(budget),
    }
    return document | {"without_uncertainty": unstated_in(document)}


def write_analysis(analysis: Analysis, store: Path, bench: BenchParameters, budget: Budget | None = None) -> Path:
    """Write grids, losses and fits into the store; returns the folder.

    ``bench`` is the machine of the power flow; ``budget`` holds what each mean torque is uncertain by, where given.
    ``losses``, ``means_by_load`` and ``power_flow`` hold what is derived, each with both parts of its uncertainty.
    ``grid`` holds every point, ``neutral_grid``, ``engaged_grid`` and ``zero_checks`` those of one configuration.
    The summary is written last: where it is there, the rest is.
    """
    folder = store / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    frame = grid_frame(analysis.grid)
    stamp = _write_frame(frame, folder / "grid")
    for configuration, name in (("neutral", "neutral_grid"), ("engaged", "engaged_grid"), ("zero", "zero_checks")):
        _write_frame(frame[frame.configuration == configuration], folder / name)
    tables = {"grid": frame} | _loss_tables(analysis, folder, bench)
    if budget is not None:
        tables["budget"] = budget_frame(budget)
        _write_frame(tables["budget"], folder / "budget")
    columns = {f"{name}.csv": unstated_columns(table) for name, table in tables.items()}
    document = analysis_document(analysis, budget) | {"columns_without_uncertainty": columns, "grid_sha256": stamp}
    write_atomic(folder / SUMMARY, proven_json(document))
    return folder


def analysis_files(folder: Path) -> tuple[Path, ...]:
    """Files that `write_analysis` left in its folder; those of others are not among them."""
    tables = (folder / f"{name}{suffix}" for name in TABLES for suffix in (".csv", ".parquet"))
    return tuple(path for path in (*tables, folder / "power_flow.json", folder / SUMMARY) if path.is_file())


def analysed_campaign(store: Path) -> str | None:
    """Name of the campaign whose analysis a store holds; None where there is none that can be read."""
    try:
        document = read_json(store / FOLDER / SUMMARY)
    except (OSError, ValueError):
        return None
    name = document.get("campaign") if isinstance(document, dict) else None
    return name if isinstance(name, str) else None


def unproven_analysis(store: Path) -> tuple[Remark, ...]:
    """A warning where the analysis in a store holds no hash of its own bytes: nobody can tell whether it changed."""
    summary = store / FOLDER / SUMMARY
    try:
        document = read_json(summary)
    except (OSError, ValueError):
        return ()
    if not isinstance(document, dict) or PROOF in document:
        return ()
    message = "the analysis is unproven: it holds no hash of its own bytes; expected one, as pmg writes it. "
    return (Remark("warning", str(summary), message + "Run 'pmg analyse' again."),)


def _loss_tables(analysis: Analysis, folder: Path, bench: BenchParameters) -> dict[str, pd.DataFrame]:
    """Losses, their means and the power flow, written; where there are none, those of an earlier run go."""
    tables: dict[str, pd.DataFrame] = {}
    if analysis.balance is not None:
        tables |= {"losses": balance_frame(analysis.balance), "means_by_load": _means_frame(analysis.balance)}
    if analysis.calibration is not None and analysis.causes is not None:
        gearbox = Gearbox.calibrated(bench, analysis.calibration.model)
        simulated = steady(gearbox, analysis.grid.points, analysis.grid.campaign)
        flows = power_flows(gearbox, analysis.grid, simulated, bench, analysis.calibration, analysis.causes)
        tables["power_flow"] = flow_frame(flows)
        text = json.dumps(flow_document(flows), allow_nan=False) + "\n"
        write_atomic(folder / "power_flow.json", text.encode())
    for name in ("losses", "means_by_load", "power_flow"):
        if name in tables:
            _write_frame(tables[name], folder / name)
        else:
            for suffix in (".csv", ".parquet", ".json"):
                (folder / name).with_suffix(suffix).unlink(missing_ok=True)
    return tables


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
        refuse_recordings(store)
        if not store.exists():
            Store(store).require()
        if (store / MARK).is_file() and only_in_motion(m for m in Store(store).manifests() if m.ingested):
            do = "Record steady points for this; 'pmg compare' diagnoses the runs in motion without them."
            raise StoreError(str(store), "runs in motion alone", "an analysis of steady points", do)
        do = "Run 'pmg analyse' on this store first."
        raise StoreError(str(store), "no analysis in it", f"{FOLDER}/{SUMMARY}", do)
    try:
        document = read_proven_json(summary)
        if document["schema"] != SCHEMA:
            raise StoreError(str(summary), f"schema {document['schema']}", SCHEMA, "Run 'pmg analyse' again.")
        options = AnalysisOptions.from_document(document["options"])
        data = (folder / "grid.parquet").read_bytes()
        note_read(folder / "grid.parquet", data)
        if hashlib.sha256(data).hexdigest() != document["grid_sha256"]:
            raise StoreError(str(folder), "grid and summary of different runs", "one run's", "Run 'pmg analyse' again.")
        columns = pl.read_parquet(io.BytesIO(data))
        frame = pd.DataFrame({name: columns[name].to_list() for name in columns.columns})
        return frame_grid(frame, document["origin"], document["campaign"]), options
    except (ValueError, KeyError, TypeError, OSError, pl.exceptions.PolarsError) as error:
        raise StoreError(
            str(folder), f"unreadable ({type(error).__name__}: {error})", "what 'pmg analyse' wrote", "Run it again."
        ) from error
