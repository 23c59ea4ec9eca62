"""Remarks on the transducers of a campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.remark import Remark

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.grid.window_facts import WindowFacts
    from pmg.sim.bench import BenchParameters


def transducer_remarks(facts: WindowFacts, bench: BenchParameters) -> Iterator[Remark]:
    """Findings of a stage: transducers whose nominal torque is not that of the bench.

    Parameters
    ----------
    facts : WindowFacts
        With the nominal torques that the calibrations state [N m].
    bench : BenchParameters
        The machine's.
    """
    for side, shaft in facts.items():
        ours = float(bench.transducers[side].nominal_torque)
        others = np.unique(shaft.nominal[np.isfinite(shaft.nominal) & (shaft.nominal != ours)])
        if len(others):
            count = int(np.isin(shaft.nominal, others).sum())
            message = (
                f"the calibration of {count} of {len(shaft.nominal)} windows states a nominal torque of "
                f"{' and '.join(f'{value:g}' for value in others)} N m; expected {ours:g} N m of the machine "
                "(bench.toml, or the file of --machine). The non-linearity is reckoned from the calibration's, with "
                "the machine's tolerances; correct whichever is wrong."
            )
            yield Remark("warning", f"transducer of the {side}", message)
