"""The way from Python: the same results as the commands, without a folder, and nothing heavy before it is used."""

from __future__ import annotations

import gc
import json
import runpy
import shutil
import subprocess
import sys
from html import unescape
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.bench.help import HEAVY
from tests.conftest import ROOT

from pmg.pipeline import analyse, compare, ingest, write_report
from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.compare import run_compare
from pmg.pipeline.commands.notebook_results import CampaignDiagnosis, IngestedCampaigns
from pmg.pipeline.diagnosis.grid.statement import PHRASES
from pmg.pipeline.fit.options import chosen_options
from pmg.sim.errors import FitError, RecordingError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.commands.outcome import Outcome

pytestmark = pytest.mark.usefixtures("undrawn")

EXAMPLE = ROOT / "raw" / "example"


@pytest.fixture(scope="module")
def diagnosis(tmp_path_factory: pytest.TempPathFactory) -> CampaignDiagnosis:
    """What the script that ships makes of every second recording of the example."""
    folder = tmp_path_factory.mktemp("recordings")
    for path in sorted(EXAMPLE.glob("*.mcap"))[::2]:
        shutil.copy(path, folder)
    found = runpy.run_path(str(EXAMPLE / "from_python.py"))["main"](folder)
    assert isinstance(found, CampaignDiagnosis)
    return found


@pytest.fixture(scope="module")
def compared(diagnosis: CampaignDiagnosis, tmp_path_factory: pytest.TempPathFactory) -> tuple[Outcome, Path]:
    """What the commands say of the same store, and their report."""
    folder = tmp_path_factory.mktemp("commanded")
    ingested = diagnosis.analysis.kept
    assert isinstance(ingested, IngestedCampaigns)
    options = chosen_options(published=False, terms_sun="0,1/2,1")
    run_analyse(ingested.store, options, grids=None, campaign=None)
    return run_compare(ingested.store, folder), folder


@pytest.fixture(scope="module")
def commanded(compared: tuple[Outcome, Path]) -> tuple[dict[str, Any], Path]:
    """Data of those commands, and their report."""
    outcome, folder = compared
    return outcome.data, folder


def test_the_verdict_is_the_same_in_report_chapter_document_and_terminal(compared: tuple[Outcome, Path]) -> None:
    outcome, folder = compared
    document = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    phrase, said = document["phrase"], document["statement"]
    assert (phrase, outcome.lines[0]) == ("cause named", f"cause named: {said}")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "<code>pmg compare --model model.toml</code>" in page
    page = unescape(page.replace("<code>", "`").replace("</code>", "`"))
    first, chapter = page.split('<section aria-labelledby="diagnosis">')
    assert said in chapter
    for part in (first.lower(), chapter):
        assert phrase in part
        assert not [other for other in PHRASES.values() if other != phrase and other in part]


def test_the_diagnosis_is_that_of_the_commands(
    diagnosis: CampaignDiagnosis, commanded: tuple[dict[str, Any], Path]
) -> None:
    data, folder = commanded
    assert json.loads(json.dumps(diagnosis.to_dict())) == data["diagnosis"]
    assert diagnosis.statement == data["statement"]
    assert str(diagnosis.verdict) == data["diagnosis"]["verdict"] == "named"
    assert diagnosis.model == (folder / "model.toml").read_text(encoding="utf-8")


def test_tables_come_in_pandas_and_polars(diagnosis: CampaignDiagnosis) -> None:
    campaign = diagnosis.analysis
    losses = campaign.losses
    assert losses is not None
    residuals = compare(campaign).residuals
    for table in (campaign.grid, losses, residuals):
        plain, fast = table.to_pandas(), table.to_polars()
        assert list(plain.columns) == fast.columns
        assert len(plain) == fast.height == len(table) > 0
    grid = campaign.grid
    np.testing.assert_array_equal(
        grid.to_polars()["torque_sun_Nm"].to_numpy(), grid.to_pandas()["torque_sun_Nm"].to_numpy()
    )
    own = grid.to_pandas()
    own["torque_sun_Nm"] = 0.0
    assert grid.to_pandas()["torque_sun_Nm"].abs().max() > 0.01
    value, error = campaign.constants["K_corr"]
    assert 0.0 < value < 1.0
    assert error is not None
    assert error > 0.0


def test_figures_are_png_without_a_folder(diagnosis: CampaignDiagnosis) -> None:
    name = next(iter(diagnosis.figures))
    assert diagnosis.figure(name).startswith(b"\x89PNG\r\n")
    with pytest.raises(KeyError):
        diagnosis.figure("no-such-figure")


def test_the_report_holds_what_that_of_the_command_holds(
    diagnosis: CampaignDiagnosis, commanded: tuple[dict[str, Any], Path], tmp_path: Path
) -> None:
    page = write_report(diagnosis, tmp_path / "report")
    _, folder = commanded
    ours = {path.relative_to(page.parent).as_posix() for path in page.parent.rglob("*") if path.is_file()}
    theirs = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert theirs - ours == {"ro-crate-metadata.json"}
    assert ours <= theirs
    for name in ("diagnosis.json", "model.toml"):
        assert (page.parent / name).read_bytes() == (folder / name).read_bytes()


def test_a_temporary_store_goes_with_its_last_user(campaign: Path) -> None:
    found = ingest(campaign, workers=1)
    store = found.store
    assert store.is_dir()
    del found
    gc.collect()
    assert not store.exists()


def test_a_store_that_is_named_stays(campaign: Path, tmp_path: Path) -> None:
    found = ingest(campaign, tmp_path / "store", workers=1)
    assert found.windows > 0
    assert any(finding["severity"] == "error" for finding in found.findings)
    del found
    gc.collect()
    assert (tmp_path / "store").is_dir()


def test_published_grids_need_no_recordings(published_folder: Path) -> None:
    campaign = analyse(grids=published_folder)
    assert campaign.constants["K_corr"] == (0.8, None)


def test_wrong_calls_say_what_to_do(tmp_path: Path, published_folder: Path) -> None:
    with pytest.raises(FitError, match="neither of recordings and grids"):
        analyse()
    with pytest.raises(FitError, match="both of recordings and grids"):
        analyse(tmp_path, grids=published_folder)
    with pytest.raises(FitError, match="joint, rule"):
        analyse(grids=published_folder, k_corr="jiont")
    with pytest.raises(RecordingError):
        ingest(tmp_path / "nowhere")
    with pytest.raises(AttributeError, match="no attribute 'ingset'"):
        getattr(sys.modules["pmg.pipeline"], "ingset")  # noqa: B009 - the look-up is what is tried


FROM_NOTHING = """
import sys
for first in ("pass", "from pmg.pipeline.diagnosis.grid import decide", "import pmg.pipeline.diagnosis"):
    for name in [name for name in sys.modules if name.split(".")[0] == "pmg"]:
        del sys.modules[name]
    exec(first)
    from pmg.pipeline import diagnose
    print(diagnose.__module__)
"""
"""Program that begins without any module of pmg, thrice; other libraries stay loaded, as loading them takes seconds."""


def test_diagnose_is_the_function_whatever_was_loaded_before() -> None:
    done = subprocess.run([sys.executable, "-c", FROM_NOTHING], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["pmg.pipeline.commands.notebook"] * 3


def test_importing_the_package_loads_no_library_of_numbers() -> None:
    code = f"import sys, pmg.pipeline as p; dir(p); print([n for n in {HEAVY!r} if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
