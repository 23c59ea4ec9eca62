"""The table of rooms: who may import what, what a module may do on import, and where units change hands.

Everything here is read from the source text, so an import hidden in a function counts like any other. A
failure names the module, the line, what was found and the rule it breaks; the planted faults at the end show
that every rule can fail.
"""

from __future__ import annotations

import ast
import sys
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING

import pytest

from tests.house import MODULES, TESTS, Breach, Module, dotted, inside, is_guard, run_on_import

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator


def words(text: str) -> frozenset[str]:
    """The words of a text."""
    return frozenset(text.split())


# --- the table -----------------------------------------------------------------------------------------

COMMAND_LINE = ("pmg.pipeline.cli", "pmg.pipeline.__main__")

OWNERS: dict[str, tuple[str, ...]] = {
    "mcap": ("pmg.pipeline.recording", "pmg.pipeline.importers.block_file"),
    "zstandard": ("pmg.pipeline.recording",),
    "lz4": ("pmg.pipeline.recording",),
    "deflate": ("pmg.pipeline.recording",),
    "nptdms": ("pmg.pipeline.importers",),
    "asammdf": ("pmg.pipeline.importers",),
    "h5py": ("pmg.pipeline.importers",),
    "distributed": ("pmg.pipeline.files.parallel",),
    "dask": ("pmg.pipeline.files.parallel",),
    "matplotlib": ("pmg.pipeline.report",),
    "plotly": ("pmg.pipeline.report",),
    "jinja2": ("pmg.pipeline.report",),
    "xlsxwriter": ("pmg.pipeline.report",),
    "sqlite3": ("pmg.pipeline.catalogue",),
    "pydantic": (
        "pmg.pipeline.diagnosis.balance.case_file",
        "pmg.pipeline.files",
        "pmg.pipeline.importers",
        "pmg.pipeline.machine",
        "pmg.pipeline.model.read_model",
        "pmg.pipeline.model.read_motion_model",
        "pmg.pipeline.settings",
        "pmg.pipeline.simulate",
        "pmg.pipeline.windows.limits_file",
    ),
    "typer": COMMAND_LINE,
    "rich": COMMAND_LINE,
}
"""A library that only some rooms may import: formats, drawing and the terminal stay behind one door each."""

MAY_ASK: dict[str, tuple[str, ...]] = {
    "pmg.sim": ("pmg.sim",),
    "pmg.pipeline.recording": ("pmg.pipeline.recording", "pmg.sim"),
    "pmg.pipeline.recording.container": (
        "pmg.pipeline.recording.container",
        "pmg.pipeline.recording.findings",
        "pmg.pipeline.recording.codes",
        "pmg.sim",
    ),
    "pmg.pipeline.report": (
        "pmg.pipeline.report",
        "pmg.pipeline.files.atomic",
        "pmg.pipeline.files.parallel",
        "pmg.pipeline.wording",
        "pmg.sim.errors",
        "pmg.sim.signals",
        "pmg.sim.sources",
    ),
}
"""A room that may ask only some others: physics knows no data, a decoder no analysis, a report no gears."""

SIM_LIBRARIES = frozenset({"numpy", "scipy", "sympy"})
SIM_READERS = {
    "pmg.sim.bench": "it reads bench.toml",
    "pmg.sim.dynamics.kernelcache": "it keeps compiled solvers in the user's cache",
}
SIM_DOORS = " and ".join(f"{name} ({reason})" for name, reason in SIM_READERS.items())
FILE_MODULES = words(
    """os io pathlib shutil tempfile glob fileinput tomllib csv pickle shelve sqlite3 zipfile tarfile gzip bz2
    lzma mmap subprocess socket urllib http importlib"""
)
NUMPY_FILE_CALLS = words("load loadtxt genfromtxt fromfile memmap save savetxt savez savez_compressed tofile")

VAGUE_NAMES = frozenset({"utils", "util", "helpers", "helper", "misc", "common"})

LONGEST = 400
LONG = 300
LONG_WITH_REASON: dict[str, str] = {}
"""Modules past `LONG` lines, each with the reason why it has not been split."""

EFFECTS = words(
    """open print input read_text read_bytes write_text write_bytes mkdir iterdir rglob glob exists is_file
    is_dir unlink getenv getcwd cwd now utcnow today default_rng seed parse_args load loadtxt genfromtxt
    fromfile read_csv read_parquet read_excel read_json scan_parquet scan_csv import_module __import__
    basicConfig simplefilter filterwarnings set_option set_loglevel"""
)
EFFECTS_IN_FULL = frozenset(
    {
        "time.time",
        "time.monotonic",
        "time.perf_counter",
        "matplotlib.use",
        "subprocess.run",
        "resources.files",
    }
)
STATE = frozenset({"os.environ", "sys.argv"})

