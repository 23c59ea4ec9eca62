"""The sheet on top of a page: answers lead to their grounds, marks are words, the picture is one of the report."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pmg.pipeline.chapters.bench_parts import CHAIN, asked_of, parts_of, surely_differs
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.report.action_sheet import MARKS, ActionSheet, MachinePart, SheetAnswer
from pmg.pipeline.report.document import Figure, Headline
from pmg.pipeline.report.html import html
from pmg.sim.mechanisms.base import Component

from . import example
from .test_page import HOSTILE, Outline

PICTURE = Figure("picture", "Before and after", "The cause takes most of it.", (example.chart(),), narrow=True)


def sheet() -> ActionSheet:
    """A sheet with a mark and a picture."""
    answers = (
        SheetAnswer("Cause", ("A drag that grows with speed.", "Fitted: 3 mN m."), "findings"),
        SheetAnswer("Do", ("Run `pmg compare`.",)),
    )
    return ActionSheet(answers, (MachinePart("bearings", "sun"), MachinePart("gear", mark="cause")), PICTURE)


def test_it_stands_in_place_of_the_words_of_the_verdict() -> None:
    made = replace(example.report(), sheet=sheet())
    page = html(made)
    assert "A drag that grows with speed is missing." not in page
    assert "A drag that grows with speed. Fitted: 3 mN m." in page
    assert "<code>pmg compare</code>" in page
    assert 'href="#findings" aria-label="Evidence: Cause"' in page
    assert page.count('class="grounds"') == 1
    assert page.index('id="picture"') < page.index('id="findings"')
    assert made.figures[0] is PICTURE
    assert "A drag that grows with speed is missing." in html(example.report())


def test_a_mark_is_a_word_too() -> None:
    page = html(replace(example.report(), sheet=sheet()))
    assert f'class="mark">{MARKS["cause"]}<' in page
    assert page.count('class="mark"') == 1


def test_the_word_above_a_verdict_says_what_it_asks_for() -> None:
    """Each kind of work has its word; a cause that lies in the physics alone is no matter of the bench."""
    words = [asked_of(verdict) for verdict in Verdict]
    assert len(set(words)) == len(Verdict)
    assert surely_differs(Verdict.NAMED, 0.001) == ""
    differs = surely_differs(Verdict.AMBIGUOUS, 0.000999)
    assert differs == "Chance makes such a difference in at most 0.1% of campaigns; which cause makes it stays open."
    assert asked_of(Verdict.NAMED) == "Use the extended model"
    assert asked_of(Verdict.NAMED, repair=True) == "Act on the bench"
    assert asked_of(Verdict.AMBIGUOUS, test=False) == asked_of(Verdict.NOT_IN_LIBRARY, test=False)
    page = html(replace(example.report(), verdict=Headline("It is so.", "attention", asks=asked_of(Verdict.AMBIGUOUS))))
    assert '<p class="state">Test again</p>' in page
    assert "Needs attention" not in page


def test_hostile_text_stays_text() -> None:
    hostile = ActionSheet((SheetAnswer(HOSTILE, (HOSTILE,)),), (MachinePart(HOSTILE, HOSTILE, "seen"),))
    outline = Outline(html(replace(example.report(), sheet=hostile)))
    assert "img" not in outline.tags
    assert outline.text.count(HOSTILE) == 4


def test_an_answer_without_its_grounds_is_refused() -> None:
    lost = replace(sheet(), answers=(SheetAnswer("Cause", ("A drag.",), "nowhere"),))
    with pytest.raises(ValueError, match="nowhere"):
        replace(example.report(), sheet=lost)


def test_a_narrow_figure_is_narrower_with_letters_as_large() -> None:
    wide, narrow = (
        html(replace(example.report(), sheet=replace(sheet(), figure=f)))
        for f in (replace(PICTURE, narrow=False), PICTURE)
    )

    def size(page: str) -> tuple[float, float]:
        drawn = page[page.index('id="picture"') :]
        _, _, width, height = drawn[drawn.index('viewBox="') + 9 :].split('"')[0].split()
        return float(width), float(height)

    assert size(narrow)[0] < 0.6 * size(wide)[0]


def diagnosis(
    verdict: str, *mechanisms: tuple[str, str], place: str | None = None, signal: str = "torque_ring"
) -> dict[str, object]:
    """What of a diagnosis.json the drawing of the bench needs."""
    rows = [{"component": component, "shaft": shaft} for component, shaft in mechanisms]
    return {"verdict": verdict, "mechanisms": rows, "locations": [{"component": place, "signal": signal}]}


def marked(document: dict[str, object]) -> dict[str, set[str]]:
    """Components by their mark."""
    found: dict[str, set[str]] = {}
    for (component, _, _), part in zip(CHAIN, parts_of(document), strict=True):
        found.setdefault(part.mark, set()).add(str(component))
    return found


def test_every_component_stands_once_in_the_chain() -> None:
    assert sorted(component for component, _, _ in CHAIN) == sorted(Component)


def test_the_bench_marks_what_is_named_and_what_it_may_be() -> None:
    assert marked(diagnosis("named", ("magnetic_gear", "both")))["cause"] == {"magnetic_gear"}
    both = marked(diagnosis("named", ("sun_bearings", "both")))
    assert both["cause"] == {"sun_bearings", "ring_bearings"}
    either = marked(diagnosis("named", ("sun_torque_transducer", "either")))
    assert either["either"] == {"sun_torque_transducer", "ring_torque_transducer"}
    several = marked(diagnosis("ambiguous", ("sun_coupling", "sun"), ("ring_encoder", "ring")))
    assert several["possible"] == {"sun_coupling", "ring_encoder"}


def test_without_a_cause_the_bench_marks_the_place_if_it_is_known() -> None:
    assert marked(diagnosis("not_in_library", place="sun_bearings"))["seen"] == {"sun_bearings"}
    assert "read" not in marked(diagnosis("not_in_library", place="sun_bearings"))


def test_where_the_place_is_not_known_either_the_transducer_that_shows_it_is_marked() -> None:
    for side in ("sun", "ring"):
        found = marked(diagnosis("not_in_library", place=None, signal=f"torque_{side}"))
        assert found["read"] == {f"{side}_torque_transducer"}
        assert set(found) == {"read", ""}
    assert set(marked({"verdict": "consistent", "mechanisms": [], "locations": []})) == {""}
