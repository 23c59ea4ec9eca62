"""Tables as comma-separated text that a spreadsheet opens without running anything."""

from __future__ import annotations

import polars as pl

from pmg.pipeline.wording.safe_text import spreadsheet_text


def spreadsheet_csv(frame: pl.DataFrame) -> str:
    """The frame as comma-separated text, its text cells made safe as `spreadsheet_text` says."""
    texts = [name for name, kind in frame.schema.items() if kind == pl.String]
    safe = (pl.Series(name, [None if t is None else spreadsheet_text(t) for t in frame[name]]) for name in texts)
    return frame.with_columns(*safe).write_csv()
