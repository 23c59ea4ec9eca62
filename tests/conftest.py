from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import settings

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.files.threads import one_thread
from pmg.pipeline.report.draw import Drawings, draw_all
from pmg.pipeline.report.figure import Chart, Figure, Series
from pmg.pipeline.store.store import Store
from pmg.sim.bench import BenchParameters, load_bench

from .bench.kill import contents
from .recording.writer import Bench, write

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

ROOT = Path(__file__).resolve().parent.parent
FILES = 12
"""Files of `campaign`."""
LONGEST = (
    "test_tutorial.py",
    "balance/test_any_machine.py",
    "balance/test_own_machine.py",
    "cli/test_cli.py",
    "balance/test_machine.py",
    "simulate/test_simulate.py",
    "commands/test_commands.py",
    "balance/test_balance.py",
    "diagnosis/test_motion.py",
    "commands/test_notebook.py",
    "trials/test_trial.py",
    "recovery/test_naming.py",
    "recovery/test_planted.py",
    "motion/test_motion_report.py",
    "report/test_signals_live.py",
    "sim/dynamics/test_kernel.py",
    "commands/test_scale.py",
    "recovery/test_limits.py",
    "report/test_live.py",
    "test_processors.py",
)
"""Files of tests that take longest. They begin, so that at the end no core waits long for another."""

# How long an example takes says nothing about the code. The same state of the code always meets the same examples, so
# that a run that fails can be repeated; `--hypothesis-profile=search` draws new ones.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("same")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One more than there are cores: a test that waits for a browser or for another process keeps none busy."""
    return (os.cpu_count() or 1) + 1


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of `LONGEST` first; all others keep their order."""
    place = {ROOT / "tests" / name: count for count, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path, len(LONGEST)))


@pytest.fixture(scope="session", autouse=True)
def one_thread_for_linear_algebra() -> Iterator[None]:
    """Parts of pmg are called as its commands call them."""
    with one_thread():
        yield


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def bench() -> BenchParameters:
    return load_bench()


@pytest.fixture(scope="session")
def published_folder() -> Path:
    return ROOT / "raw" / "published"


@pytest.fixture(scope="session")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dozen runs and a file that is none."""
    folder = tmp_path_factory.mktemp("campaign")
    for number in range(FILES - 1):
        write(folder / f"{number:02}.mcap", Bench(torque={"sun": 0.1 * number, "ring": 1.5}))
    (folder / "notes.mcap").write_text("not a recording")
    return folder


@pytest.fixture(scope="session")
def any_drawing() -> Drawings:
    """A small chart, drawn in every way."""
    line = np.arange(2.0)
    return draw_all([Figure("any", "Any", "Any.", (Chart("x", "y", (Series("a", line, line),)),))])


@pytest.fixture(scope="module")
def undrawn(any_drawing: Drawings) -> Iterator[None]:
    """Reports show the same small chart for every figure: for modules that look at anything but drawings."""
    ((_, png), (_, svg)), (inline,) = any_drawing.files.items(), any_drawing.inline.values()
    (live,) = any_drawing.live.values()

    def stand_in(figures: Sequence[Figure]) -> Drawings:
        files = {figure.file: png for figure in figures} | {figure.vector_file: svg for figure in figures}
        return Drawings(files, {figure.id: inline for figure in figures}, {figure.id: live for figure in figures})

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pmg.pipeline.report.write.draw_all", stand_in)
        yield


@pytest.fixture(scope="session")
def whole(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Files of the store that one undisturbed process makes."""
    store = Store(tmp_path_factory.mktemp("whole") / "s")
    ingest(campaign, store, workers=1)
    return contents(store.path)
