"""Commands at the bench: the example."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli import checks
from pmg.pipeline.cli.frame import command
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.progress import Progress


@command("demo", example="demo")
def demo(
    store: Annotated[
        Path, typer.Option("--store", help="Keep decoded runs and results in this folder."), checks.FOLDER_OUT
    ] = Path("pmg-demo-store"),
    report: Annotated[
        Path, typer.Option("--report", help="Write the report to this folder."), checks.FOLDER_OUT
    ] = Path("pmg-demo"),
    progress: Progress | None = None,
) -> Outcome:
    """Run the example that ships with pmg. Its 288 recordings are synthetic, with one physical effect concealed."""
    from pmg.pipeline.commands.at_bench.demo import run_demo

    return run_demo(store, report, progress)
