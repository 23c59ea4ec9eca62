"""The house: rooms on floors, imports that only go down, and what each function, class and constant may be.

Lazy imports and imports for type checkers count like any other. The planted faults show that every rule can fail.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING

import pytest

from tests.house import FLOORS, FOLDERS, MODULES, Breach, Module, dotted, floor_of, imported_modules, room_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

MOST_IN_A_FOLDER = 25
DOORS = ("pmg.pipeline", "pmg.pipeline.__main__")
"""Modules that may lie loose in ``pipeline``."""

MOST_LINES = 60
"""Lines of a function, decorators and docstring aside."""

MOST_PARAMETERS = 8


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
    held = packages(modules)
    graph = {module.name: set(imported_modules(module, names)) - held for module in modules}
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        circle = error.args[1]
        yield Breach(circle[0], 1, " <- ".join(circle), "modules import one another in no circle")


def packages(modules: Sequence[Module]) -> set[str]:
    """Names of packages: what a module imports from one is its `__init__`, which every part loads first anyway."""
    names = {module.name for module in modules}
    return names & {name.rpartition(".")[0] for name in names}


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


def functions_of(node: ast.AST, within: str) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    """Functions and methods at any depth, by their full names."""
    for child in ast.iter_child_nodes(node):
        name = f"{within}.{child.name}" if isinstance(child, ast.FunctionDef | ast.ClassDef) else within
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            yield name, child
        yield from functions_of(child, name)


def lines_of(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines from ``def`` to the last one, without those of the docstring."""
    total = (function.end_lineno or function.lineno) - function.lineno + 1
    if ast.get_docstring(function, clean=False) is None:
        return total
    first = function.body[0]
    return total - ((first.end_lineno or first.lineno) - first.lineno + 1)


