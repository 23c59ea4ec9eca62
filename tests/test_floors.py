"""The house: rooms on floors, imports that only go down, and what each function, class and constant may be.

Lazy imports and imports for type checkers count like any other. The planted faults show that every rule can fail.
"""

from __future__ import annotations

from collections import defaultdict
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING

import pytest

from tests.house import FLOORS, FOLDERS, MODULES, Breach, Module, floor_of, imported_modules, room_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

MOST_IN_A_FOLDER = 25
DOORS = ("pmg.pipeline", "pmg.pipeline.__main__")
"""Modules that may lie loose in ``pipeline``."""


# --- the rules -----------------------------------------------------------------------------------------


def imports_go_down(modules: Sequence[Module]) -> Iterator[Breach]:
    names = frozenset(module.name for module in modules)
    for module in modules:
        here = room_of(module.name)
        for target, line in imported_modules(module, names).items():
            there = room_of(target)
            if here == there and target != "pmg.pipeline":
                continue
            high, low = floor_of(here), floor_of(there)
            if target == "pmg.pipeline" or high is None or low is None or low >= high:
                rule = "a room imports only from floors below"
                yield Breach(module.name, line, f"{here} (floor {high}) imports {target} (floor {low})", rule)


def every_room_has_a_floor(modules: Sequence[Module]) -> Iterator[Breach]:
    for module in modules:
        if floor_of(room_of(module.name)) is None:
            yield Breach(module.name, 1, f"{room_of(module.name)} stands on no floor", "FLOORS names every room")


def no_circles(modules: Sequence[Module]) -> Iterator[Breach]:
    names = frozenset(module.name for module in modules)
    graph = {module.name: set(imported_modules(module, names)) - packages(modules) for module in modules}
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        circle = error.args[1]
        yield Breach(circle[0], 1, " <- ".join(circle), "modules import one another in no circle")


def packages(modules: Sequence[Module]) -> set[str]:
    """Names of packages: what a module imports from one is its `__init__`, which every part loads first anyway."""
    names = {module.name for module in modules}
    return {name for name in names if any(other.startswith(f"{name}.") for other in names)}


def no_loose_modules(modules: Sequence[Module]) -> Iterator[Breach]:
    held = packages(modules)
    for module in modules:
        if module.name.rpartition(".")[0] == "pmg.pipeline" and module.name not in {*held, *DOORS}:
            yield Breach(module.name, 1, "lies loose in pipeline", "every module lies in a room")


def folders_stay_small(modules: Sequence[Module]) -> Iterator[Breach]:
    held = packages(modules)
    count: dict[str, int] = defaultdict(int)
    for module in modules:
        if module.name not in held:
            count[module.name.rpartition(".")[0]] += 1
    for folder, number in count.items():
        if number > MOST_IN_A_FOLDER:
            yield Breach(folder, 1, f"{number} modules", f"at most {MOST_IN_A_FOLDER} modules in a folder")


RULES: tuple[Callable[[Sequence[Module]], Iterator[Breach]], ...] = (
    imports_go_down,
    every_room_has_a_floor,
    no_circles,
    no_loose_modules,
    folders_stay_small,
)


# --- the tests -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_house_keeps_the_rule(rule: Callable[[Sequence[Module]], Iterator[Breach]]) -> None:
    breaches = [str(breach) for breach in rule(MODULES)]
    assert not breaches, "\n" + "\n".join(breaches)


def test_the_floors_are_twelve_and_name_only_rooms_that_exist() -> None:
    assert len(FLOORS) <= 12
    rooms = [room for floor in FLOORS for room in floor]
    assert len(set(rooms)) == len(rooms)
    assert set(rooms) == {room_of(module.name) for module in MODULES}
    assert all((FOLDERS["pmg.sim"].parent / room.replace(".", "/") / "__init__.py").is_file() for room in rooms)


def _lines(name: str, text: str) -> Module:
    return Module(name, text)


PLANTED: tuple[tuple[Callable[[Sequence[Module]], Iterator[Breach]], str, tuple[Module, ...]], ...] = (
    (
        imports_go_down,
        "an import up",
        (
            _lines("pmg.pipeline.fit.noise", "from pmg.pipeline.diagnose.engine.scan import scan"),
            _lines("pmg.pipeline.diagnose.engine.scan", ""),
        ),
    ),
    (
        imports_go_down,
        "a lazy import across the floor",
        (
            _lines("pmg.pipeline.grid.levels", "def f():\n    from pmg.pipeline.orders.lines import g"),
            _lines("pmg.pipeline.orders.lines", ""),
        ),
    ),
    (
        imports_go_down,
        "an import for type checkers",
        (
            _lines(
                "pmg.sim.steady.solve",
                "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pmg.sim.dynamics.trace import Trace",
            ),
            _lines("pmg.sim.dynamics.trace", ""),
        ),
    ),
    (
        imports_go_down,
        "an import of the door",
        (_lines("pmg.pipeline.cli.app", "from pmg.pipeline import ingest"), _lines("pmg.pipeline", "")),
    ),
    (every_room_has_a_floor, "a room that is not in the table", (_lines("pmg.pipeline.attic.box", ""),)),
    (
        no_circles,
        "a circle through a lazy import",
        (
            _lines("pmg.sim.roots", "from pmg.sim.grid import a"),
            _lines("pmg.sim.grid", "def f():\n    from pmg.sim.roots import b"),
        ),
    ),
    (no_loose_modules, "a loose module", (_lines("pmg.pipeline", ""), _lines("pmg.pipeline.loose", ""))),
    (
        folders_stay_small,
        "a folder with too many modules",
        (_lines("pmg.pipeline.fit", ""), *(_lines(f"pmg.pipeline.fit.m{i}", "") for i in range(MOST_IN_A_FOLDER + 1))),
    ),
)


@pytest.mark.parametrize(("rule", "fault", "modules"), PLANTED, ids=[fault for _, fault, _ in PLANTED])
def test_a_planted_fault_is_found(
    rule: Callable[[Sequence[Module]], Iterator[Breach]], fault: str, modules: tuple[Module, ...]
) -> None:
    found = list(rule(modules))
    assert found, f"{rule.__name__} lets pass: {fault}"
    assert "; rule: " in str(found[0])


def test_sound_modules_raise_no_alarm() -> None:
    sound = (
        Module("pmg.pipeline", ""),
        Module("pmg.pipeline.__main__", "from pmg.pipeline.cli.app import main"),
        Module("pmg.pipeline.cli", ""),
        Module("pmg.pipeline.cli.app", "from pmg.sim import signals\nfrom pmg.sim.roots import a"),
        Module("pmg.sim", ""),
        Module("pmg.sim.signals", ""),
        Module("pmg.sim.roots", "from pmg.sim.signals import Array"),
    )
    assert [str(breach) for rule in RULES for breach in rule(sound)] == []
