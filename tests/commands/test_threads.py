"""Linear algebra keeps to one thread, in commands and in calls from Python, whatever the environment says."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from pmg.pipeline import analyse, ingest
from pmg.pipeline.commands import notebook
from pmg.sim.errors import GridError

if TYPE_CHECKING:
    from pathlib import Path

COMMAND = """
import sys
from pmg.pipeline.cli.app import main
try:
    main()
finally:
    import scipy.linalg
    from threadpoolctl import threadpool_info
    print(*(each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"))
"""


def threads() -> set[int]:
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


def test_a_command_computes_on_one_thread() -> None:
    words = [sys.executable, "-c", COMMAND, "--version"]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    assert set(done.stdout.splitlines()[-1].split()) == {"1"}, done.stderr


def test_calls_from_python_do_and_leave_the_threads_of_their_caller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[set[int]] = []
    started: list[str] = []
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")

    def looked(*_: object) -> None:
        seen.append(threads())
        started.append(os.environ["OPENBLAS_NUM_THREADS"])
        raise GridError("here", "nothing", "threads", "None.")

    for name in ("run_ingest", "gather"):
        monkeypatch.setattr(notebook, name, looked)
    with threadpool_limits(limits=2, user_api="blas"):
        before = threads()
        for called in (ingest, analyse):
            with pytest.raises(GridError):
                called(tmp_path)
        assert threads() == before
    assert seen == [{1}, {1}]
    assert started == ["1", "1"], "what processes that are started meanwhile read"
    assert os.environ["OPENBLAS_NUM_THREADS"] == "2"