UNITS_HOME = "pmg.sim.signals"


# --- the rules -----------------------------------------------------------------------------------------


def libraries_keep_to_their_rooms(module: Module) -> Iterator[Breach]:
    for found in module.imports:
        owners = OWNERS.get(found.target.split(".")[0])
        if owners and not inside(module.name, owners):
            yield Breach(module.name, found.line, f"imports {found.target}", f"only {' and '.join(owners)} may")


def rooms_ask_only_those_below(module: Module) -> Iterator[Breach]:
    for room, allowed in MAY_ASK.items():
        for found in module.imports:
            ours = found.target.split(".")[0] == "pmg"
            if ours and inside(module.name, [room]) and not inside(found.target, allowed):
                rule = f"{room} may ask only {', '.join(allowed)}"
                yield Breach(module.name, found.line, f"imports {found.target}", rule)
    for found in module.imports:
        if inside(found.target, COMMAND_LINE) and not inside(module.name, COMMAND_LINE):
            yield Breach(module.name, found.line, f"imports {found.target}", "nothing may ask the command line")


def sim_is_arrays_in_arrays_out(module: Module) -> Iterator[Breach]:
    if not inside(module.name, ["pmg.sim"]):
        return
    for found in module.imports:
        top = found.target.split(".")[0]
        if top and top != "pmg" and top not in sys.stdlib_module_names and top not in SIM_LIBRARIES:
            rule = f"of libraries, sim may import only {', '.join(sorted(SIM_LIBRARIES))}"
            yield Breach(module.name, found.line, f"imports {found.target}", rule)
        if top in FILE_MODULES and module.name not in SIM_READERS:
            rule = f"sim reaches no file but through {SIM_DOORS}"
            yield Breach(module.name, found.line, f"imports {found.target}", rule)
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Call) and module.name not in SIM_READERS:
            called = dotted(node.func)
            by_numpy = called.split(".")[0] in ("np", "numpy") or called.endswith(".tofile")
            if called == "open" or (by_numpy and called.split(".")[-1] in NUMPY_FILE_CALLS):
                rule = f"sim reaches no file but through {SIM_DOORS}"
                yield Breach(module.name, node.lineno, f"calls {called}", rule)


def imports_are_written_in_full(module: Module) -> Iterator[Breach]:
    for found in module.imports:
        parts = found.target.split(".")
        if found.target.startswith("."):
            yield Breach(module.name, found.line, f"imports {found.target}", "no relative imports")
        elif parts[0] in ("sim", "pipeline") or found.target in ("pmg", "pmg.sim", "pmg.pipeline"):
            rule = "imports name the module in full, as in `from pmg.sim.steady.gearbox import Gearbox`"
            yield Breach(module.name, found.line, f"imports {found.target}", rule)
        elif parts[-1] == "*":
            yield Breach(module.name, found.line, f"imports {found.target}", "names are imported one by one")


def modules_are_named_for_what_they_hold(module: Module) -> Iterator[Breach]:
    for part in module.name.split("."):
        if part in VAGUE_NAMES:
            yield Breach(module.name, 1, f"is called {part}", "one module, one noun or one verb")


def modules_stay_short(module: Module) -> Iterator[Breach]:
    lines = len(module.source.splitlines())
    if lines > LONGEST:
        yield Breach(module.name, lines, f"has {lines} lines", f"no module is longer than {LONGEST}")
    elif lines > LONG and module.name not in LONG_WITH_REASON:
        rule = f"past {LONG} lines, split it or give the reason in LONG_WITH_REASON"
        yield Breach(module.name, lines, f"has {lines} lines", rule)
    elif lines <= LONG and module.name in LONG_WITH_REASON:
        yield Breach(module.name, lines, f"has {lines} lines", "take it off LONG_WITH_REASON again")


def only_the_command_line_prints(module: Module) -> Iterator[Breach]:
    if inside(module.name, COMMAND_LINE):
        return
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Call) and dotted(node.func) == "print":
            yield Breach(module.name, node.lineno, "calls print", "only the command line prints")
        elif isinstance(node, ast.Attribute) and dotted(node) in ("sys.stdout", "sys.stderr"):
            yield Breach(module.name, node.lineno, f"uses {dotted(node)}", "only the command line prints")


DEFINITIONS = (ast.Import, ast.ImportFrom, ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Pass)


