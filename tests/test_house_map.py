"""The drawn map is that of the code: picture, table of rooms and lists of modules, and it sees what changes."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import pytest

from tests.house import FLOORS, MODULES, ROOT, Module
from tests.house_map import (
    BEGIN,
    BOX_WIDTH,
    END,
    PAGE,
    PICTURE,
    WIDTH,
    Room,
    drawn,
    laid_out,
    picture,
    room_list,
    rooms_of,
    stale,
    with_map,
    without_shortcuts,
)

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def rooms() -> dict[str, Room]:
    return rooms_of(MODULES)


def test_the_map_is_that_of_the_code() -> None:
    assert stale(MODULES, ROOT) == [], "the code has changed since the map was drawn: run ./pmgw map and commit it"


def test_the_map_names_every_room_and_every_module(rooms: dict[str, Room]) -> None:
    pages = drawn(MODULES, ROOT)
    assert {f"pmg.{name}" for name in rooms} == {f"pmg.{name}" for floor in FLOORS for name in floor}
    for room in rooms.values():
        assert f"[{room.title}](" in pages[PAGE]
        for module in room.modules:
            if module.name.startswith(f"pmg.{room.name}."):
                assert f"`{module.name.removeprefix(f'pmg.{room.name}.').replace('.', '/')}" in pages[room.readme]


def test_every_module_says_what_it_is_in_its_first_line(rooms: dict[str, Room]) -> None:
    empty = [line for room in rooms.values() for line in room_list(room, rooms).splitlines() if line.endswith("|  |")]
    assert empty == []


def test_the_picture_is_drawn_inside_its_frame_without_boxes_over_each_other(rooms: dict[str, Room]) -> None:
    layout = laid_out(rooms)
    for row in layout.rows:
        middles = sorted(layout.x[name] for name in row if name in rooms)
        assert all(right - left > BOX_WIDTH for left, right in pairwise(middles))
        assert all(BOX_WIDTH / 2 <= x <= WIDTH - BOX_WIDTH / 2 for x in middles)
    root = ElementTree.fromstring(picture(rooms))
    assert root.attrib["width"] == str(WIDTH)
    texts = {"".join(text.itertext()) for text in root.iter("{http://www.w3.org/2000/svg}text")}
    assert {room.title.removeprefix("pipeline/") for room in rooms.values()} <= texts


def test_every_arrow_goes_down(rooms: dict[str, Room]) -> None:
    for high, *_, low in laid_out(rooms).paths:
        assert rooms[high].floor > rooms[low].floor


def test_arrows_that_others_imply_are_left_out_and_no_other() -> None:
    imports = {"a": frozenset("bcd"), "b": frozenset("cd"), "c": frozenset("d"), "d": frozenset[str]()}
    assert without_shortcuts(imports) == {
        "a": frozenset("b"),
        "b": frozenset("c"),
        "c": frozenset("d"),
        "d": frozenset(),
    }
    split = {"a": frozenset("bc"), "b": frozenset("d"), "c": frozenset("d"), "d": frozenset[str]()}
    assert without_shortcuts(split) == split


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A root whose map is up to date."""
    for place, text in drawn(MODULES, tmp_path).items():
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_text(text, encoding="utf-8")
    return tmp_path


def test_what_changes_is_seen(copy: Path) -> None:
    assert stale(MODULES, copy) == []
    more = Module("pmg.pipeline.orders.lines_of_a_new_kind", '"""Lines of a new kind."""\n')
    assert set(stale((*MODULES, more), copy)) == {PICTURE, PAGE, "pipeline/orders/README.md"}
    renamed = tuple(
        replace(module, source=re.sub(r'^"""', '"""Newly ', module.source)) if module.name == "pmg.sim.grid" else module
        for module in MODULES
    )
    assert stale(renamed, copy) == ["sim/README.md"]
    (copy / "pipeline/orders/README.md").unlink()
    assert stale(MODULES, copy) == ["pipeline/orders/README.md"]


def test_what_is_written_around_the_map_stays() -> None:
    page = f"before\n{BEGIN}\nold\n{END}\nafter\n"
    assert with_map(page, "new") == f"before\n{BEGIN}\nnew\n{END}\nafter\n"
    assert with_map("no marks", "new") is None
