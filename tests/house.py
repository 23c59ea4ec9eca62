"""The source text of the product, read: its modules, their imports, and what each runs when it is loaded."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = {"pmg.sim": ROOT / "sim", "pmg.pipeline": ROOT / "pipeline"}


@dataclass(frozen=True)
class Import:
    """One imported name, in full: ``from a.b import c`` is ``a.b.c``; relative imports begin with a dot."""

    target: str
    line: int
    lazy: bool


@dataclass(frozen=True)
class Breach:
    """A rule broken by a module."""

    module: str
    line: int
    found: str
    rule: str

    def __str__(self) -> str:
        return f"{self.module}, line {self.line}: {self.found}; rule: {self.rule}"


@dataclass(frozen=True)
class Module:
    """Source text under its import name."""

    name: str
    source: str

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.source, filename=self.name)

    @cached_property
    def imports(self) -> tuple[Import, ...]:
        """Every import anywhere in the text; lazy ones are not run when the module is loaded."""
        at_load = {id(node) for node in run_on_import(self.tree)}
        found = []
        for node in ast.walk(self.tree):
            lazy = id(node) not in at_load
            if isinstance(node, ast.Import):
                found += [Import(alias.name, node.lineno, lazy) for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                base = "." * node.level + (node.module or "")
                joint = "" if base.endswith(".") else "."
                found += [Import(f"{base}{joint}{alias.name}", node.lineno, lazy) for alias in node.names]
            elif isinstance(node, ast.Call) and dotted(node.func).split(".")[-1] in (
                "import_module",
                "__import__",
            ):
                named = [a.value for a in node.args[:1] if isinstance(a, ast.Constant) and isinstance(a.value, str)]
                found += [Import(name, node.lineno, True) for name in named]
        return tuple(found)


def modules_in(folder: Path, name: str) -> Iterator[Module]:
    """Every module below a folder, under its import name."""
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder).with_suffix("").parts
        parts = parts[:-1] if parts[-1] == "__init__" else parts
        yield Module(".".join((name, *parts)), path.read_text(encoding="utf-8"))


MODULES = tuple(module for name, folder in FOLDERS.items() for module in modules_in(folder, name))
TESTS = tuple(modules_in(ROOT / "tests", "tests"))


def inside(name: str, rooms: Iterable[str]) -> bool:
    """Whether a module or name lies in one of the rooms."""
    return any(fnmatchcase(name, room) or fnmatchcase(name, f"{room}.*") for room in rooms)


def dotted(node: ast.AST) -> str:
    """The name ``a.b.c`` of an expression; what is no plain name begins with ``?``."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return "?"


def is_guard(node: ast.AST) -> bool:
    """``if TYPE_CHECKING`` and ``if __name__ == "__main__"``: not run when the module is imported."""
    return isinstance(node, ast.If) and (
        dotted(node.test).split(".")[-1] == "TYPE_CHECKING"
        or (isinstance(node.test, ast.Compare) and dotted(node.test.left) == "__name__")
    )


def run_on_import(node: ast.AST) -> Iterator[ast.AST]:
    """What Python runs when it imports the module: all but bodies of functions and of the two guards."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            outside = [*child.decorator_list, *child.args.defaults, *filter(None, child.args.kw_defaults)]
            for part in outside:
                yield part
                yield from run_on_import(part)
        elif isinstance(child, ast.If) and is_guard(child):
            for line in child.orelse:
                yield line
                yield from run_on_import(line)
        elif not isinstance(child, ast.Lambda):
            yield child
            yield from run_on_import(child)


# --- rooms and floors ----------------------------------------------------------------------------------

FLOORS: tuple[tuple[str, ...], ...] = (
    ("sim",),
    ("sim.mechanisms", "sim.maps", "pipeline.files", "pipeline.wording", "pipeline.recording"),
    ("sim.steady", "pipeline.store", "pipeline.windows", "pipeline.report"),
    ("sim.dynamics", "pipeline.grid", "pipeline.orders", "pipeline.importers"),
    ("pipeline.fit", "pipeline.motion", "pipeline.machine"),
    (
        "pipeline.diagnosis",
        "pipeline.analysis",
        "pipeline.point_signals",
        "pipeline.settings",
        "pipeline.thesis_figures",
    ),
    ("pipeline.model", "pipeline.campaign_comparison", "pipeline.catalogue", "pipeline.preflight"),
    ("pipeline.simulate",),
    ("pipeline.chapters",),
    ("pipeline.commands",),
    ("pipeline.trials",),
    ("pipeline.cli",),
)
"""Rooms from the ground up. A room imports only from floors below; `pmg.pipeline` itself is the door of the top one."""

DOORS = {"pmg.pipeline": "pipeline.cli", "pmg.pipeline.__main__": "pipeline.cli", "pmg.sim": "sim"}


def room_of(name: str) -> str:
    """The room that a module belongs to; loose modules of ``sim`` are its ground floor."""
    if name in DOORS:
        return DOORS[name]
    parts = name.split(".")[1:]
    room = ".".join(parts[:2])
    return "sim" if parts[0] == "sim" and room not in {room for floor in FLOORS for room in floor} else room


def floor_of(room: str) -> int | None:
    """Floor of a room from 1, None where the table does not know it."""
    return next((number for number, floor in enumerate(FLOORS, 1) if room in floor), None)


def imported_modules(module: Module, names: frozenset[str]) -> dict[str, int]:
    """Modules of the product that a module imports anywhere, lazily or for type checkers too, each with a line."""
    found: dict[str, int] = {}
    for one in module.imports:
        target = one.target
        while target and target not in names:
            target = target.rpartition(".")[0]
        if target and target != module.name:
            found.setdefault(target, one.line)
    return found
