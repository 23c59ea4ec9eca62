"""The way of the tutorial from Python: recordings in, tables, a diagnosis and figures out; no folder is written.

Run it from the clone: ``.venv/bin/python raw/example/from_python.py``. It takes about a minute.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pmg.pipeline import analyse, compare, diagnose, ingest, read_recording

if TYPE_CHECKING:
    from pmg.pipeline.commands.notebook_results import CampaignDiagnosis

HERE = Path(__file__).resolve().parent


def main(recordings: Path = HERE) -> CampaignDiagnosis:
    """The diagnosis of a folder of recordings.

    Parameters
    ----------
    recordings : Path
        Folder of recordings.
    """
    # One recording: samples as a polars frame (torque [N m], angle [rad]), and what is wrong with it.
    recording = read_recording(sorted(recordings.glob("*.mcap"))[0])
    print(recording.samples.head(3), recording.findings)

    # A campaign: means of all windows, loss curves, K_corr and damping constants.
    campaign = analyse(ingest(recordings), terms_sun="0,1/2,1")
    grid = campaign.grid.to_pandas()
    print(grid.groupby("configuration")["torque_ring_Nm"].describe())
    print("K_corr and its standard uncertainty:", campaign.constants["K_corr"])

    # Beside its simulation, and what the simulation leaves out.
    comparison = compare(campaign)
    print(comparison.residuals.to_polars().head(3))
    diagnosis = diagnose(comparison)
    for cause in diagnosis.mechanisms:
        print(cause["title"], cause["shaft"], cause["parameters"])

    # Figures are PNG bytes: IPython.display.Image(diagnosis.figure(name)) shows one in a notebook.
    name = next(iter(diagnosis.figures))
    print(name, len(diagnosis.figure(name)), "bytes:", diagnosis.figures[name])
    # write_report(diagnosis, "report") would write the page, its tables and model.toml.
    return diagnosis


if __name__ == "__main__":
    print(main().statement)
