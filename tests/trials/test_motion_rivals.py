"""Other methods on a concealed campaign in motion: what they are given, and what they say of a large effect."""

from __future__ import annotations

import numpy as np
import pytest
from tests.bench.bout import BESIDE, PHYSICAL, Reply
from tests.bench.motion_bout import MotionBout, enter_in_motion
from tests.bench.motion_contestants import LadderOfLibrary, LatentForce
from tests.bench.rivals import OF_TRACK, chosen, track_of
from tests.slow import SLOW

from pmg.pipeline.diagnosis.engine.withheld import FOLDS
from pmg.pipeline.trials.motion.strata import motion_strata
from pmg.pipeline.trials.score.case_list import SEED, MotionLot, draw_motion_lots

LARGE = "load_dependent_bearing_friction sun 8"


@pytest.fixture(scope="module")
def bout() -> MotionBout:
    """A campaign with much friction that grows with the load of the sun; it takes half a minute of two cores."""
    if not SLOW:
        pytest.skip("the other methods belong to './pmgw bench rivals'; PMG_SLOW=1 tries them here")
    found = enter_in_motion(MotionLot(0, next(s for s in motion_strata() if s.name == LARGE), SEED))
    assert found is not None
    return found


def test_the_ladder_and_the_latent_force_see_a_large_effect(bout: MotionBout) -> None:
    ladder, latent = LadderOfLibrary()(bout, withheld=False), LatentForce()(bout, withheld=False)
    assert ladder.settings["BIC"] == Reply(True, ("load_dependent_bearing_friction", "sun"), None)
    assert ladder.remarks["rungs"][0] == "load_dependent_bearing_friction"
    assert latent.settings["BIC"].alarm
    assert not latent.above(latent.level).alarm


def test_noise_alone_holds_no_latent_force(bout: MotionBout) -> None:
    rng = np.random.default_rng(4)
    noise = tuple(rng.standard_normal(len(trace)) for trace in bout.traces)
    assert not LatentForce()(MotionBout(bout.found, noise, bout.row_rate), withheld=False).settings["BIC"].alarm


def test_runs_are_withheld_whole_and_the_data_sheet_never(bout: MotionBout) -> None:
    names = [stretch.run.run.name for stretch in bout.found.baseline.stretches]
    for name in set(names):
        places = [place for place, each in enumerate(names) if each == name]
        assert len(set(bout.fold[np.isin(bout.found.block, places)])) == 1
    assert set(bout.fold[bout.found.of_sheet]) == {FOLDS}
    assert set(range(FOLDS)) < set(bout.fold)


def test_columns_are_of_unit_size_and_the_baseline_takes_up_none_of_what_it_was_taken_out_of(bout: MotionBout) -> None:
    every = np.ones(len(bout.fold), dtype=np.bool_)
    for kind in (PHYSICAL, BESIDE):
        library = bout.library(kind)
        columns = library.columns(bout, every)
        assert len(library.owners) == columns.shape[1]
        np.testing.assert_allclose(np.sqrt(np.mean(columns**2, axis=0)), 1.0, rtol=1e-6)
        taken_up = np.sqrt(np.mean((columns - bout.beside(columns, every)) ** 2, axis=0)).max()
        assert bool(taken_up < 1e-6) is (kind == BESIDE)


def test_the_campaigns_are_those_of_the_trial_in_motion() -> None:
    lots = chosen(12, SEED, 2, 3, track="motion")
    assert set(lots) <= set(draw_motion_lots(12, SEED))
    assert len(lots) == 5
    assert all(track_of(lot) is OF_TRACK["motion"] for lot in lots)
