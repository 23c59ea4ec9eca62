"""The widths of a power flow add up, whatever its signs."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.report.document import PowerFlow
from pmg.pipeline.report.flow import balance

from . import example

WATTS = st.floats(-300, 300).map(lambda watts: round(watts, 2))


@st.composite
def flows(draw: st.DrawFn) -> PowerFlow:
    stages = draw(st.lists(WATTS, min_size=2, max_size=6))
    last = len(stages) - 2
    losses = draw(st.lists(st.tuples(st.just("loss"), WATTS, st.integers(0, last)), max_size=8))
    return PowerFlow("any", tuple((f"stage {index}", watts) for index, watts in enumerate(stages)), tuple(losses))


@given(flows())
def test_widths_add_up_at_every_place(flow: PowerFlow) -> None:
    drawn = balance(flow)
    assert len(drawn.trunk) == len(drawn.places) + 1
    for before, branch, after in zip(drawn.trunk, drawn.places, drawn.trunk[1:], strict=False):
        if branch is None:
            assert before == pytest.approx(after, abs=1e-6)
            continue
        assert min(branch.left, branch.right, branch.through) >= 0
        assert branch.left + branch.through == pytest.approx(abs(before), abs=1e-6)
        assert branch.right + branch.through == pytest.approx(abs(after), abs=1e-6)
        assert before - after == pytest.approx(branch.watts, abs=1e-6)
        assert branch.left + branch.right == pytest.approx(abs(branch.watts), abs=1e-6)


@given(flows())
def test_what_enters_equals_what_leaves(flow: PowerFlow) -> None:
    drawn = balance(flow)
    lost = sum(branch.watts for branch in drawn.places if branch)
    assert flow.main[0][1] - flow.main[-1][1] == pytest.approx(lost, abs=1e-6)


@given(flows())
def test_every_stage_stands_where_its_power_flows(flow: PowerFlow) -> None:
    drawn = balance(flow)
    assert [(label, watts) for label, watts, _ in drawn.stages] == list(flow.main)
    assert [drawn.trunk[stretch] for _, _, stretch in drawn.stages] == [watts for _, watts in flow.main]


@given(flows())
def test_a_mirrored_flow_has_mirrored_widths(flow: PowerFlow) -> None:
    last = len(flow.main) - 2
    mirrored = PowerFlow(
        flow.title,
        tuple((label, -watts) for label, watts in reversed(flow.main)),
        tuple((label, watts, last - after) for label, watts, after in reversed(flow.losses)),
    )
    there, back = balance(flow), balance(mirrored)
    assert back.supply == pytest.approx(there.supply)
    assert sorted(branch.watts for branch in back.places if branch) == pytest.approx(
        sorted(branch.watts for branch in there.places if branch), abs=1e-6
    )


def test_a_closed_balance_gets_no_unexplained_branch() -> None:
    drawn = balance(example.power_flow())
    assert [branch.label for branch in drawn.places if branch] == [
        "Sun motor",
        "Sun bearings",
        "Magnetic gear",
        "Ring bearings",
        "Ring motor",
    ]
    assert drawn.supply == 198.7
    assert drawn.share(134.58) == pytest.approx(0.6773, abs=1e-4)


def test_an_open_balance_is_closed_by_name() -> None:
    drawn = balance(PowerFlow("", (("in", 10.0), ("out", 7.0)), (("bearings", 2.0, 0),)))
    remainder = drawn.places[-1]
    assert remainder is not None
    assert (remainder.label, remainder.unexplained, remainder.gain) == ("Unexplained", True, False)
    assert remainder.watts == pytest.approx(1.0)


def test_a_negative_loss_enters_in_full() -> None:
    (gain,) = balance(PowerFlow("", (("in", 10.0), ("out", 12.0)), (("zero offset", -2.0, 0),))).places
    assert gain is not None
    assert gain.gain
    assert (gain.left, gain.right, gain.through) == (0.0, 2.0, 10.0)


def test_both_sides_feed_a_loss_between_them() -> None:
    drawn = balance(PowerFlow("", (("sun", 5.0), ("ring", -3.0)), (("bearings", 8.0, 0),)))
    (loss,) = drawn.places
    assert loss is not None
    assert (loss.left, loss.right, loss.through) == (5.0, 3.0, 0.0)
    assert drawn.supply == 8.0


@pytest.mark.parametrize(
    ("main", "losses", "why"),
    [
        ((("in", 1.0),), (), "at least two"),
        ((("in", 1.0), ("out", 1.0)), (("x", 0.0, 1),), "between two stages"),
        ((("in", 1.0), ("out", float("nan"))), (), "finite"),
    ],
)
def test_a_flow_that_cannot_be_drawn_is_refused(
    main: tuple[tuple[str, float], ...], losses: tuple[tuple[str, float, int], ...], why: str
) -> None:
    with pytest.raises(ValueError, match=why):
        PowerFlow("flow", main, losses)