def parameters_of(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Parameters of a function; the object or class of a method does not count."""
    given = function.args
    named = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len(named) - (named[:1] in (["self"], ["cls"])) + (given.vararg is not None) + (given.kwarg is not None)


def functions_stay_small(modules: Sequence[Module]) -> Iterator[Breach]:
    rule = f"at most {MOST_LINES} lines and {MOST_PARAMETERS} parameters a function"
    for module in modules:
        for name, function in functions_of(module.tree, module.name):
            lines, parameters = lines_of(function), parameters_of(function)
            if lines > MOST_LINES or parameters > MOST_PARAMETERS:
                found = f"{name} has {lines} lines and {parameters} parameters"
                yield Breach(module.name, function.lineno, found, rule)


NAMED_TWICE = frozenset({"Column", "Text"})
"""Class names that still stand in two modules; none may join them."""


def a_class_name_is_used_once(modules: Sequence[Module]) -> Iterator[Breach]:
    first: dict[str, str] = {}
    for module in modules:
        for node in ast.walk(module.tree):
            if not isinstance(node, ast.ClassDef) or node.name in NAMED_TWICE:
                continue
            other = first.setdefault(node.name, module.name)
            if other != module.name:
                rule = "a class name is used once in the product"
                yield Breach(module.name, node.lineno, f"class {node.name}, which is one of {other} too", rule)


def a_constant_is_defined_once(modules: Sequence[Module]) -> Iterator[Breach]:
    first: dict[tuple[str, str], str] = {}
    for module in modules:
        for name, value, line in constants_of(module.tree):
            other = first.setdefault((name, value), module.name)
            if other != module.name:
                rule = "a constant is defined once: import it, or give another thing another name"
                yield Breach(module.name, line, f"{name} = {value}, as in {other}", rule)


def constants_of(tree: ast.Module) -> Iterator[tuple[str, str, int]]:
    """Name in capitals, value and line of each constant of a module; of several in one line each."""
    for node in tree.body:
        if isinstance(node, ast.Assign):
            target, value = node.targets[0], node.value
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            target, value = node.target, node.value
        else:
            continue
        pairs = [(target, value)]
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = list(zip(target.elts, value.elts, strict=True))
        for one, given in pairs:
            if isinstance(one, ast.Name) and one.id.isupper():
                yield one.id, ast.unparse(given), node.lineno


def root_of(node: ast.AST) -> str:
    """The name at which a chain of attributes, calls and subscripts begins."""
    while isinstance(node, ast.Attribute | ast.Subscript | ast.Call):
        node = node.func if isinstance(node, ast.Call) else node.value
    return node.id if isinstance(node, ast.Name) else ""


def key_of(node: ast.AST) -> str | None:
    """The text by which a subscript, or a call of ``get``, asks for a value."""
    if isinstance(node, ast.Subscript):
        key: ast.expr | None = node.slice
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "get":
        key = next(iter(node.args), None)
    else:
        return None
    return key.value if isinstance(key, ast.Constant) and isinstance(key.value, str) else None


def a_manifest_is_a_record(modules: Sequence[Module]) -> Iterator[Breach]:
    for module in modules:
        if room_of(module.name) == "pipeline.store":
            continue
        for node in ast.walk(module.tree):
            if (key := key_of(node)) is not None and root_of(node) in ("manifest", "m", "window", "w"):
                rule = "a manifest and its windows are records: no subscripts by key outside pipeline.store"
                yield Breach(module.name, getattr(node, "lineno", 1), f"{root_of(node)} is asked for {key!r}", rule)


Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def names_in(*nodes: ast.AST | None) -> set[str]:
    """Names that stand in these pieces of code."""
    return {one.id for node in nodes if node is not None for one in ast.walk(node) if isinstance(one, ast.Name)}


def used_elsewhere(modules: Sequence[Module]) -> set[str]:
    """Full names that modules import from others or ask of others, and whatever stands in a module read as text."""
    names = {module.name for module in modules}
    used: set[str] = set()
    for module in modules:
        targets = {one.target for one in module.imports if one.target.rpartition(".")[0] != module.name}
        used |= targets
        short = {target.rpartition(".")[2]: target for target in targets & names}
        for node in ast.walk(module.tree):
            if isinstance(node, ast.ImportFrom):
                whole = {one.asname: f"{node.module}.{one.name}" for one in node.names if one.asname is not None}
                short |= {key: target for key, target in whole.items() if target in names}
            elif isinstance(node, ast.Attribute) and dotted(node.value) in short:
                used.add(f"{short[dotted(node.value)]}.{node.attr}")
            elif isinstance(node, ast.Call) and dotted(node.func) == "inspect.getsource":
                used |= {f"{short.get(dotted(one))}.*" for one in node.args}
    return used


def interface_of(node: ast.AST | None) -> set[str]:
    """Names in the annotations of a function; of a class in its bases, its attributes and its methods as well."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        given = node.args
        each = (*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg)
        return names_in(node.returns, *(one.annotation for one in each if one is not None))
    if not isinstance(node, ast.ClassDef):
        return set()
    found = names_in(*node.bases)
    for part in node.body:
        if isinstance(part, ast.Assign | ast.AnnAssign):
            found |= names_in(part.value, getattr(part, "annotation", None))
        elif isinstance(part, Definition) and (not part.name.startswith("_") or part.name.endswith("__")):
            found |= interface_of(part)
    return found


def public_is_used_elsewhere(modules: Sequence[Module]) -> Iterator[Breach]:
    """Functions and classes without an underscore: of use to another module, or a command, or in ``__all__``.

    A class may also be public because the interface of a public one, or a value another module imports, names it.
    """
    used = used_elsewhere(modules)
    for module in modules:
        held = {node.name: node for node in module.tree.body if isinstance(node, Definition)}
        public = {name for name in held if used & {f"{module.name}.{name}", f"{module.name}.*"}}
        public |= {
            name
            for name, node in held.items()
            for one in node.decorator_list
            if isinstance(one, ast.Call) and dotted(one.func).split(".")[-1] in ("command", "callback")
        }
        for node in module.tree.body:
            if isinstance(node, ast.Assign | ast.AnnAssign):
                target = node.targets[0] if isinstance(node, ast.Assign) else node.target
                if dotted(target) == "__all__" and node.value is not None:
                    public |= set(ast.literal_eval(node.value))
                elif f"{module.name}.{dotted(target)}" in used:
                    named = names_in(node.value, getattr(node, "annotation", None))
                    public |= {name for name in named if isinstance(held.get(name), ast.ClassDef)}
        new = public
        while new:
            named = {name for one in new for name in interface_of(held.get(one))} - public
            new = {name for name in named if isinstance(held.get(name), ast.ClassDef)}
            public |= new
        for name, node in held.items():
            if not name.startswith("_") and name not in public:
                rule = "public is what another module of the product uses: call it private, or delete it"
                yield Breach(module.name, node.lineno, f"{name} is used by no other module", rule)


RULES: tuple[Callable[[Sequence[Module]], Iterator[Breach]], ...] = (
    imports_go_down,
    every_room_has_a_floor,
    no_circles,
    no_loose_modules,
    folders_stay_small,
    functions_stay_small,
    a_class_name_is_used_once,
    a_manifest_is_a_record,
    a_constant_is_defined_once,
    public_is_used_elsewhere,
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
            _lines("pmg.pipeline.fit.noise", "from pmg.pipeline.diagnosis.engine.scan import scan"),
            _lines("pmg.pipeline.diagnosis.engine.scan", ""),
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
    (
        functions_stay_small,
        "a method of 61 lines",
        (_lines("pmg.sim.roots", "class A:\n    def f(self):\n" + "        a = 1\n" * MOST_LINES),),
    ),
    (
        functions_stay_small,
        "a function within a function, of nine parameters",
        (_lines("pmg.sim.roots", "def f():\n    def g(a, b, c, /, d, *e, f, g, h, **i):\n        pass"),),
    ),
    (
        a_constant_is_defined_once,
        "a constant defined in two rooms",
        (_lines("pmg.sim.signals", "HOUR = 3600.0"), _lines("pmg.pipeline.fit.drift", "A, HOUR = 1, 3600.0")),
    ),
    (
        a_manifest_is_a_record,
        "a window's mean by its key",
        (_lines("pmg.pipeline.grid.a", "def f(window):\n    return window.document()['means']['sun']"),),
    ),
    (
        a_manifest_is_a_record,
        "a limit asked of a manifest's document",
        (_lines("pmg.pipeline.fit.a", "def f(manifest):\n    return manifest.document().get('limits', 1)"),),
    ),
    (
        a_class_name_is_used_once,
        "a class name in two rooms",
        (_lines("pmg.sim.bench", "class Quantity: ..."), _lines("pmg.pipeline.fit.a", "class Quantity: ...")),
    ),
    (
        public_is_used_elsewhere,
        "a public function for its own module alone",
        (
            _lines("pmg.sim.roots", "def f(): ...\ndef g():\n    return f()"),
            _lines("pmg.sim.a", "from pmg.sim.roots import g"),
        ),
    ),
    (
        public_is_used_elsewhere,
        "a function of the same name in another module",
        (
            _lines("pmg.sim.roots", "def f(): ..."),
            _lines("pmg.sim.bench", "def f(): ..."),
            _lines("pmg.sim.a", "from pmg.sim import bench\nbench.f()"),
        ),
    ),
    (
        public_is_used_elsewhere,
        "a class that only a private function names",
        (_lines("pmg.sim.roots", "class A: ...\ndef _f() -> A: ..."),),
    ),
    (
        public_is_used_elsewhere,
        "a class that imports itself",
        (_lines("pmg.sim.roots", "from pmg.sim.roots import A\nclass A: ..."),),
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
    longest = '    def f(self, a, b, c, d, e, f, g, h):\n        """One.\n\n        Two.\n        """\n'
    longest += "        i = 1\n" * (MOST_LINES - 1)
    sound = (
        Module("pmg.pipeline", ""),
        Module("pmg.pipeline.__main__", "from pmg.pipeline.cli.start import main"),
        Module("pmg.pipeline.cli", ""),
        Module("pmg.pipeline.cli.start", "from pmg.sim import signals\nfrom pmg.sim.roots import a"),
        Module("pmg.sim", ""),
        Module("pmg.sim.signals", "class Array: ...\ndef f(): ...\nclass Part: ...\nclass Whole:\n    part: Part"),
        Module(
            "pmg.sim.roots",
            f"from pmg.sim.signals import Array, Whole\n@command('a')\ndef g(): ...\nclass _A:\n{longest}",
        ),
        Module("pmg.sim.bench", "from pmg.sim import signals\nsignals.f()"),
    )
    assert [str(breach) for rule in RULES for breach in rule(sound)] == []