def defines(statement: ast.stmt) -> bool:
    """Whether a statement of a module or class does no more than define."""
    if isinstance(statement, ast.If):
        return is_guard(statement) and all(map(defines, statement.orelse))
    if isinstance(statement, ast.Try):
        branches = [statement.body, statement.orelse, *(handler.body for handler in statement.handlers)]
        return not statement.finalbody and all(defines(line) for branch in branches for line in branch)
    if isinstance(statement, ast.Expr):
        return isinstance(statement.value, ast.Constant)
    if isinstance(statement, ast.Assign):
        return all(isinstance(target, ast.Name | ast.Tuple) for target in statement.targets)
    if isinstance(statement, ast.AnnAssign):
        return isinstance(statement.target, ast.Name)
    return isinstance(statement, DEFINITIONS) or type(statement).__name__ == "TypeAlias"


def importing_only_defines(module: Module) -> Iterator[Breach]:
    rule = "importing a module does nothing but define"
    bodies = [module.tree.body]
    bodies += [node.body for node in run_on_import(module.tree) if isinstance(node, ast.ClassDef)]
    for statement in (line for body in bodies for line in body):
        if not defines(statement):
            yield Breach(module.name, statement.lineno, f"runs `{ast.unparse(statement)[:60]}` on import", rule)
    for node in run_on_import(module.tree):
        called = dotted(node.func) if isinstance(node, ast.Call) else ""
        if called.split(".")[-1] in EFFECTS or ".".join(called.split(".")[-2:]) in EFFECTS_IN_FULL:
            yield Breach(module.name, getattr(node, "lineno", 0), f"calls {called} on import", rule)
        elif isinstance(node, ast.Attribute) and dotted(node) in STATE:
            yield Breach(module.name, node.lineno, f"reads {dotted(node)} on import", rule)


def chain(node: ast.expr, below: bool = False) -> Iterator[tuple[ast.expr, bool]]:
    """Factors of a product or quotient, each with whether it stands below the line."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
        yield from chain(node.left, below)
        yield from chain(node.right, below != isinstance(node.op, ast.Div))
    elif isinstance(node, ast.UnaryOp):
        yield from chain(node.operand, below)
    else:
        yield node, below


def units_change_hands_in_one_place(module: Module) -> Iterator[Breach]:
    """60 or 30 beside pi or an rpm, and 2 pi on one side of the line; with 180 it is an angle in degrees."""
    if module.name == UNITS_HOME:
        return
    bare_pi = {found.target for found in module.imports} & {"math.pi", "numpy.pi"}
    pies = {"math.pi", "np.pi", "numpy.pi"} | ({"pi"} if bare_pi else set())
    inner: set[int] = set()
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Attribute) and dotted(node) in ("math.tau", "np.tau"):
            yield Breach(module.name, node.lineno, dotted(node), f"a turn is REVOLUTION of {UNITS_HOME}")
        if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div)) or id(node) in inner:
            continue
        inner |= {id(part) for part in ast.walk(node) if isinstance(part, ast.BinOp)} - {id(node)}
        factors = list(chain(node))
        numbers = {(f.value, below) for f, below in factors if isinstance(f, ast.Constant)}
        values = {value for value, _ in numbers}
        pi_sides = {below for f, below in factors if dotted(f) in pies}
        rpm = any("rpm" in dotted(f).lower() for f, _ in factors)
        minute = values & {30, 60} and (pi_sides or rpm)
        turn = any((2, below) in numbers for below in pi_sides)
        if (minute or turn) and 180 not in values:
            rule = f"units change hands through RPM and REVOLUTION of {UNITS_HOME}"
            yield Breach(module.name, node.lineno, f"computes `{ast.unparse(node)[:60]}`", rule)


RULES: tuple[Callable[[Module], Iterator[Breach]], ...] = (
    libraries_keep_to_their_rooms,
    rooms_ask_only_those_below,
    sim_is_arrays_in_arrays_out,
    imports_are_written_in_full,
    modules_are_named_for_what_they_hold,
    modules_stay_short,
    only_the_command_line_prints,
    importing_only_defines,
    units_change_hands_in_one_place,
)


def load_order(modules: Iterable[Module]) -> list[str]:
    """Order in which the modules can be loaded, each after those it imports when it is loaded itself."""
    by_name = {module.name: module for module in modules}
    graph: dict[str, set[str]] = {}
    for name, module in by_name.items():
        targets = {found.target for found in module.imports if not found.lazy}
        needed = {target if target in by_name else target.rpartition(".")[0] for target in targets}
        graph[name] = needed & by_name.keys()
    return list(TopologicalSorter(graph).static_order())


# --- the tests -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_every_module_keeps_the_rule(rule: Callable[[Module], Iterator[Breach]]) -> None:
    breaches = [str(breach) for module in MODULES for breach in rule(module)]
    assert not breaches, "\n" + "\n".join(breaches)


def test_tests_name_the_rooms_in_full_too() -> None:
    """Only among themselves may tests import relatively: they are not shipped and have no name in full."""
    found = [breach for module in TESTS for breach in imports_are_written_in_full(module)]
    breaches = [str(breach) for breach in found if "relative" not in breach.rule]
    assert not breaches, "\n" + "\n".join(breaches)


def test_no_module_needs_itself_to_be_loaded() -> None:
    try:
        order = load_order(MODULES)
    except CycleError as error:
        pytest.fail("modules import one another in a circle: " + " <- ".join(error.args[1]))
    assert order.index("pmg.sim.errors") < order.index("pmg.sim.grid")


def test_the_table_sees_both_rooms_and_lists_no_module_that_is_gone() -> None:
    names = {module.name for module in MODULES}
    assert {"pmg.sim.signals", "pmg.sim.bench", "pmg.pipeline.fit.loss_fit"} <= names
    assert len(names) == len(MODULES)
    assert set(LONG_WITH_REASON) <= names


PLANTED: tuple[tuple[Callable[[Module], Iterator[Breach]], str, str], ...] = (
    (libraries_keep_to_their_rooms, "pmg.pipeline.fit.loss_fit", "import mcap.reader"),
    (libraries_keep_to_their_rooms, "pmg.pipeline.report.html", "from mcap import reader"),
    (libraries_keep_to_their_rooms, "pmg.pipeline.fit.loss_fit", "def draw():\n    import matplotlib.pyplot as plt"),
    (libraries_keep_to_their_rooms, "pmg.pipeline.reporting", "from jinja2 import Template"),
    (
        libraries_keep_to_their_rooms,
        "pmg.pipeline.fit.loss_fit",
        "import importlib\ndef f():\n    importlib.import_module('plotly.io')",
    ),
    (
        libraries_keep_to_their_rooms,
        "pmg.pipeline.fit.loss_fit",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import typer",
    ),
    (rooms_ask_only_those_below, "pmg.sim.steady.solve", "from pmg.pipeline.fit.loss_fit import fit_losses"),
    (rooms_ask_only_those_below, "pmg.pipeline.report.html", "from pmg.sim.steady.gearbox import Gearbox"),
    (rooms_ask_only_those_below, "pmg.pipeline.recording.decode", "from pmg.pipeline.store.store import Store"),
    (rooms_ask_only_those_below, "pmg.pipeline.store.store", "from pmg.pipeline.cli.app import main"),
    (sim_is_arrays_in_arrays_out, "pmg.sim.steady.solve", "import pandas as pd"),
    (sim_is_arrays_in_arrays_out, "pmg.sim.steady.solve", "def f():\n    from pathlib import Path"),
    (sim_is_arrays_in_arrays_out, "pmg.sim.steady.solve", "def f():\n    return open('x')"),
    (
        sim_is_arrays_in_arrays_out,
        "pmg.sim.maps.torque_map",
        "import numpy as np\ndef f(p):\n    return np.loadtxt(p)",
    ),
    (imports_are_written_in_full, "pmg.pipeline.fit.loss_fit", "import sim"),
    (imports_are_written_in_full, "pmg.pipeline.fit.loss_fit", "from sim.gearbox import Gearbox"),
    (imports_are_written_in_full, "pmg.pipeline.fit.loss_fit", "from pmg import sim"),
    (imports_are_written_in_full, "pmg.sim.steady.solve", "from .grid import Grid"),
    (imports_are_written_in_full, "pmg.sim.steady.solve", "from . import grid"),
    (imports_are_written_in_full, "pmg.sim.steady.solve", "from pmg.sim.grid import *"),
    (modules_are_named_for_what_they_hold, "pmg.pipeline.utils", ""),
    (modules_are_named_for_what_they_hold, "pmg.sim.helpers.arrays", ""),
    (modules_stay_short, "pmg.sim.steady.solve", "x = 1\n" * 401),
    (modules_stay_short, "pmg.sim.steady.solve", "x = 1\n" * 301),
    (only_the_command_line_prints, "pmg.pipeline.fit.loss_fit", "def f():\n    print(1)"),
    (only_the_command_line_prints, "pmg.sim.steady.solve", "import sys\ndef f():\n    sys.stderr.write('')"),
    (importing_only_defines, "pmg.sim.steady.solve", "register(1)"),
    (importing_only_defines, "pmg.sim.steady.solve", "class A:\n    register(1)"),
    (importing_only_defines, "pmg.sim.steady.solve", "for i in range(3):\n    pass"),
    (importing_only_defines, "pmg.sim.steady.solve", "KNOWN = {}\nKNOWN['a'] = 1"),
    (importing_only_defines, "pmg.sim.steady.solve", "from a import b\nb.c = 1"),
    (importing_only_defines, "pmg.sim.steady.solve", "TABLE = open('x').read()"),
    (importing_only_defines, "pmg.sim.steady.solve", "TEXT = (HERE / 'x').read_text()"),
    (importing_only_defines, "pmg.sim.steady.solve", "def f(when=datetime.now()):\n    pass"),
    (importing_only_defines, "pmg.sim.steady.solve", "import os\nHOME = os.environ['HOME']"),
    (units_change_hands_in_one_place, "pmg.sim.steady.solve", "import math\nx = n * math.pi / 30"),
    (units_change_hands_in_one_place, "pmg.sim.steady.solve", "import numpy as np\nx = n * (2.0 * np.pi) / 60.0"),
    (units_change_hands_in_one_place, "pmg.sim.steady.solve", "from math import pi\nx = omega / (2 * pi)"),
    (units_change_hands_in_one_place, "pmg.sim.steady.solve", "import math\nx = math.tau"),
    (units_change_hands_in_one_place, "pmg.pipeline.store.store", "x = edges * speed_rpm / 60"),
)


@pytest.mark.parametrize(("rule", "name", "source"), PLANTED)
def test_a_planted_fault_is_found_and_named(rule: Callable[[Module], Iterator[Breach]], name: str, source: str) -> None:
    found = list(rule(Module(name, source)))
    assert found, f"{rule.__name__} lets pass: {source}"
    assert str(found[0]).startswith(f"{name}, line ")
    assert found[0].found
    assert "; rule: " in str(found[0])


SOUND: tuple[tuple[str, str], ...] = (
    (
        "pmg.pipeline.recording.container.contents",
        "from mcap.records import Chunk\nfrom pmg.sim.errors import RecordingError",
    ),
    ("pmg.pipeline.report.html", "import jinja2\nfrom pmg.pipeline.report.table import Table"),
    (
        "pmg.pipeline.cli.report",
        "import typer\napp = typer.Typer()\n@app.command()\ndef f() -> None:\n    print(1)",
    ),
    ("pmg.pipeline.fit.loss_fit", "from pmg.sim import signals, sources\nimport math\nAREA = math.pi * 3.0**2"),
    ("pmg.pipeline.fit.loss_fit", "import math\nSLOPES = (math.pi / 2, 60 * math.pi / 180, 2 * 60, window * 60)"),
    ("pmg.pipeline.fit.loss_fit", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pathlib import Path"),
    ("pmg.pipeline.store.store", "import re\nNAME = re.compile('x')\ndef f(p):\n    return open(p)"),
    ("pmg.pipeline.__main__", "from pmg.pipeline.cli.app import main\nif __name__ == '__main__':\n    main()"),
    (
        "pmg.sim.bench",
        "import tomllib\nfrom importlib import resources\ndef f():\n    return resources.files('a')",
    ),
    ("pmg.sim.signals", "import math\nRPM = math.pi / 30.0"),
    (
        "pmg.sim.steady.solve",
        '"""Text."""\nx: int = 1\n"""Meaning."""\nclass A:\n    """Text."""\n    y = field(z=1)',
    ),
)


@pytest.mark.parametrize(("name", "source"), SOUND)
def test_sound_source_raises_no_alarm(name: str, source: str) -> None:
    breaches = [str(breach) for rule in RULES for breach in rule(Module(name, source))]
    assert not breaches, "\n".join(breaches)


def test_a_circle_of_imports_is_found_and_a_lazy_import_is_none() -> None:
    one = Module("pmg.sim.one", "from pmg.sim.two import b")
    two = Module("pmg.sim.two", "from pmg.sim import one")
    lazy = Module("pmg.sim.two", "def f():\n    from pmg.sim.one import a")
    with pytest.raises(CycleError):
        load_order([one, two])
    assert load_order([one, lazy]) == ["pmg.sim.two", "pmg.sim.one"]
    package = Module("pmg.sim", "from pmg.sim.one import a")
    part = Module("pmg.sim.one", "from pmg.sim import two")
    assert load_order([package, part, lazy]) == ["pmg.sim.two", "pmg.sim.one", "pmg.sim"]
